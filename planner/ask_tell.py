"""Ask and tell: a campaign in memory, for scripts that measure by themselves.

Nothing is written; what was told is gone with the process unless the script keeps it. Files, hits
that may be refused, and a log are what `Campaign` is for.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from planner.campaign.build import build, hits_unknown
from planner.campaign.cell import Cell, refuse_errors
from planner.campaign.config import CampaignConfig, check_config, load_campaign_config
from planner.campaign.events import MeasuredMode, Proposal
from planner.campaign.labels import (
    NUMBERS,
    from_modal,
    from_mode,
    measured_records,
    predicted_records,
)
from planner.campaign.low_fidelity import in_memory
from planner.campaign.model import Model
from planner.campaign.proposals import propose
from planner.campaign.state import CampaignState, Measurement
from planner.errors import InputError, RefusedError
from planner.frf.frf import Frf
from planner.modal.estimate_modes import estimate_modes
from planner.modal.modes import UNSCALED, ModalModel, Mode
from planner.robot.robot import Robot
from planner.toml_file import wrong_entry

if TYPE_CHECKING:
    from planner.surrogate.frf_bands import ModalPrediction

# A frequency without an sd of its own: what careful modal analyses of hammer tests leave open.
FREQUENCY_SD, DAMPING_SD = 1e-3, 0.1  # relative
TABLES = "the tables of campaign.toml"


class AskTell:
    """Proposes poses and learns from what is told of them.

    Angles are in degrees here, and places of joints that slide in mm, as controllers show them.
    """

    def __init__(self, robot: Robot | Path | str, tables: Path | str | Mapping[str, Any]):
        """Begin.

        Args:
            robot: A robot, or the path of its robot.toml.
            tables: A campaign.toml, or its tables as a mapping: {"workspace": {"joints_deg": …}}.

        Raises:
            InputError: Robot and tables make no sense, by themselves or together.
        """
        loaded = robot if isinstance(robot, Robot) else Robot.load(Path(robot))
        if isinstance(tables, Mapping):
            try:
                config = msgspec.convert(dict(tables), CampaignConfig)
            except msgspec.ValidationError as error:
                said = wrong_entry(TABLES, "campaign.toml", tables, CampaignConfig, str(error))
                raise InputError(said) from None
            check_config(config, Path(TABLES))
        else:
            config = load_campaign_config(Path(tables))
        self._cell = Cell.load(loaded, config)
        refuse_errors(self._cell.examined)
        self._recall = in_memory()
        self._state = CampaignState()
        self._frfs: dict[str, Frf] = {}
        self._model: Model | None = None

    def ask(self, count: int = 1, acquisition: str | None = None) -> tuple[Proposal, ...]:
        """The next poses to measure, best first.

        Raises:
            NoPoseLeftError: No reachable pose is left.
            InputError: There is no such acquisition.
        """
        with threadpool_limits(1):
            name = acquisition or self._cell.config.acquisition.name
            found = propose(self.model, self._state, count, name)
        made = self._state.proposals_made + len(found)
        known = {**self._state.proposals, **{p.pose: p for p in found}}
        self._state = replace(self._state, proposals=known, proposals_made=made)
        return found

    def tell(
        self,
        joints_deg: Sequence[float],
        *,
        modes: ModalModel | Sequence[Mode | Mapping[str, float] | Sequence[float]] | None = None,
        frf: Frf | None = None,
        pose: str | None = None,
    ) -> str:
        """Say what was measured at a pose; a pose told again replaces what was told before.

        Args:
            joints_deg: Joint angles (dof,) in degrees (mm of joints that slide), as read back.
            modes: A modal analysis, or modes one by one: with the keys frequency_hz,
                frequency_sd_hz, damping_ratio, damping_sd (the sds may be missing), or numbers in
                that order.
            frf: The FRF matrix instead; its modes are identified here.
            pose: A name; by default T001, T002, …

        Returns:
            The pose's name.

        Raises:
            InputError: Neither or both are given, the robot cannot stand there, or modes alone are
                given to a simulation that learns from FRFs ([fidelity] simulation = "updated").
            RefusedError: No mode was found in the FRFs.
        """
        if (modes is None) == (frf is None):
            raise InputError("Give either modes or frf of a pose.")
        angles = tuple(float(v) for v in joints_deg)
        self._cell.check_pose(angles, "joints_deg")
        table = self._cell.config.modes
        if frf is not None:
            with threadpool_limits(1):
                found = from_modal(estimate_modes(frf, table.band_hz))
        elif self._cell.config.fidelity.simulation == "updated":
            raise InputError(
                "Modes alone do not tell a simulation's parameters: tell FRFs, or set [fidelity] "
                'simulation = "frozen".'
            )
        else:
            assert modes is not None
            given = (*modes.modes, *modes.doubtful) if isinstance(modes, ModalModel) else modes
            found = tuple(sorted((_mode(m) for m in given), key=lambda m: m.frequency_hz))
        if not any(mode.likely for mode in found):
            raise RefusedError("There is no mode at this pose; look at its recordings.")
        name = pose or f"T{len(self._state.measurements) + 1:03d}"
        measured = Measurement(name, angles, (), found)
        known = {**self._state.measurements, name: measured}
        self._state = replace(self._state, measurements=known, events=self._state.events + 1)
        self._frfs[name] = frf if frf is not None else _unmeasured(table.band_hz)
        self._model = None
        return name

    @property
    def model(self) -> Model:
        """What is believed after all that was told."""
        if self._model is None:
            with threadpool_limits(1):
                hits_of = hits_unknown(self._frfs)
                self._model = build(self._cell, self._state, hits_of, self._recall)
        return self._model

    @property
    def done(self) -> bool:
        """Whether the target of [stop] is reached."""
        return bool(self.model.done)

    def predict(self, joints_deg: ArrayLike) -> "ModalPrediction":
        """Frequencies (Hz), damping ratios (n, count), sds at poses (n, dof) in degrees."""
        return self.model.predict(self._cell.poses(joints_deg))

    def frf(self, joints_deg: ArrayLike, frequency_hz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Accelerance in m/s²/N at poses (n, dof) in degrees and lines (F,) in Hz.

        Returns:
            Mean (n, 3, 3, F), complex, and sd (n, 3, 3, F).

        Raises:
            InputError: Of some pose modes alone were told.
        """
        if any(not frf.measured.any() for frf in self._frfs.values()):
            raise InputError("FRFs are predicted from FRFs; of some poses only modes were told.")
        return self.model.frf(self._cell.poses(joints_deg), np.asarray(frequency_hz, dtype=float))

    def records(self) -> list[dict[str, Any]]:
        """All modes that were told, one row each: what pandas.DataFrame takes."""
        return measured_records(self._cell, self._state)

    def predict_records(self, joints_deg: ArrayLike) -> list[dict[str, Any]]:
        """`predict` as rows, one for each mode of each pose."""
        return predicted_records(self.model, joints_deg)


