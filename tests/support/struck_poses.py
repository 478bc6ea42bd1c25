"""Poses of a true robot, hit by hand: as recordings, and as a campaign measures them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.dataset.measure import MeasuredPose
from planner.proof.fault_injection import HitVisit, InjectedFaults, hand_visits, hit_poses
from planner.proof.hits import AXES, Hammer
from planner.proof.measurement_errors import EXACT, HitError, MeasurementErrors
from planner.proof.model import Truth
from planner.proof.recordings import write_recordings
from planner.studies.hits import as_read

REPEATS = 3


def struck_poses(
    truth: Truth, injected: InjectedFaults, q: np.ndarray, hammer: Hammer,
    band_hz: tuple[float, float], errors: MeasurementErrors, rng: np.random.Generator,
) -> tuple[MeasuredPose, ...]:  # fmt: skip
    """REPEATS hits an axis at each pose (n, dof), with errors of hand and chain."""
    injected, common = replace(injected, chain=errors.chain(rng)), errors.common(rng)
    shots = [(f"+{axis}", hammer.peak_n) for axis in AXES for _ in range(REPEATS)]
    visits = hand_visits(errors, q, shots, rng, common)
    found = hit_poses(truth, injected, visits, hammer, rng)
    return tuple(MeasuredPose((), band_hz, given=as_read(hits, hammer)) for hits in found)


def record_by_hand(
    folder: Path, truth: Truth, injected: InjectedFaults, errors: MeasurementErrors,
    poses: Sequence[tuple[str, np.ndarray]], axes: Sequence[str], hammer: Hammer,
    rng: np.random.Generator, *, common: Sequence[HitError] = EXACT,
    noise: np.random.Generator | None = None, nodes: Mapping[str, int] | None = None,
) -> list[HitVisit]:  # fmt: skip
    """Recordings of hits along signed axes at poses (name, readback in degrees).

    Told is where the robot stood and how each hit missed. `noise` is drawn by `rng` unless given.
    """
    shots = [(axis, hammer.peak_n) for axis in axes]
    q = np.deg2rad([readback for _, readback in poses])
    visits = hand_visits(errors, q, shots, rng, common)
    found = hit_poses(truth, injected, visits, hammer, noise or rng)
    rows = [(*pose, hits) for pose, hits in zip(poses, found, strict=True)]
    write_recordings(folder, truth.joint_names, rows, hammer, truth.description, nodes)
    return visits
