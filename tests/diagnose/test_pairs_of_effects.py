"""Pairs of effects: begun where another fit ended, and one effect exchanged for another."""

import pytest

from planner.diagnosis.effects import library
from planner.diagnosis.effects.combined import together
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.fit import fit, settle
from planner.diagnosis.linear.found import Found
from planner.diagnosis.linear.problem import Problem
from planner.diagnosis.linear.rounds import carried_from
from planner.diagnosis.linear.search import exchanged
from planner.truth.deviation import AttachedMass, BentLink
from tests.support.concealed import hidden
from tests.support.known_robots import KR210

BENT = BentLink("link_2", (3e6, 4e6), 8e6, 2e-4)
CARRIED = AttachedMass("link_6", (0.1, 0.0, 0.1), 40.0)


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    folder = tmp_path_factory.mktemp("robot")
    frfs, q, simulation = hidden(KR210, folder, 11, beams=(BENT,), added=(CARRIED,), poses=3)
    return Problem(tuple(frfs), q, simulation, simulation.robot.config.band_hz)


@pytest.fixture(scope="module")
def effects(problem):
    """Some of the library: a mass, and what may stand beside it."""
    wanted = {
        ("added_mass", "link_6"), ("link_flexibility", "link_2"), ("base_compliance", "base"),
        ("transverse_compliance", "joint_4"),
    }  # fmt: skip
    return [e for e in library(problem.simulation) if (e.name, e.at) in wanted]


def of(effects, name):
    return next(e for e in effects if e.name == name)


def places(found):
    return {(p.name, p.at) for p in found.effect.parts()}


def test_one_effect_of_a_wrong_pair_is_exchanged(problem, effects):
    none = settle(problem, fit(problem, Effect("")))
    mass, wrong = of(effects, "added_mass"), of(effects, "transverse_compliance")
    pair = settle(problem, fit(problem, together(mass, wrong)))
    found = exchanged(problem, Found((none, pair), ()), effects)
    best = min(found.finalists, key=lambda f: f.value)
    assert places(best) == {("added_mass", "link_6"), ("link_flexibility", "link_2")}
    assert best.value < pair.value - 100.0


def test_pairs_are_begun_where_their_leader_ended(problem, effects):
    """No pair is farther off than the leader: what is beside it may do nothing.

    But for a link that bends, whose halves have inertias of their own.
    """
    leader = settle(problem, fit(problem, of(effects, "added_mass")))
    others = [e for e in effects if e.name != "link_flexibility"]
    pairs = [p for e in others if (p := together(leader.effect, e)) is not None]
    near = carried_from(problem, leader, pairs)
    assert len(near) == len(pairs) > 1
    for pair in near:
        assert settle(problem, pair).value < leader.value + 5.0