def _mode(given: Mode | Mapping[str, float] | Sequence[float]) -> MeasuredMode:
    """A mode as it was told; what was not said is unknown (NaN, null)."""
    if isinstance(given, Mode):
        return from_mode(given)
    values = given if isinstance(given, Mapping) else dict(zip(NUMBERS, given, strict=False))
    unknown = set(values) - set(NUMBERS)
    if unknown or "frequency_hz" not in values:
        said = sorted(unknown) or "the first"
        raise InputError(f"A mode has {', '.join(NUMBERS)}; {said} is not.")
    f = float(values["frequency_hz"])
    zeta = float(values.get("damping_ratio", np.nan))
    sd = float(values.get("frequency_sd_hz", FREQUENCY_SD * f))
    damping_sd = float(values.get("damping_sd", DAMPING_SD * zeta))
    if not (f > 0 and sd > 0 and np.isfinite(f + sd)) or zeta < 0 or damping_sd < 0:
        raise InputError(
            f"A mode of {f:g} ± {sd:g} Hz, damping {zeta:g} ± {damping_sd:g}, is none."
        )
    return from_mode(Mode(f, sd, zeta, damping_sd, *UNSCALED, np.full(3, np.nan + 0j)))


def _unmeasured(band_hz: tuple[float, float]) -> Frf:
    """Stands for the FRFs of a pose of which modes alone were told."""
    lines, none = np.linspace(*band_hz, 2), np.full((3, 3, 2), np.nan)
    return Frf(lines, none.astype(complex), none, none, (0, 0, 0), band_hz)
