"""Hits that tell tied candidates apart: T-optimal ones beside those of integrated variance.

`pytest -m slow -s tests/studies/test_separation.py`. Truths are MuJoCo models with ± 15 % springs,
4 % inertias and one of a few effects; each of four random poses is hit along one random axis, with
much noise. What that leaves tied is decided by further hits, one axis each; pairs that neither way
of choosing them decides (a mass at a joint's axis is as well on the one link as on the other) are
listed and left out. STUDY_SEEDS (20) cases from STUDY_FIRST (601) on; STUDY_KEPT names a folder
that keeps finished ones. Seeds 1-9 and 301-582 were used in development.
"""

import json
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from acquisition_cases import LINES, MODES, ROBOTS, Case
from planner.acquire.separate import most_telling, odds_after, separation
from planner.campaign.cell import Cell
from planner.campaign.config import config_from_builtins
from planner.campaign.model import build
from planner.campaign.proposing import propose
from planner.campaign.state import CampaignState, Measurement
from planner.diagnose.diagnose import Diagnosis, again, diagnose
from planner.diagnose.effect import Effect
from planner.diagnose.effects import library
from planner.diagnose.fit import carried_on
from planner.diagnose.side_by_side import side_by_side
from planner.frf.types import Frf
from planner.truth.deviation import Deviation
from planner.truth.effects import LINEAR
from planner.truth.model import load_truth
from planner.truth.scene import Drawn, Scene
from planner.truth.secret import Secret

pytestmark = [pytest.mark.slow, pytest.mark.timeout(0)]
SEEDS = int(os.environ.get("STUDY_SEEDS", "20"))
FIRST = int(os.environ.get("STUDY_FIRST", "601"))
KINDS = ("transverse_compliance", "link_flexibility", "added_mass")
START, MOST, SURE = 4, 8, 0.95
TRIES = 400
EVERY = 4  # poses of the cell that are tried for how much a hit can tell
NOISE = 0.15  # of the FRF's rms: with less, four hits leave hardly anything tied


def cell_of(robot: str, toml: Path) -> Cell:
    arm = ROBOTS[robot]
    table = {
        "robot": str(toml),
        "workspace": {"joints_deg": [list(r) for r in arm.joints_deg]},
        "modes": {"count": MODES, "band_hz": [arm.band_hz[0], 0.4 * arm.band_hz[1]]},
        "acquisition": {"candidates": 200, "hit_axes": "best"},
    }
    return Cell.load(toml, config_from_builtins(table))


def concealed(seed: int, folder: Path) -> tuple[Case, Drawn, np.ndarray]:
    """A case, what is concealed in it, and the four poses."""
    rng = np.random.default_rng(seed)
    robot = sorted(ROBOTS)[seed % len(ROBOTS)]
    arm = ROBOTS[robot]
    toml = arm.write(folder / str(seed), 1)
    plain = Secret(Deviation(seed, 0.15, 0.15, 0.04, 0.005))
    low, high = np.deg2rad(np.array(arm.joints_deg)).T
    poses = rng.uniform(low, high, (START, 6))
    scene = Scene(arm, load_truth(toml, plain.deviation), 1, poses, 1000.0)
    drawn = LINEAR[str(rng.choice(KINDS))](scene, plain, rng)
    cell = cell_of(robot, toml)
    lines = np.linspace(*cell.config.modes.band_hz, LINES)
    truth = load_truth(toml, drawn.secret.deviation)
    nothing = np.zeros((0, 6)), np.zeros((0, MODES)), lines, np.zeros((0, 3, 3, LINES))
    return Case(truth, cell, seed, *nothing, NOISE), drawn, poses


