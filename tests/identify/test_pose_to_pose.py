"""Parameters where poses contradict each other by more than noise, against what was drawn."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from planner.identification.left_open import PoseEquations
from planner.identification.parameters import Parametrisation
from planner.identification.pose_to_pose import pose_to_pose

SPRINGS, POSES, CASES = 6, 5, 60
PRIOR_SD = 0.3


def springs() -> Parametrisation:
    parameters = tuple(SimpleNamespace(kind="stiffness") for _ in range(SPRINGS))
    found = SimpleNamespace(parameters=parameters, nuisances=(), spread=np.eye(SPRINGS))
    return cast(Parametrisation, found)


def equations(rng: np.random.Generator, size: float) -> tuple[PoseEquations, np.ndarray]:
    """Of springs that differ by `size` at each pose; and by how much the best is off, (D,)."""
    known = np.eye(SPRINGS) / PRIOR_SD**2
    j = 3e3 * rng.standard_normal((POSES, SPRINGS + 2, SPRINGS))
    truth = PRIOR_SD * rng.standard_normal(SPRINGS)
    own = truth + size * rng.standard_normal((POSES, SPRINGS))
    measured = np.einsum("nij,nj->ni", j, own) + rng.standard_normal(j.shape[:2])
    normal = np.swapaxes(j, 1, 2) @ j
    best = np.linalg.solve(normal.sum(axis=0) + known, np.einsum("nij,ni->j", j, measured))
    gradient = np.einsum("nij,ni->nj", j, j @ best - measured)
    return PoseEquations(gradient, normal, np.zeros(0), known), best - truth


@pytest.mark.parametrize("size", [0.0, 1e-3, 3e-3])
def test_sds_hold_whether_poses_differ_or_not(size):
    rng, away, plain = np.random.default_rng(1), [], []
    for _ in range(CASES):
        each, off = equations(rng, size)
        sd = np.sqrt(np.diagonal(pose_to_pose(each, springs(), 1.0)))
        alone = np.linalg.inv(each.normal.sum(axis=0) + each.known)
        away.append(off / sd)
        plain.append(off / np.sqrt(np.diagonal(alone)))
    assert 0.5 < np.sqrt(np.mean(np.square(away))) < 1.2
    assert (np.sqrt(np.mean(np.square(plain))) > 2) == (size > 0)
