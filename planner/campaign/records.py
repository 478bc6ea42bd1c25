"""Results as rows: a list of dictionaries with one mode each, as pandas.DataFrame takes it."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.campaign.state import Measurement
from planner.recording.joints import JointUnits

if TYPE_CHECKING:
    from planner.surrogate.frf_bands import ModalPrediction


def measured_records(
    joints: JointUnits, measurements: Iterable[Measurement]
) -> list[dict[str, Any]]:
    """One row a measured mode: pose, joint angles in degrees, Hz, ratios, sds, probability."""
    return [
        {
            "pose": m.pose,
            **_angles(joints, m.joints_deg),
            "mode": k,
            "frequency_hz": mode.frequency_hz,
            "frequency_sd_hz": mode.frequency_sd_hz,
            "damping_ratio": mode.damping_ratio,
            "damping_sd": mode.damping_sd,
            "probability": mode.probability,
            "withdrawn": m.withdrawn,
        }
        for m in measurements
        for k, mode in enumerate((x for x in m.modes if x.likely), 1)
    ]


def predicted_records(
    joints: JointUnits, q_rad: np.ndarray, prediction: "ModalPrediction", inside: np.ndarray
) -> list[dict[str, Any]]:
    """One row for each mode of each pose q (n, dof) in rad of a prediction.

    `inside` (n,) says which of them lie in the workspace.
    """
    p = prediction
    return [
        {
            "pose": i + 1,
            **_angles(joints, joints.shown(row).tolist()),
            "mode": k + 1,
            "frequency_hz": float(p.frequency_hz[i, k]),
            "frequency_sd_hz": float(p.frequency_sd_hz[i, k]),
            "damping_ratio": float(p.damping_ratio[i, k]),
            "damping_sd": float(p.damping_sd[i, k]),
            "outside": not inside[i],
        }
        for i, row in enumerate(q_rad)
        for k in range(p.frequency_hz.shape[1])
    ]


def _angles(joints: JointUnits, joints_deg: Sequence[float]) -> dict[str, float]:
    pairs = zip(joints.columns, joints_deg, strict=True)
    return {column: float(value) for column, value in pairs}
