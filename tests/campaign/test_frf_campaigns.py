"""Fifty campaigns on true robots hit as people hit: FRFs get better with every measured pose.

`pytest -m slow -s` prints the figures. PROOF=FOLDER keeps each campaign's scores and goes on where
it was stopped; SEED and CAMPAIGNS say of which campaigns and how many.
"""

import json
import os
from dataclasses import asdict
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from tests.support.case_campaigns import FrfScore, lacking
from tests.support.faulty_robots import KINDS
from tests.support.fitted_cases import ARMS

CAMPAIGNS, POSES = int(os.environ.get("CAMPAIGNS", "50")), 5
FIRST_SEED = int(os.environ.get("SEED", "300"))
CASES = list(product(KINDS, ARMS))


def scores_of(number: int, folder: Path) -> list[FrfScore]:
    """Of one campaign after each pose; kept in the folder."""
    kept = folder / f"{FIRST_SEED}_{number}.json"
    if not kept.exists():
        kind, robot = CASES[number % len(CASES)]
        campaign = lacking(robot, kind, FIRST_SEED + number, folder / str(number))
        models = map(campaign.after, range(1, POSES + 1))
        found = [asdict(FrfScore.of(campaign.case, model)) for model in models]
        kept.write_text(json.dumps(found))
    return [FrfScore(**score) for score in json.loads(kept.read_text())]


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_frfs_get_better_with_every_measured_pose(tmp_path: Path):
    scores, folder = [], Path(os.environ.get("PROOF", tmp_path))
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(CAMPAIGNS):
        scores.append(scores_of(number, folder))
        said = [f"{s.frac:.4f} {s.alone:.4f} {s.covered:.2f}" for s in scores[-1]]
        print(*CASES[number % len(CASES)], said, flush=True)
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
