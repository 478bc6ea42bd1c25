"""Results as rows: a list of dictionaries with one mode each, as pandas.DataFrame takes it."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.campaign.state import Measurement
from planner.recording.joints import JointUnits

if TYPE_CHECKING:
    from planner.surrogate.frf_bands import ModalPrediction


NUMBERS = "frequency_hz", "frequency_sd_hz", "damping_ratio", "damping_sd"


def measured_records(
    joints: JointUnits, measurements: Iterable[Measurement]
) -> list[dict[str, Any]]:
    """One row a measured mode: pose, joint angles in degrees, Hz, ratios, sds, probability."""
    return [
        {
            **{"pose": m.pose, **_angles(joints, m.joints_deg), "mode": k},
            **{name: getattr(mode, name) for name in (*NUMBERS, "probability")},
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
    return [
        {
            **{"pose": i + 1, **_angles(joints, joints.shown(row).tolist()), "mode": k + 1},
            **{name: float(getattr(prediction, name)[i, k]) for name in NUMBERS},
            "outside": not inside[i],
        }
        for i, row in enumerate(q_rad)
        for k in range(prediction.frequency_hz.shape[1])
    ]


def _angles(joints: JointUnits, joints_deg: Sequence[float]) -> dict[str, float]:
    return dict(zip(joints.columns, map(float, joints_deg), strict=True))
