"""What a measurement would tell apart, beside what it does tell apart."""

from dataclasses import replace

import numpy as np
import pytest
from planner.diagnosis.effects import library
from planner.diagnosis.linear.fit import Fit, carried_on, fit, settle
from planner.diagnosis.linear.predict import misfit_at
from planner.diagnosis.linear.problem import FINE
from planner.diagnosis.linear_diagnosis import Problem

from planner.design.discrimination import most_telling, separation
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.robot.robot import Robot
from tests.support.known_robots import KR210

LINES = np.linspace(6.0, 60.0, 96)
SD = 2e-4


def measured(h, sd, rng, columns=(True, True, True)):
    """FRF (3, 3, F) with noise of one sd, unknown where a column was not hit."""
    noise = rng.standard_normal((2, *h.shape)) * sd / np.sqrt(2)
    known = np.broadcast_to(np.array(columns)[None, :, None], h.shape)
    seen = np.where(known, h + noise[0] + 1j * noise[1], np.nan)
    variance, coherence = np.where(known, sd**2, np.nan), np.full(h.shape, np.nan)
    hits = tuple(3 * int(c) for c in columns)
    return Frf(LINES, seen, variance, coherence, hits, (LINES[0], LINES[-1]))


def response(problem, found, q):
    """What a fit says (3, 3, F) at a pose."""
    return misfit_at(problem, found.effect, q[None], LINES).response(found.x)[0][0]


def two_candidates(tmp_path_factory, exact):
    """Two candidates fitted to recordings in which neither is; with exact hits or a hand's."""
    simulation = Simulation(Robot.load(KR210.write(tmp_path_factory.mktemp("robot"))))
    q = KR210.poses(3, 5)
    rng = np.random.default_rng(0)
    frfs = tuple(measured(h, SD, rng) for h in simulation.accelerance(q, LINES))
    problem = Problem(frfs, q, simulation, (6.0, 60.0), exact=exact)
    all_ = {(e.name, e.at): e for e in library(simulation)}
    chosen = [all_[("added_mass", at)] for at in ("link_5", "link_6")]
    return problem, [settle(problem, fit(problem, effect), FINE) for effect in chosen]


@pytest.fixture(scope="module")
def tied(tmp_path_factory):
    return two_candidates(tmp_path_factory, False)


@pytest.fixture(scope="module")
def tied_by_exact_hits(tmp_path_factory):
    return two_candidates(tmp_path_factory, True)


def test_the_same_candidate_twice_cannot_be_told_apart(tied):
    problem, (first, _) = tied
    found = separation(problem, [first, first], [0.5, 0.5], KR210.poses(2, 9), 1.0)
    np.testing.assert_allclose(found, 0.0, atol=1e-9)


def test_one_candidate_has_no_rival(tied):
    problem, (first, _) = tied
    assert not separation(problem, [first], [1.0], KR210.poses(2, 9), 1.0).any()


# Fits bend, and stand on fewer lines than were reckoned with; where hits may miss, the rough
# expectation is the farther above, and only says which hits are tried.
@pytest.mark.parametrize(("hits", "least"), [("tied_by_exact_hits", 0.6), ("tied", 0.5)])
def test_what_is_expected_happens(request, hits, least):
    """A hit is added that one of the two predicts, and both are fitted anew."""
    problem, (light, heavy) = request.getfixturevalue(hits)
    moved = np.concatenate([heavy.x[:-1], heavy.x[-1:] + 1.0])
    true = replace(heavy, x=moved)
    poses, rng = KR210.poses(4, 9), np.random.default_rng(1)
    expected = separation(problem, [true, light], [1 - 1e-9, 1e-9], poses, 1.0)
    ratios = []
    for row, told in zip(poses, expected, strict=True):
        for axis in (0, 2):
            columns = np.arange(3) == axis
            frf = measured(response(problem, true, row), 1e-9, rng, columns)
            frf = replace(
                frf, variance=np.where(columns[:, None], SD**2, np.nan) + 0 * frf.variance
            )
            q = np.vstack([problem.q, row])
            more = replace(problem, frfs=(*problem.frfs, frf), q=q)
            before, after = (settle(p, light, FINE) for p in (problem, more))
            happened = value(after) - value(before)
            ratios.append(happened / told[axis])
    print(np.round(ratios, 2))
    assert least < np.median(ratios) < 1.4
    assert np.ptp(np.log(ratios)) < np.log(4)


def value(found: Fit) -> float:
    """χ²/2 with the prior's part."""
    return found.misfit(found.x).value


@pytest.mark.parametrize("rate", [0.0, 2.0])
def test_what_is_tried_is_what_happens_without_noise(tied, rate):
    problem, (light, heavy) = tied
    rng = np.random.default_rng(1)
    there = [misfit_at(problem, heavy.effect, q[None], LINES, rate) for q in problem.q]
    shown = [measured(one.response(heavy.x)[0][0], SD, rng) for one in there]
    problem = replace(problem, frfs=tuple(replace(f, exponential_rate_1_s=rate) for f in shown))
    true = replace(heavy, x=np.concatenate([heavy.x[:-1], heavy.x[-1:] + 1.0]))
    poses = KR210.poses(12, 9)
    before = [carried_on(problem, f, f.effect) for f in (true, light)]
    best = most_telling(problem, before, [1 - 1e-9, 1e-9], poses, 1.0)
    h = misfit_at(problem, true.effect, poses[best.pose][None], LINES, rate)
    h = h.response(before[0].x)[0][0]
    columns = np.arange(3) == best.axis
    frf = measured(h, 1e-12, np.random.default_rng(0), columns)
    variance = np.where(columns[:, None], SD**2, np.nan) + 0 * frf.variance
    frf = replace(frf, variance=variance, exponential_rate_1_s=rate)
    more = replace(problem, frfs=(*problem.frfs, frf), q=np.vstack([problem.q, poses[best.pose]]))
    after = [carried_on(more, f, f.effect) for f in before]
    gained = [a.log_evidence(1.0) - b.log_evidence(1.0) for a, b in zip(after, before, strict=True)]
    assert best.log_odds == pytest.approx(gained[0] - gained[1], rel=0.1)


def test_the_same_candidate_twice_is_not_told_apart_by_trying(tied):
    problem, (light, _) = tied
    same = most_telling(problem, [light, light], [0.5, 0.5], KR210.poses(2, 9), 1.0)
    assert abs(same.log_odds) < 1e-6
