"""Which measured mode is which: labels 1…count over all measured poses."""

from dataclasses import dataclass

import numpy as np

from planner.campaign.cell import Cell
from planner.campaign.events import MeasuredMode
from planner.campaign.state import Measurement
from planner.fusion.surrogate import ModalObservations
from planner.modes.compare import align
from planner.modes.types import ModalModel, Mode
from planner.physics.dynamics import SimulatedModes

# How far, in log frequency, an unfitted simulation may be off; then the scatter around the shift.
PRIOR_SD, SCATTER_SD = 0.25, 0.08
# Simulated modes above those modelled that a measured mode may be instead: where one of the
# modelled ones cannot be seen (nodal point), the next one must not take its label.
ABOVE = 2


@dataclass(frozen=True, eq=False)
class LabelledPose:
    """A measured pose with its modes by label (None: not found there) and the simulation's."""

    pose: str
    joints_deg: tuple[float, ...]
    q: np.ndarray
    modes: tuple[Mode | None, ...]
    simulated_hz: np.ndarray  # (count,), NaN where the simulation has no such mode


def to_mode(measured: MeasuredMode) -> Mode:
    """A mode as the numerics want it, from how the log keeps it."""
    cells = np.array(
        [[np.nan if v is None else v for v in cell] for cell in measured.residue], dtype=float
    )
    residue = (cells[:, 0] + 1j * cells[:, 1]).reshape(3, 3)
    shape = np.array([complex(re, im) for re, im in measured.shape])
    return Mode(
        measured.frequency_hz,
        measured.frequency_sd_hz,
        measured.damping_ratio,
        measured.damping_sd,
        residue,
        cells[:, 2].reshape(3, 3),
        shape,
        measured.probability,
    )


def from_mode(mode: Mode) -> MeasuredMode:
    """A mode as the log keeps it."""

    def number(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    cells = zip(mode.residue.ravel(), mode.residue_sd.ravel(), strict=True)
    return MeasuredMode(
        frequency_hz=float(mode.frequency_hz),
        frequency_sd_hz=float(mode.frequency_sd_hz),
        damping_ratio=float(mode.damping_ratio),
        damping_sd=float(mode.damping_sd),
        shape=tuple((float(s.real), float(s.imag)) for s in mode.shape),
        residue=tuple((number(r.real), number(r.imag), number(sd)) for r, sd in cells),
        probability=float(mode.probability),
    )


def label(cell: Cell, measurements: tuple[Measurement, ...]) -> tuple[LabelledPose, ...]:
    """Label every pose's modes, guided by the simulation and by the poses labelled before."""
    if not measurements:
        return ()
    q = np.deg2rad(np.array([m.joints_deg for m in measurements]))
    count = cell.config.modes.count
    simulated = cell.simulate(q, ABOVE)
    expected, shapes = simulated.frequency_hz, _shapes(simulated.residue)
    first = _pass(measurements, expected, shapes, PRIOR_SD)
    shift = _shift(first, expected)
    second = _pass(measurements, expected * np.exp(shift), shapes, SCATTER_SD)
    return tuple(
        LabelledPose(m.pose, m.joints_deg, q[i], second[i][:count], expected[i, :count])
        for i, m in enumerate(measurements)
    )


def _shapes(residue: np.ndarray) -> np.ndarray:
    """Response shapes (n, k, 3) of residues (n, k, 3, 3); NaN where there is no mode."""
    known = np.all(np.isfinite(residue), axis=(2, 3))
    left = np.linalg.svd(np.where(known[..., None, None], residue, 0.0))[0][..., 0]
    return np.where(known[..., None], left, np.nan)


def _pass(
    measurements: tuple[Measurement, ...], expected_hz: np.ndarray, shapes: np.ndarray, sd: float
) -> list[tuple[Mode | None, ...]]:
    labelled = []
    for row, shape, measurement in zip(expected_hz, shapes, measurements, strict=True):
        modes = tuple(to_mode(mode) for mode in measurement.modes)
        known = int(np.argmin(np.isfinite([*row, np.nan])))
        if known == 0:  # without a simulation there is only the order
            labelled.append((*modes, *[None] * len(row))[: len(row)])
            continue
        band = (modes[0].frequency_hz, modes[-1].frequency_hz)
        model = ModalModel(modes, band, 0.0, 0)
        found = align(model, row[:known], shape[:known], np.full(known, sd)).modes
        labelled.append((*found, *[None] * len(row))[: len(row)])
    return labelled


def _shift(labelled: list[tuple[Mode | None, ...]], expected_hz: np.ndarray) -> np.ndarray:
    """Median log ratio of measured to simulated frequency per label, 0 where unknown."""
    measured = np.array([[m.frequency_hz if m else np.nan for m in row] for row in labelled])
    ratio = np.log(measured / expected_hz)
    out = np.zeros(ratio.shape[1])
    for k in range(ratio.shape[1]):
        known = ratio[np.isfinite(ratio[:, k]), k]
        out[k] = np.median(known) if known.size else 0.0
    return out


def observations(cell: Cell, labelled: tuple[LabelledPose, ...]) -> ModalObservations:
    """The labelled modes as arrays, NaN where a mode was not found or a column not hit."""
    count, n = cell.config.modes.count, len(labelled)
    frequency, frequency_sd = np.full((2, n, count), np.nan)
    damping, damping_sd = np.full((2, n, count), np.nan)
    residue = np.full((n, count, 3, 3), np.nan + 1j * np.nan)
    residue_sd = np.full((n, count, 3, 3), np.nan)
    for i, pose in enumerate(labelled):
        for k, mode in enumerate(pose.modes):
            if mode is None:
                continue
            frequency[i, k], frequency_sd[i, k] = mode.frequency_hz, mode.frequency_sd_hz
            damping[i, k], damping_sd[i, k] = mode.damping_ratio, mode.damping_sd
            residue[i, k], residue_sd[i, k] = mode.residue, mode.residue_sd
    q = np.array([p.q for p in labelled]).reshape(n, len(cell.robot.joint_names))
    simulated = cell.simulate(q) if n else _none(count)
    x = cell.features(q) if n else np.zeros((0, len(cell.workspace.feature_names)))
    return ModalObservations(
        x, frequency, frequency_sd, damping, damping_sd, residue, residue_sd, simulated
    )


def _none(count: int) -> SimulatedModes:
    empty = np.zeros((0, count))
    return SimulatedModes(empty, empty, np.zeros((0, count, 3, 3), complex))
