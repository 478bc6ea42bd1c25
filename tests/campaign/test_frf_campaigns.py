"""Fifty campaigns on true robots hit as people hit: FRFs get better with every measured pose."""

from itertools import product

import numpy as np
import pytest

from planner.truth.arms import ARMS
from tests.support.frf_campaigns import LACKING, FrfScore, make

CAMPAIGNS, POSES, FIRST_SEED = 50, 5, 300
CASES = list(product(LACKING, ARMS))


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_frfs_get_better_with_every_measured_pose(tmp_path):
    scores = []
    for number in range(CAMPAIGNS):
        lacking, robot = CASES[number % len(CASES)]
        folder = tmp_path / str(number)
        case = make(robot, lacking, FIRST_SEED + number, folder, poses=POSES)
        scores.append([FrfScore.of(case, model) for model in case.models()])
        print(robot, lacking, [f"{s.frac:.4f} {s.covered:.2f}" for s in scores[-1]], flush=True)
    frac = np.array([[s.frac for s in run] for run in scores])
    alone = np.array([[s.alone for s in run] for run in scores])
    covered = np.array([[s.covered for s in run] for run in scores])
    halves = np.array([[(s.covered_low, s.covered_high) for s in run] for run in scores])
    print("median", np.round(np.median(frac, axis=0), 4), np.round(np.median(alone, axis=0), 4))
    print("least", np.round(frac.min(axis=0), 4), "covered", np.round(covered.mean(axis=0), 3))
    median = np.median(frac, axis=0)
    assert np.all(np.diff(median) > -0.002)
    assert median[-1] > 0.99
    assert np.mean(frac[:, -1] >= 0.98) >= 0.95
    assert np.all(median >= np.median(alone, axis=0))
    assert np.mean(frac[:, 1:] >= alone[:, 1:] - 0.002) >= 0.95
    assert 0.90 <= covered[:, 1:].mean() <= 0.98
    assert np.all(np.abs(halves[:, 1:].mean(axis=(0, 1)) - 0.94) <= 0.04)
