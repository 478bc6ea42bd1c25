"""Everyday campaigns on five robots: frequencies at unseen poses, beside a GP without simulation.

    pytest -m slow -s tests/campaign/test_everyday_campaigns.py

plays whole campaigns by `next` and `import` and prints a table by robot, kind and count of poses.
It takes a quarter of an hour and resumes: CELLS_PROOF is the folder that keeps what was played,
CELLS how many campaigns (50), CELLS_SEED the first seed.

Fifty campaigns on true robots hit as people hit: FRFs get better with every measured pose. PROOF is
the folder that keeps their scores; SEED and CAMPAIGNS say of which campaigns and how many.
"""

import json
import os
from collections.abc import Sequence
from dataclasses import asdict
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from tests.support.case_campaigns import FrfScore, lacking
from tests.support.everyday_campaigns import POSES, Played, campaigns
from tests.support.faulty_robots import KINDS, ROBOTS
from tests.support.fitted_cases import ARMS
from tests.support.true_modes import counted

FIRST = 71_001
PERCENT, WORSE_PERCENT = 1.0, 0.1  # RMSE asked for; by how much a peer is better that is no matter


def test_a_mode_that_nobody_sees_need_not_be_counted() -> None:
    true, predicted = np.array([10.0, 14.0, 20.0]), np.array([10.1, 19.8])
    assert counted(true, np.array([True, True, True]), predicted).tolist() == [10.0, 14.0]
    assert counted(true, np.array([True, False, True]), predicted).tolist() == [10.0, 20.0]


@pytest.mark.slow
@pytest.mark.timeout(86400)
def test_everyday_campaigns_know_frequencies_after_five_poses(tmp_path: Path, capsys) -> None:
    folder = Path(os.environ.get("CELLS_PROOF", tmp_path))
    folder.mkdir(parents=True, exist_ok=True)
    first, wanted = int(os.environ.get("CELLS_SEED", FIRST)), int(os.environ.get("CELLS", "50"))
    played = []
    for one in campaigns(folder, first, wanted):
        played.append(one)
        with capsys.disabled():
            print(line(one), flush=True)
    with capsys.disabled():
        print(table(played))
    last = [(one.own[-1], one.peer[-1]) for one in played]
    assert np.mean([own.rmse <= PERCENT for own, _ in last]) >= 0.90
    covered = [score.covered for one in played for score in one.own]
    assert 0.90 <= np.mean(covered) <= 0.98
    pairs = [pair for one in played for pair in zip(one.own, one.peer, strict=True)]
    assert all(own.rmse <= peer.rmse + WORSE_PERCENT for own, peer in pairs)


def line(one: Played) -> str:
    """A campaign pose by pose: RMSE in %, coverage (of a visit), and the peer's."""
    scores = "  ".join(
        f"{a.rmse:.2f} {a.covered:.2f} {a.visit:.2f} ({b.rmse:.1f} {b.covered:.2f})"
        for a, b in zip(one.own, one.peer, strict=True)
    )
    what = f"{one.seed} {one.robot}, {one.kind} {one.size:.3f}, {one.modes} modes"
    return f"{what}: {scores}, misfit {one.own[-1].misfit or np.nan:.1f}, {one.cpu_s:.0f} s CPU"


def table(played: Sequence[Played]) -> str:
    """By robot and kind, after each pose: median RMSE, share to 1 %, coverage, peer, worse."""
    lines = [
        "after 1 to 5 poses: median RMSE % (peer's), share <= 1 %, covered, of visits (peer's)"
    ]
    groups = [("all", played)]
    groups += [(name, [p for p in played if p.robot == name]) for name in ROBOTS]
    groups += [(kind, [p for p in played if p.kind == kind]) for kind in KINDS]
    for name, some in groups:
        if some:
            lines.append(f"{name} ({len(some)}): " + "; ".join(_at(some, n) for n in range(POSES)))
    pairs = [pair for one in played for pair in zip(one.own, one.peer, strict=True)]
    worse = [own.rmse - peer.rmse for own, peer in pairs if own.rmse > peer.rmse]
    most = max(worse, default=0.0)
    lines.append(f"worse than the peer: {len(worse)} of {len(pairs)}, at most by {most:.2f} %")
    asked = sum(one.asked for one in played)
    lines.append(f"hits taken for those of another pose: {asked} of {POSES * len(played)}")
    return "\n".join(lines)


def _at(some: Sequence[Played], n: int) -> str:
    own, peer = [one.own[n] for one in some], [one.peer[n] for one in some]
    median, other = (np.median([s.rmse for s in scores]) for scores in (own, peer))
    within = np.mean([s.rmse <= PERCENT for s in own])
    covered, theirs = (np.mean([s.covered for s in scores]) for scores in (own, peer))
    visit = np.mean([s.visit for s in own])
    return f"{median:.2f} ({other:.1f}) {within:.2f} {covered:.3f} {visit:.3f} ({theirs:.2f})"


CAMPAIGNS, HIT_POSES = int(os.environ.get("CAMPAIGNS", "50")), 5
FIRST_SEED = int(os.environ.get("SEED", "300"))
CASES = list(product(KINDS, ARMS))


def scores_of(number: int, folder: Path) -> list[FrfScore]:
    """Of one campaign after each pose; kept in the folder."""
    kept = folder / f"{FIRST_SEED}_{number}.json"
    if not kept.exists():
        kind, robot = CASES[number % len(CASES)]
        campaign = lacking(robot, kind, FIRST_SEED + number, folder / str(number))
        models = map(campaign.after, range(1, HIT_POSES + 1))
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
