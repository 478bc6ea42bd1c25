"""FRFs as npz files, which `couple` and `stability` take."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.errors import writing

if TYPE_CHECKING:
    from planner.milling.coupling import CoupledFrf
    from planner.robot.robot import Robot


def save_frfs(
    path: Path, frequency_hz: np.ndarray, mean: np.ndarray, sd: np.ndarray | None,
    poses: Sequence[str], robot: "Robot", q: np.ndarray, outside: np.ndarray | None = None,
    force_n: np.ndarray | None = None,
) -> None:  # fmt: skip
    """Write FRFs (n, 3, 3, F) in m/s²/N at lines (F,) and poses q (n, dof) to exactly this file.

    With whether the robot's sensor, which FRFs are of, is at its tcp, which of them lie `outside`
    (n,) the workspace, and the peak force_n (n,) that was asked for, NaN where none was. `sd` is
    None where nothing tells it. InputError if that cannot be.
    """
    joints = robot.joints
    more = {"joint_units": np.array(joints.units)} if any(joints.slides) else {}
    more["sensor_at_tcp"] = np.array(robot.sensor_at_tcp)
    told = {"frf_sd": sd, "outside": outside, "peak_force_n": force_n}
    more |= {name: values for name, values in told.items() if values is not None}
    _save(path, frequency_hz=frequency_hz, frf_mean=mean, pose=np.array(poses),
          joints_deg=joints.shown(q), **more)  # fmt: skip


def save_coupled(path: Path, coupled: "CoupledFrf", pose: str) -> None:
    """Write as `predict` does, and all six motions beside.

    `frf6_mean`, `frf6_sd` (1, 6, 6, F) are accelerances of (x, y, z, θx, θy, θz), `motions` says
    which of them are known, `amplification` (F,) how errors grew. InputError if that cannot be.
    """
    mean, sd = coupled.accelerance[None], coupled.accelerance_sd[None]
    _save(path, frequency_hz=coupled.frequency_hz, frf_mean=mean[:, :3, :3], frf_sd=sd[:, :3, :3],
          pose=np.array([pose]), frf6_mean=mean, frf6_sd=sd, motions=np.array(coupled.kept),
          amplification=coupled.amplification)  # fmt: skip


def _save(path: Path, **arrays: Any) -> None:
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)
