"""Poses of a true robot, hit by hand, as a campaign measures them."""

from dataclasses import replace

import numpy as np

from planner.dataset.measure import MeasuredPose
from planner.proof.fault_injection import InjectedFaults, hand_visits, hit_poses
from planner.proof.hits import AXES, Hammer
from planner.proof.measurement_errors import MeasurementErrors
from planner.proof.model import Truth
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
