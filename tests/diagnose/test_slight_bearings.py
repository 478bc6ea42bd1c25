"""Bearings that give a little are no finding, even where nothing else moves an arm that way."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.places import with_blocks
from planner.diagnosis.effects.slight_bearings import is_slight, with_bearings
from planner.diagnosis.effects.transverse_compliance import TransverseCompliance
from planner.diagnosis.linear.fit import fit, settle
from planner.diagnosis.linear.mismatch import Mismatch
from planner.diagnosis.linear.problem import PRIORS, Problem
from planner.diagnosis.linear_diagnosis import diagnose
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.robot.robot import Robot
from tests.support.known_robots import KR210

LINES = np.linspace(6.0, 60.0, 109)


@pytest.fixture(scope="module")
def stated(tmp_path_factory) -> Simulation:
    return Simulation(Robot.load(KR210.write(tmp_path_factory.mktemp("robot"))))


def tilting(stated: Simulation, times: dict[str, float]) -> Simulation:
    """With bearings of so many times their joint's stiffness, by its place."""
    blocks = []
    for effect in TransverseCompliance.everywhere(stated):
        for block in effect.blocks(1e-3):
            own = next(b for b in stated.robot.config.compliance if b.joint == block.joint)
            k = own.stiffness * times.get(effect.at, 150.0)
            blocks.append(msgspec.structs.replace(block, stiffness=k, damping=2e-3 * k))
    return with_blocks(stated, blocks)


def recorded(stated: Simulation, true: Simulation) -> Problem:
    q = KR210.poses(5, 3)
    rng = np.random.default_rng(0)
    frfs = []
    for h in true.accelerance(q, LINES):
        sd = 1e-3 * np.abs(h).max()
        h = h + sd * (rng.normal(size=h.shape) + 1j * rng.normal(size=h.shape)) / np.sqrt(2)
        frfs.append(Frf(LINES, h, np.full(h.shape, sd**2), 0 * h.real, (3, 3, 3), (6.0, 60.0)))
    return Problem(tuple(frfs), q, stated, (6.0, 60.0))


def test_each_joint_gets_the_tilts_that_it_has_not(stated):
    one = next(e for e in TransverseCompliance.everywhere(stated) if e.at == "joint_2")
    plain, priors = with_bearings(stated, PRIORS)
    beside, _ = with_bearings(one.structure(stated), PRIORS)
    count = [sum(map(is_slight, s.robot.config.compliance)) for s in (stated, plain, beside)]
    assert count == [0, 12, 10]
    ties = {b.tie for b in plain.robot.config.compliance if is_slight(b)}
    assert {name.split(" of ", 1)[1] for name in priors.bounds} == ties


def test_refitting_follows_what_bearings_give(stated):
    problem = recorded(stated, tilting(stated, {}))
    left = {}
    for as_built in (False, True):
        found = replace(problem, as_built=as_built)
        done = settle(found, fit(found, Effect("")))
        left[as_built] = Mismatch.of(done.misfit, done.x).unexplained
    assert left[False] > 0.005
    assert left[True] < left[False] / 4


@pytest.mark.parametrize("times", [{}, {"joint_2": 2.0}])
def test_one_is_named_where_it_gives_more_than_that(stated, times):
    problem = recorded(stated, tilting(stated, times))
    effects = TransverseCompliance.everywhere(stated)
    found = diagnose(problem.frfs, problem.q, stated, effects=effects)
    named = found.candidates[0].places
    assert named == ((("transverse_compliance", "joint_2"),) if times else (("none", None),))
    assert found.candidates[0].probability > 0.8