class Campaign:
    """The case as it is measured: FRFs for the diagnosis, measurements for the acquisition."""

    def __init__(self, case: Case):
        self.case, self.q = case, []
        self.measured: dict[str, Measurement] = {}
        self.frfs: list[Frf] = []

    def hit(self, q: np.ndarray, axes: tuple[int, ...]) -> None:
        measurement, frf = self.case.measure(q, len(self.q) + 1, axes)
        self.measured[measurement.pose] = measurement
        self.frfs.append(frf)
        self.q.append(q)

    def diagnosed(self, effects: list[Effect]) -> Diagnosis:
        simulation = self.case.cell.simulation
        assert simulation is not None
        return diagnose(self.frfs, np.array(self.q), simulation, effects=effects)

    def integrated_variance(self) -> tuple[np.ndarray, tuple[int, ...]]:
        state = CampaignState(measurements=self.measured, events=len(self.q))
        by_pose = dict(zip(self.measured, self.frfs, strict=True))
        model = build(self.case.cell, state, lambda m, _: by_pose[m.pose])
        (proposal,) = propose(model, state, 1, "integrated_variance")
        axes = tuple("xyz".index(hit) for hit in proposal.hits)
        return np.deg2rad(np.array(proposal.joints_deg)), axes[:1]

    def separating(self, found: Diagnosis) -> tuple[np.ndarray, tuple[int, ...]]:
        tied = [(c.fit, c.probability) for c in found.undecided if c.fit is not None]
        offered = self.case.cell.candidates.q
        fits, shares = [f for f, _ in tied], [p for _, p in tied]
        best = most_telling(found.problem, fits, shares, offered, found.temper)
        return offered[best.pose], (best.axis,)


def until_decided(case: Case, poses, axes, found: Diagnosis, true, strategy: str) -> int:
    """Further hits until the true effect has SURE, MOST + 1 if it does not get there."""
    campaign = Campaign(case)
    for q, axis in zip(poses, axes, strict=True):
        campaign.hit(q, (int(axis),))
    first = found
    for extra in range(1, MOST + 1):
        tied = [c for c in found.undecided if c.fit is not None]
        separate = strategy == "separation" and len(tied) > 1
        q, axis = campaign.separating(found) if separate else campaign.integrated_variance()
        campaign.hit(q, axis)
        found = again(first, campaign.frfs, np.array(campaign.q))
        leader = found.candidates[0]
        if leader.probability > SURE and leader.places == (true,):
            return extra
    return MOST + 1


def begun(seed: int, folder: Path) -> tuple[Campaign, Drawn, np.ndarray, Diagnosis]:
    """A case with its four poses hit along the axes given, and what they say."""
    case, drawn, poses = concealed(seed, folder)
    axes = np.random.default_rng(seed).integers(0, 3, START)
    campaign = Campaign(case)
    for q, axis in zip(poses, axes, strict=True):
        campaign.hit(q, (int(axis),))
    simulation = case.cell.simulation
    assert simulation is not None
    wanted = [e for e in library(simulation) if e.name in (*KINDS, "base_compliance")]
    return campaign, drawn, axes, campaign.diagnosed(wanted)


def played(seed: int, folder: Path) -> dict:
    """Further hits by strategy where four poses leave the truth and others tied."""
    campaign, drawn, axes, found = begun(seed, folder)
    case, poses = campaign.case, np.array(campaign.q)
    true = (drawn.effect, drawn.at)
    tied = [c.places for c in found.undecided if c.fit is not None]
    said = {"true": true, "candidates": tied, "shares": [c.probability for c in found.undecided]}
    if len(tied) < 2 or (true,) not in tied or any(len(p) > 1 for p in tied):
        return {"seed": seed, "tied": False, **said}
    out = {
        s: until_decided(case, poses, axes, found, true, s)
        for s in ("separation", "integrated variance")
    }
    return {"seed": seed, "tied": True, **said, **out}


def kept(name: str, folder: Path, make: Callable[[], dict]) -> dict:
    """What was made before, or now."""
    path = Path(os.environ.get("STUDY_KEPT", folder)) / f"{name}.json"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(make()))
    return json.loads(path.read_text())


