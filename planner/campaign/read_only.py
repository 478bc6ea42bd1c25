"""What a campaign folder says: its log, the state and the model that follow from it."""

import copy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeVar, cast

import msgspec
import numpy as np

from planner import content_hash
from planner.campaign import store
from planner.campaign.config import load_campaign_config
from planner.campaign.events import Configured, Entry, Imported, Refused
from planner.campaign.journal import Journal
from planner.campaign.state import CampaignState, Measurement, fold
from planner.campaign.store import KeptRecordings
from planner.dataset.store import Store, user_store
from planner.errors import InputError
from planner.progress import ProgressCallback, no_progress
from planner.toml_file import read_toml_text
from planner.version import __version__

# Imported where they are needed: with what is kept of a model, `status` needs none of them.
if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from planner.campaign.cell import Cell
    from planner.campaign.model import Model
    from planner.dataset.dataset import Dataset
    from planner.dataset.visits import Recording
    from planner.frf.frf import Frf
    from planner.surrogate.frf_bands import ModalPrediction

T = TypeVar("T")

LIBRARIES = "msgspec", "numpy", "scipy", "jax", "jaxlib", "pin"  # that a model is computed by


class ReadOnlyCampaign:
    """What can be asked of a campaign folder; nothing here writes into it."""

    def __init__(self, directory: Path | str, models: Store | None = None):
        """Open a folder; `models` keeps what was computed, by default the user's store."""
        self.directory = Path(directory).resolve()
        self._kept = user_store() if models is None else models
        self._journal = Journal(self.directory / store.LOG)
        self._memory: dict[str, tuple[Any, Any]] = {}  # by what it is: of which, and that itself
        self._force_n: float | None = None

    def _remembered(self, what: str, of: Any, make: Callable[[], T]) -> T:
        """What follows from `of`, made once for as long as that is the same."""
        known = self._memory.get(what)
        if known is None or known[0] != of:
            known = self._memory[what] = of, make()
        return known[1]

    def __repr__(self) -> str:
        state = self.state
        measured, open_ = len(state.used), len(state.open)
        return f"Campaign({str(self.directory)!r}: {measured} poses measured, {open_} proposed)"

    @property
    def entries(self) -> tuple[Entry, ...]:
        """The log."""
        return self._journal.entries

    @property
    def torn_bytes(self) -> int:
        """Length of a torn last line, which the next act sets aside."""
        return self._journal.torn_bytes

    @property
    def state(self) -> CampaignState:
        """The fold over the log, with changes made by hand to the configuration."""
        state = self._remembered("state", self.entries, lambda: fold(self.entries))
        if state.configured is None:
            raise InputError(
                f"{self.directory} holds an empty log; start the campaign again with planner new."
            )
        return state

    @property
    def cell(self) -> "Cell":
        """Robot, simulation and workspace as configured now."""
        configured = self._configured()

        def load() -> "Cell":
            from planner.campaign.cell import Cell

            loaded = Cell.load(self.directory / configured.config.robot, configured.config)
            if loaded.robot.joints.declared != configured.joint_units:
                raise InputError(
                    f"{loaded.robot.urdf_path}: other joints slide than when the campaign began, "
                    f"so that places in its log would be read wrongly; start a new campaign."
                )
            return loaded

        return self._remembered("cell", content_hash.of(configured), load)

    @property
    def robot_toml(self) -> Path:
        """The robot's robot.toml in the campaign's folder."""
        return self.directory / self.cell.config.robot

    @property
    def model(self) -> "Model":
        """The model after all measurements; fitted once per state, then kept on disk."""
        state, configured = self.state, content_hash.of(self._configured())

        def find() -> "Model":
            found = self.kept_model(state) or self._fitted(state)
            # With the candidates that were worked out for it.
            self._memory["cell"] = configured, found.cell
            return found

        return self._remembered("model", (configured, state.model_version), find)

    def kept_model(self, state: CampaignState) -> "Model | None":
        """The model of an earlier state of this configuration, where it is kept on disk."""
        # Of whichever class: it is not imported, with all that it takes, where nothing is kept.
        return cast("Model | None", self._kept.get(self._key("model", state.used), object))

    def _key(self, what: str, used: tuple[Measurement, ...], where: str | None = None) -> str:
        """Name in the store of what is a function of configuration and measurements in use.

        The robot of a model knows its files by their paths, so the folder is part of it.
        """
        where = str(self.directory) if where is None else where
        measured = tuple(replace(m, time="") for m in used)
        told = content_hash.of(self._configured()), content_hash.of(measured)
        computes = content_hash.program(), content_hash.libraries(*LIBRARIES)
        return content_hash.digest(what, *computes, where, *told)

    def of_model(self, what: str, kind: type[T], make: Callable[["Model"], T]) -> T:
        """What follows from the model, kept on disk: where it is, the model is not loaded.

        Args:
            what: Name of it, one for each `make`.
            kind: Its class.
            make: Makes it from the model.
        """
        return self._kept.result(self._key(what, self.state.used), kind, lambda: make(self.model))

    def _fitted(self, state: CampaignState) -> "Model":
        from threadpoolctl import threadpool_limits

        from planner.campaign.build import build
        from planner.fit.fitted import FitRecord

        kept = self.recordings
        kept.look_through(state.used, self._kept)  # a damaged one is told now

        def recall(used: tuple[Measurement, ...], find: Callable[[], FitRecord]) -> FitRecord:
            # What was fitted does not know where files are: a copy of the campaign finds it.
            bare = (
                replace(m, hits=tuple(msgspec.structs.replace(h, file="") for h in m.hits))
                for m in used
            )
            return self._kept.result(self._key("fit", tuple(bare), ""), FitRecord, find)

        with threadpool_limits(1):
            model = build(self.cell, state, kept.hits, recall)
            _ = model.frequency_sd_percent, model.frf_sd_percent  # kept: every command needs them
        self._kept.put(self._key("model", state.used), model)
        return model

    @property
    def recordings(self) -> KeptRecordings:
        """The recordings that were imported, by the points of the robot as configured now."""
        return KeptRecordings(self.directory, self.cell)

    def posture(self, pose: str | None) -> np.ndarray:
        """Joint angles (dof,) in rad of a measured or proposed pose; InputError names them."""
        state = self.state
        known = {name: p.joints_deg for name, p in state.proposals.items()}
        known |= {name: m.joints_deg for name, m in state.measurements.items()}
        if pose is None or pose not in known:
            given = f"has no pose {pose}; choose" if pose else "is a campaign: say at which pose,"
            some = ", ".join([*list(known)[:5], *["…"] * (len(known) > 5)]) or "none yet"
            raise InputError(f"{self.directory} {given} one of {some} with --pose.")
        return self.cell.robot.joints.internal(known[pose])

    def frf_of(self, measurement: Measurement) -> "Frf":
        """The FRF matrix of a measured pose, estimated again from its recordings if need be."""
        return self.recordings.hits(measurement).averaged

    def dataset(
        self,
        band_hz: tuple[float, float],
        *,
        window_rate_1_s: float = 0.0,
        progress: ProgressCallback = no_progress,
    ) -> "Dataset":
        """Of `used_recordings`, and raises as they do."""
        from planner.dataset.dataset import Dataset

        found = Dataset.of(
            self.used_recordings,
            band_hz,
            window_rate_1_s=window_rate_1_s,
            progress=progress,
            name=str(self.directory),
        )
        return replace(found, remarks=(*self.model.low.misread, *found.remarks))

    @property
    def used_recordings(self) -> "tuple[Recording, ...]":
        """The accepted recordings of all poses in use, in the order of import, where these stood.

        Raises InputError where there are none.
        """
        from planner.dataset.visits import Recording

        kept, used = self.recordings, self.state.used
        if not used:
            raise InputError(f"{self.directory} holds no hits yet; import recordings first.")
        stated = self.cell.robot.joints.internal([m.joints_deg for m in used])
        return tuple(
            Recording(measurement.pose, q, source)
            for measurement, q in zip(used, self.model.low.stood(stated), strict=True)
            for source in map(kept.source, measurement.accepted)
        )

    def orphans(self) -> list[str]:
        """Recordings stored without an import: the program was stopped in between."""
        known = {
            hit.sha256
            for e in self.entries
            if isinstance(e.event, Imported | Refused)
            for hit in e.event.hits
        }
        kept = (self.directory / store.RECORDINGS).glob("[0-9a-f]*")
        return sorted(p.name for p in kept if p.suffix != ".robot" and p.name[:64] not in known)

    def _configured(self) -> Configured:
        """What campaign.toml and the robot folder say now (the log follows with the next act)."""
        path = self.directory / store.CONFIG
        text = read_toml_text(path, store.CONFIG)
        config = self._remembered("config", text, lambda: load_campaign_config(path))
        hashes = store.robot_hashes(self.directory)
        begun = next(e.event for e in self.entries if isinstance(e.event, Configured))
        return Configured(config, hashes, __version__, begun.joint_units)

    # -- what is expected ----------------------------------------------------------------------

    def predict(self, *, joints_deg: "ArrayLike") -> "ModalPrediction":
        """Frequencies (Hz) and damping ratios (n, count), with sds, at poses (n, dof) in degrees.

        Places of joints that slide are in mm, here and below.
        """
        return self.model.predict(self.cell.poses(joints_deg))

    def frf(
        self, *, joints_deg: "ArrayLike", frequency_hz: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """FRFs at poses, with their uncertainty.

        Args:
            joints_deg: Joint angles (n, dof) in degrees, in the order of the robot's joints.
            frequency_hz: Lines (F,) in Hz; by default `frequency_lines`.

        Returns:
            Mean (n, 3, 3, F), complex, and sd (n, 3, 3, F) of the accelerance in m/s²/N: response
            axis, then hit axis.
        """
        return self.frf_at(self.cell.poses(joints_deg), frequency_hz)

    def struck_with(self, force_n: float | None) -> Self:
        """The same campaign, whose `frf_at` linearises joints' laws for hits of a peak force."""
        other = copy.copy(self)
        other._force_n = force_n
        return other

    def frf_at(
        self, q: np.ndarray, frequency_hz: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """As `frf`, at poses q (n, dof) in rad; what was worked out for it is kept."""
        lines, model = self.frequency_lines if frequency_hz is None else frequency_hz, self.model
        known, q = model.knows_frfs, np.atleast_2d(q)
        mean, sd = model.frf(q, lines)
        if known != model.knows_frfs:
            self._kept.put(self._key("model", self.state.used), model)
        if self._force_n is not None and (struck := model.struck) is not None:
            from planner.dynamics.at_force import change_at_force

            mean = mean + change_at_force(
                struck, q, np.full(len(q), self._force_n), lines, in_time=False
            )
        return mean, sd

    def records(self) -> list[dict[str, Any]]:
        """All measured modes, one row each: what pandas.DataFrame takes."""
        from planner.campaign.labels import measured_records

        return measured_records(self.cell, self.state)

    def predict_records(self, *, joints_deg: "ArrayLike") -> list[dict[str, Any]]:
        """`predict` as rows, one for each mode of each pose."""
        from planner.campaign.labels import predicted_records

        return predicted_records(self.model, joints_deg)

    @property
    def frequency_lines(self) -> np.ndarray:
        """Lines (F,) in Hz over campaign.toml's band."""
        from planner.frf.synthesis import frequency_lines

        return frequency_lines(self.cell.config.modes.band_hz)
