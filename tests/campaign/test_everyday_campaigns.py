"""Fifty campaigns on five robots hit as people hit: what is known elsewhere after each pose.

    pytest -m slow -s tests/campaign/test_everyday_campaigns.py

FRFs get better, frequencies are known to a percent, and a campaign that would stop is right. PROOF
is the folder that keeps scores, so that it goes on; SEED and CAMPAIGNS say of which and how many.
"""

import json
import os
from dataclasses import asdict
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from tests.support.case_campaigns import CaseCampaign, Score, lacking
from tests.support.faulty_robots import KINDS
from tests.support.fitted_cases import ARMS
from tests.support.true_modes import counted

PERCENT, WORSE_PERCENT = 1.0, 0.1  # RMSE asked for; by how much a peer is better that is no matter
CAMPAIGNS, HIT_POSES = int(os.environ.get("CAMPAIGNS", "50")), 5
FIRST_SEED = int(os.environ.get("SEED", "300"))
CASES = list(product(KINDS, ARMS))


def test_a_mode_that_nobody_sees_need_not_be_counted() -> None:
    true, predicted = np.array([10.0, 14.0, 20.0]), np.array([10.1, 19.8])
    assert counted(true, np.array([True, True, True]), predicted).tolist() == [10.0, 14.0]
    assert counted(true, np.array([True, False, True]), predicted).tolist() == [10.0, 20.0]


def scores_of(number: int, folder: Path) -> list[list[Score]]:
    """Of one campaign after each pose, and of one that uses no simulation; kept in the folder."""
    kept = folder / f"{FIRST_SEED}_{number}.json"
    if not kept.exists():
        kind, robot = CASES[number % len(CASES)]
        own = lacking(robot, kind, FIRST_SEED + number, folder / str(number))
        found = [
            [asdict(Score.of(own.case, one.after(n))) for n in range(1, HIT_POSES + 1)]
            for one in (own, CaseCampaign.of(own.case, "none"))
        ]
        kept.write_text(json.dumps(found))
    return [[Score(**score) for score in each] for each in json.loads(kept.read_text())]


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_what_is_known_after_every_measured_pose(tmp_path: Path):
    folder = Path(os.environ.get("PROOF", tmp_path))
    folder.mkdir(parents=True, exist_ok=True)
    scores = []
    for number in range(CAMPAIGNS):
        scores.append(scores_of(number, folder))
        said = [
            f"{s.frac:.4f} {s.alone:.4f} {s.covered:.2f}, {s.rmse:.2f} % ({peer.rmse:.1f} %)"
            for s, peer in zip(*scores[-1], strict=True)
        ]
        print(*CASES[number % len(CASES)], said, flush=True)
    own, peer = (
        {name: np.array([[getattr(s, name) for s in both[k]] for both in scores])
         for name in Score.__dataclass_fields__}
        for k in (0, 1)
    )  # fmt: skip
    for name, values in own.items():
        middle, least = np.median(values, axis=0), values.min(axis=0)
        print(name, "median", middle, "least", least, "mean", values.mean(axis=0))
    frac, alone, rmse = own["frac"], own["alone"], own["rmse"]
    median = np.median(frac, axis=0)
    assert np.all(np.diff(median) > -0.002)
    assert median[-1] > 0.99
    assert np.mean(frac[:, -1] >= 0.98) >= 0.95
    assert np.all(median >= np.median(alone, axis=0))
    assert np.mean(frac[:, 1:] >= alone[:, 1:] - 0.002) >= 0.95
    assert 0.90 <= own["covered"][:, 1:].mean() <= 0.98
    for half in ("covered_low", "covered_high"):
        assert abs(own[half][:, 1:].mean() - 0.94) <= 0.04
    assert np.mean(rmse[:, -1] <= PERCENT) >= 0.90
    assert 0.90 <= own["inside"].mean() <= 0.98
    assert np.all(rmse <= peer["rmse"] + WORSE_PERCENT)
    assert np.mean(rmse[own["done"]] <= PERCENT) >= 0.95