def tied_cases(folder: Path) -> tuple[list[dict], list[dict], int]:
    """SEEDS cases that one of the ways decides, those that neither does, and how many were made."""
    found, neither, seed = [], [], FIRST
    for seed in range(FIRST, FIRST + TRIES):
        case = kept(f"separation_{seed}", folder, partial(played, seed, folder))
        if not case["tied"]:
            continue
        print(case, flush=True)
        decided = min(case["separation"], case["integrated variance"]) <= MOST
        (found if decided else neither).append(case)
        if len(found) == SEEDS:
            break
    return found, neither, seed - FIRST + 1


def told(seed: int, folder: Path) -> dict[str, float]:
    """Logarithm of the odds that the first further hit is expected to give, chosen so or so."""
    campaign, _, _, found = begun(seed, folder)
    offered, problem, temper = campaign.case.cell.candidates.q, found.problem, found.temper
    tied = [(c.fit, c.probability) for c in found.undecided if c.fit is not None]
    fits, share = [f for f, _ in tied], np.array([p for _, p in tied]) / sum(p for _, p in tied)
    settled = [carried_on(problem, f, f.effect) for f in fits]

    def odds(q: np.ndarray, axes: tuple[int, ...]) -> float:
        return odds_after(problem, settled, share, q, axes[0], temper)

    poses = offered[::EVERY]
    best = np.argmax(
        np.nan_to_num(separation(problem, fits, share.tolist(), poses, temper)), axis=1
    )
    each = side_by_side(lambda i: odds(poses[i], (int(best[i]),)), range(len(poses)))
    chosen = odds(*campaign.separating(found))
    integrated = odds(*campaign.integrated_variance())
    return {
        "best": max(chosen, integrated, *each),
        "separating": chosen,
        "integrated variance": integrated,
        "any pose, its best axis": float(np.mean(each)),
    }


def test_how_much_a_hit_can_tell(tmp_path):
    """The best of many hits beside those that were chosen: what a better choice could gain."""
    found, _, _ = tied_cases(tmp_path)
    made = [kept(f"told_{c['seed']}", tmp_path, partial(told, c["seed"], tmp_path)) for c in found]
    best = np.array([t["best"] for t in made])
    for way in made[0]:
        share = np.array([t[way] for t in made]) / best
        middle = np.median(share)
        print(f"{way}: {share.mean():.2f} of what the best of all told (median {middle:.2f})")
    assert np.mean([t["separating"] for t in made] / best) > 0.8


def test_tied_candidates_are_decided_with_half_as_many_hits(tmp_path):
    found, neither, made = tied_cases(tmp_path)
    ours, theirs = (np.array([c[s] for c in found]) for s in ("separation", "integrated variance"))
    rng = np.random.default_rng(0)
    picks = rng.integers(0, len(found), (2000, len(found)))
    ratio = ours[picks].mean(axis=1) / theirs[picks].mean(axis=1)
    low, high = np.quantile(ratio, [0.025, 0.975])
    print(
        f"{len(found)} pairs decided, {len(neither)} by neither, of {made} cases. "
        f"Further hits to {SURE:.0%} (no more than {MOST} are made; {MOST + 1} counts where they "
        f"do not decide), mean (median): separating {ours.mean():.2f} ({np.median(ours):g}), "
        f"integrated variance {theirs.mean():.2f} ({np.median(theirs):g}); ratio "
        f"{ours.mean() / theirs.mean():.2f} [{low:.2f}, {high:.2f}]; not decided: "
        f"{np.sum(ours > MOST)} and {np.sum(theirs > MOST)}"
    )
    assert ours.mean() <= theirs.mean()
    if ours.mean() > 0.5 * theirs.mean():
        pytest.xfail(
            "half as many are wanted; the mean ratio was 0.72 [0.60, 0.87] on seeds 601-982"
        )
