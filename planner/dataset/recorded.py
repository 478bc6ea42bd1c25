"""FRFs of the poses of a recordings folder, for identification."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.dataset.measure import Source, average
from planner.errors import RefusedError
from planner.frf.frf import Frf
from planner.recording.folder import read_recordings
from planner.recording.records import Hit, PoseRow


@dataclass(frozen=True, eq=False)
class Recorded:
    """Poses with an FRF, in the order of the table: names, angles q (n, dof) in rad, FRFs.

    `refused` names the files that could not be used, each with its reason.
    """

    poses: tuple[str, ...]
    q: np.ndarray
    frfs: tuple[Frf, ...]
    refused: tuple[tuple[str, str], ...]
    remarks: tuple[str, ...]
    simulated: bool


def read_recorded(
    folder: Path,
    joint_names: tuple[str, ...],
    band_hz: tuple[float, float],
    window_rate_1_s: float = 0.0,
    progress: Callable[[str], None] = lambda text: None,
    averaged: Callable[[tuple[Hit, ...], Frf], Frf] = lambda hits, frf: frf,
) -> Recorded:
    """Read, screen and average all hits of a folder with recordings.csv.

    A pose's angles are the mean of its rows' readback; `averaged` may make another FRF of its
    hits (none where FRFs were exported) and their average. Raises InputError where the table is
    wrong, RefusedError where no pose has a hit that can be used.
    """
    groups: dict[str, list[PoseRow]] = {}
    for row in read_recordings(folder, joint_names).rows:
        groups.setdefault(row.pose, []).append(row)
    poses, q, frfs = [], [], []
    refused: list[tuple[str, str]] = []
    remarks: list[str] = []
    simulated = False
    for number, (pose, rows) in enumerate(groups.items()):
        progress(f"reading pose {pose}, {number} of {len(groups)} done")
        sources = tuple(Source(r.file, str(r.file), r.hit, r.repeat) for r in rows if r.file)
        measured = average(sources, band_hz, window_rate_1_s=window_rate_1_s)
        refused += [(v.source.name, v.reason) for v in measured.verdicts if not v.accepted]
        simulated |= any(v.simulated for v in measured.verdicts)
        if measured.frf is None:
            remarks.append(f"Pose {pose} is left out: {measured.remarks[0]}")
            continue
        poses.append(pose)
        q.append(np.deg2rad(np.mean([r.joints_deg for r in rows], axis=0)))
        frfs.append(averaged(measured.hits, measured.frf))
    if not frfs:
        reason = refused[0][1] if refused else remarks[0]
        raise RefusedError(f"{folder}: no pose has a hit that can be used: {reason}")
    return Recorded(
        tuple(poses), np.array(q), tuple(frfs), tuple(refused), tuple(remarks), simulated
    )
