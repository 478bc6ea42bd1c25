"""Hits that tell tied candidates apart: T-optimal ones beside those of integrated variance.

`pytest -m slow -s tests/studies/test_separation.py`. Cases of `separation_cases`; of each, four
random poses are hit along one random axis each. What that leaves tied is decided by further
measurements, one axis each; where laws are to be told, ours chooses forces too. Pairs that neither
way of choosing them decides (a mass at a joint's axis is as well on the one link as on the other)
are listed and left out. STUDY_SEEDS (20) cases from STUDY_FIRST (601; of laws 4001) on; STUDY_KEPT
names a folder that keeps finished ones. Seeds 1-582, 2001-2019 and 3001-3030 were used in
development.
"""

import json
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from planner.design.discrimination import odds_after, separation
from planner.diagnosis.linear.fit import carried_on
from planner.inference.parallel import side_by_side
from planner.truth.effects import NONLINEAR
from tests.support.separation_cases import KINDS, Campaign, OfEffects, begun

pytestmark = [pytest.mark.slow, pytest.mark.timeout(0)]
SEEDS = int(os.environ.get("STUDY_SEEDS", "20"))
FIRST = {"linear": 601, "laws": 4001}
OF = {"linear": KINDS, "laws": tuple(NONLINEAR)}
MOST, SURE = 8, 0.95
TRIES = 400
EVERY = 4  # poses of the cell that are tried for how much a hit can tell


def until_decided(campaign: Campaign, strategy: str) -> int:
    """Further measurements until the truth has SURE, MOST + 1 if it does not get there."""
    for extra in range(1, MOST + 1):
        separate = strategy == "separation" and len(campaign.tied) > 1
        campaign.hit(*(campaign.separating() if separate else campaign.integrated_variance()))
        campaign.look()
        leader = next(iter(campaign.tied.items()), None)
        if leader is not None and leader[0] == (campaign.true,) and leader[1] > SURE:
            return extra
    return MOST + 1


def played(seed: int, folder: Path, kinds: tuple[str, ...]) -> dict:
    """Further measurements by strategy where four poses leave the truth and others tied."""
    campaign = begun(seed, folder, kinds)
    tied, true = campaign.tied, campaign.true
    said = {"seed": seed, "true": true, "candidates": list(tied), "shares": list(tied.values())}
    if len(tied) < 2 or (true,) not in tied or any(len(p) > 1 for p in tied):
        return {**said, "tied": False}
    ways = ("separation", "integrated variance")
    return {**said, "tied": True, **{way: until_decided(campaign.fork(), way) for way in ways}}


def kept(name: str, folder: Path, make: Callable[[], dict]) -> dict:
    """What was made before, or now."""
    path = Path(os.environ.get("STUDY_KEPT", folder)) / f"{name}.json"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(make()))
    return json.loads(path.read_text())


def tied_cases(folder: Path, kinds: str) -> tuple[list[dict], list[dict], int]:
    """SEEDS cases that one of the ways decides, those that neither does, and how many were made."""
    first = int(os.environ.get("STUDY_FIRST", FIRST[kinds]))
    found, neither, seed = [], [], first
    for seed in range(first, first + TRIES):
        case = kept(f"{kinds}_{seed}", folder, partial(played, seed, folder, OF[kinds]))
        if not case["tied"]:
            continue
        print(case, flush=True)
        decided = min(case["separation"], case["integrated variance"]) <= MOST
        (found if decided else neither).append(case)
        if len(found) == SEEDS:
            break
    return found, neither, seed - first + 1


def told(seed: int, folder: Path) -> dict[str, float]:
    """Logarithm of the odds that the first further hit is expected to give, chosen so or so."""
    campaign = begun(seed, folder, KINDS)
    assert isinstance(campaign, OfEffects)
    found, offered = campaign.found, campaign.case.cell.candidates.q
    problem, temper = found.problem, found.temper
    fits, share = campaign.fits[0], np.array(campaign.fits[1]) / sum(campaign.fits[1])
    settled = [carried_on(problem, f, f.effect) for f in fits]

    def odds(q: np.ndarray, axis: int) -> float:
        return odds_after(problem, settled, share, q, axis, temper)

    poses = offered[::EVERY]
    best = np.argmax(
        np.nan_to_num(separation(problem, fits, share.tolist(), poses, temper)), axis=1
    )
    each = side_by_side(lambda i: odds(poses[i], int(best[i])), range(len(poses)))
    chosen = odds(*campaign.separating()[:2])
    integrated = odds(*campaign.integrated_variance()[:2])
    return {
        "best": max(chosen, integrated, *each),
        "separating": chosen,
        "integrated variance": integrated,
        "any pose, its best axis": float(np.mean(each)),
    }


def test_how_much_a_hit_can_tell(place):
    """The best of many hits beside those that were chosen: what a better choice could gain.

    Of linear effects, where a hit's force tells nothing more.
    """
    found, _, _ = tied_cases(place, "linear")
    made = [kept(f"told_{c['seed']}", place, partial(told, c["seed"], place)) for c in found]
    best = np.array([t["best"] for t in made])
    for way in made[0]:
        share = np.array([t[way] for t in made]) / best
        middle = np.median(share)
        print(f"{way}: {share.mean():.2f} of what the best of all told (median {middle:.2f})")
    assert np.mean([t["separating"] for t in made] / best) > 0.8


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    """Where the cases of this run are kept, so that each is played once."""
    return tmp_path_factory.mktemp("cases")


def decided(place: Path, kinds: str) -> tuple[np.ndarray, np.ndarray]:
    """Further measurements (cases,) by separating and by integrated variance."""
    found, neither, made = tied_cases(place, kinds)
    assert found
    ours, theirs = (np.array([c[s] for c in found]) for s in ("separation", "integrated variance"))
    rng = np.random.default_rng(0)
    picks = rng.integers(0, len(found), (2000, len(found)))
    low, high = np.quantile(ours[picks].mean(axis=1) / theirs[picks].mean(axis=1), [0.025, 0.975])
    print(
        f"{kinds}: {len(found)} pairs decided, {len(neither)} by neither, of {made} cases. "
        f"Further measurements to {SURE:.0%} (no more than {MOST} are made; {MOST + 1} counts "
        f"where they do not decide), mean (median): separating {ours.mean():.2f} "
        f"({np.median(ours):g}), integrated variance {theirs.mean():.2f} ({np.median(theirs):g}); "
        f"ratio {ours.mean() / theirs.mean():.2f} [{low:.2f}, {high:.2f}]; not decided: "
        f"{np.sum(ours > MOST)} and {np.sum(theirs > MOST)}"
    )
    return ours, theirs


@pytest.mark.parametrize("kinds", list(OF))
def test_tied_candidates_are_decided_with_no_more_measurements(place, kinds):
    ours, theirs = decided(place, kinds)
    assert ours.mean() <= theirs.mean()


NOT_HALF = pytest.mark.xfail(
    raises=AssertionError,
    reason="the mean ratio was 0.72 [0.60, 0.87] on seeds 601-982, and no hit that was tried tells "
    "much more (test_how_much_a_hit_can_tell)",
)


@pytest.mark.parametrize("kinds", [pytest.param("linear", marks=NOT_HALF), "laws"])
def test_tied_candidates_are_decided_with_half_as_many_measurements(place, kinds):
    ours, theirs = decided(place, kinds)
    assert ours.mean() <= 0.5 * theirs.mean()
