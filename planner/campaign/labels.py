"""Measured modes: from and to the log, labels 1…count over all poses, rows for a DataFrame."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from planner.campaign.cell import Cell
from planner.campaign.events import MeasuredMode
from planner.campaign.low_fidelity import LowFidelity
from planner.campaign.state import CampaignState, Measurement
from planner.dynamics.vibration import SimulatedModes
from planner.modal.modes import ModalModel, Mode
from planner.modal.tracking import Guide, track
from planner.surrogate.modal_surrogate import ModalObservations

if TYPE_CHECKING:
    from planner.campaign.model import Model

# Simulated modes above those modelled that a measured mode may be instead: where one of the
# modelled ones cannot be seen (nodal point), the next one must not take its label.
ABOVE = 2
NUMBERS = "frequency_hz", "frequency_sd_hz", "damping_ratio", "damping_sd"  # of a mode


def to_mode(measured: MeasuredMode) -> Mode:
    """A mode as the numerics want it, from how the log keeps it."""
    real, imaginary, sd = np.array(measured.residue, dtype=float).T.reshape(3, 3, 3)  # None: NaN
    numbers = {name: getattr(measured, name) for name in (*NUMBERS, "probability")}
    shape = np.array([complex(re, im) for re, im in measured.shape])
    return Mode(**numbers, residue=real + 1j * imaginary, residue_sd=sd, shape=shape)


def from_mode(mode: Mode) -> MeasuredMode:
    """A mode as the log keeps it."""

    def number(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    cells = zip(mode.residue.ravel(), mode.residue_sd.ravel(), strict=True)
    return MeasuredMode(
        **{name: float(getattr(mode, name)) for name in (*NUMBERS, "probability")},
        shape=tuple((float(s.real), float(s.imag)) for s in mode.shape),
        residue=tuple((number(r.real), number(r.imag), number(sd)) for r, sd in cells),
    )


def from_modal(modal: ModalModel | None) -> tuple[MeasuredMode, ...]:
    """All modes of a pose as the log keeps them, doubtful ones too, in order of frequency."""
    if modal is None:
        return ()
    every = sorted((*modal.modes, *modal.doubtful), key=lambda mode: mode.frequency_hz)
    return tuple(from_mode(mode) for mode in every)


@dataclass(frozen=True, eq=False)
class LabelledPose:
    """A measured pose, q (dof,) in rad where it stood, with its modes by label (None: not found).

    `simulated` are the simulation's (1, count), NaN where it has no such mode. They are the robot's
    `own` where nothing was on it, or held it, that is not there elsewhere.
    """

    pose: str
    q: np.ndarray
    modes: tuple[Mode | None, ...]
    probability: np.ndarray  # (count,) that the label is right
    simulated: SimulatedModes
    own: bool = True

    @property
    def simulated_hz(self) -> np.ndarray:
        """Natural frequencies (count,) by the simulation."""
        return self.simulated.frequency_hz[0]


def label(
    cell: Cell, measurements: tuple[Measurement, ...], low: LowFidelity | None = None
) -> tuple[LabelledPose, ...]:
    """Label every pose's modes, guided by the simulation and by the poses labelled before.

    Labels are places in the order of frequency: they are continuous over any workspace, which
    families of shapes are not where modes veer (see `planner.dynamics.mode_families`).
    """
    if not measurements:
        return ()
    low = low or cell.frozen
    q = low.stood(cell.robot.joints.internal([m.joints_deg for m in measurements]))
    modes = [tuple(to_mode(mode) for mode in m.modes) for m in measurements]
    count = cell.config.modes.count
    simulated = low.simulate(q, ABOVE)
    guide = Guide(simulated.frequency_hz, simulated.shape)
    if not np.any(np.isfinite(simulated.frequency_hz)):
        guide = Guide.by_example(modes, count + ABOVE)
    lowest = simulated[:, :count]
    tracks = track(modes, guide, cell.features(q), ordered=True)
    return tuple(
        LabelledPose(
            m.pose,
            q[i],
            tracks.modes[i][:count],
            tracks.probability[i, :count],
            lowest[i : i + 1],
            m.pose not in low.of_other_robots,
        )
        for i, m in enumerate(measurements)
    )


def gathered(
    x: np.ndarray, modes: Sequence[Sequence[Mode | None]], simulated: SimulatedModes
) -> ModalObservations:
    """Modes by label as arrays, NaN where one was not found; x (n, d), `simulated` (n, count)."""
    shape = simulated.frequency_hz.shape
    values = {name: np.full(shape, np.nan) for name in NUMBERS}
    values |= {"residue": np.full((*shape, 3, 3), np.nan + 1j * np.nan)}
    values |= {"residue_sd": np.full((*shape, 3, 3), np.nan)}
    for i, row in enumerate(modes):
        for k, mode in enumerate(row[: shape[1]]):
            for name, array in values.items() if mode is not None else ():
                array[i, k] = getattr(mode, name)
    return ModalObservations(x, **values, simulated=simulated)


def observations(cell: Cell, labelled: tuple[LabelledPose, ...]) -> ModalObservations:
    """The labelled modes as arrays, NaN where one was not found or is not the robot's own, or a
    column was not hit."""
    count, n = cell.config.modes.count, len(labelled)
    q = np.array([p.q for p in labelled]).reshape(n, len(cell.robot.joint_names))
    empty = np.zeros((0, count))
    simulated = SimulatedModes(empty, empty, np.zeros((0, count, 3, 3), complex))
    if n:
        simulated = SimulatedModes.joined([p.simulated for p in labelled])
    return gathered(cell.features(q), [p.modes if p.own else () for p in labelled], simulated)


@dataclass(frozen=True, eq=False)
class FoundMode:
    """A label's mode at a pose, None where it was not found, beside what was expected (Hz, sd).

    NaN where that is not known; `probability` that it is this mode, `then` the label it had then.
    """

    label: int
    mode: Mode | None
    probability: float
    then: int | None = None
    expected_hz: float = float("nan")
    sd_hz: float = float("nan")

    @property
    def off(self) -> float:
        """By how many sds it is off what was expected; NaN where either is not known."""
        if self.mode is None:
            return float("nan")
        sd = np.hypot(self.sd_hz, self.mode.frequency_sd_hz)
        return float((self.mode.frequency_hz - self.expected_hz) / sd)


def found_modes(pose: str, model: "Model", before: "Model | None") -> list[FoundMode]:
    """Of a pose, and what a model expected `before` it was hit; none where nothing was found."""
    labelled = next((p for p in model.labelled if p.pose == pose), None)
    if labelled is None:
        return []
    labels = enumerate(zip(labelled.modes, labelled.probability.tolist(), strict=True), 1)
    found = [FoundMode(k, mode, certain) for k, (mode, certain) in labels]
    if before is None:
        return found
    # What was expected of a mode, whatever number it had then.
    then = next(p for p in label(before.cell, model.used, before.low) if p.pose == pose)
    numbers = {mode.frequency_hz: k for k, mode in enumerate(then.modes, 1) if mode is not None}
    hz, sd = (row[0].tolist() for row in before.frequencies(labelled.q[None]))
    out = []
    for one in found:
        was = numbers.get(one.mode.frequency_hz) if one.mode else one.label
        if was is not None:
            one = replace(one, then=was, expected_hz=hz[was - 1], sd_hz=sd[was - 1])
        out.append(one)
    return out


def measured_records(cell: Cell, state: CampaignState) -> list[dict[str, Any]]:
    """One row a measured mode: pose, joint angles in degrees, Hz, ratios, sds, probability."""
    return [
        {
            **{"pose": m.pose, **_angles(cell, m.joints_deg), "mode": k},
            **{name: getattr(mode, name) for name in (*NUMBERS, "probability")},
            "withdrawn": m.withdrawn,
        }
        for m in state.measurements.values()
        for k, mode in enumerate((x for x in m.modes if x.likely), 1)
    ]


def predicted_records(model: "Model", joints_deg: ArrayLike) -> list[dict[str, Any]]:
    """One row for each mode at each of the poses (n, dof) in degrees: what a model predicts.

    And whether the pose lies outside the workspace.
    """
    q = model.cell.poses(joints_deg)
    found, inside = model.predict(q), model.cell.inside(q)
    return [
        {
            **{"pose": i + 1, **_angles(model.cell, model.cell.robot.joints.shown(row))},
            **{"mode": k + 1, **{name: float(getattr(found, name)[i, k]) for name in NUMBERS}},
            "outside": not inside[i],
        }
        for i, row in enumerate(q)
        for k in range(found.frequency_hz.shape[1])
    ]


def _angles(cell: Cell, joints_deg: Sequence[float] | np.ndarray) -> dict[str, float]:
    return dict(zip(cell.robot.joints.columns, map(float, joints_deg), strict=True))
