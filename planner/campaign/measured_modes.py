"""Measured modes: from and to the log, and as rows for pandas.DataFrame."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from planner.campaign.events import MeasuredMode
from planner.campaign.state import CampaignState
from planner.modal.modes import ModalModel, Mode

if TYPE_CHECKING:
    from planner.campaign.cell import Cell
    from planner.campaign.model import Model


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


def from_modal(modal: ModalModel | None) -> tuple[MeasuredMode, ...]:
    """All modes of a pose as the log keeps them, doubtful ones too, in order of frequency."""
    if modal is None:
        return ()
    every = sorted((*modal.modes, *modal.doubtful), key=lambda mode: mode.frequency_hz)
    return tuple(from_mode(mode) for mode in every)


NUMBERS = "frequency_hz", "frequency_sd_hz", "damping_ratio", "damping_sd"  # of a mode


def measured_records(cell: "Cell", state: CampaignState) -> list[dict[str, Any]]:
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


def _angles(cell: "Cell", joints_deg: Sequence[float] | np.ndarray) -> dict[str, float]:
    return dict(zip(cell.robot.joints.columns, map(float, joints_deg), strict=True))
