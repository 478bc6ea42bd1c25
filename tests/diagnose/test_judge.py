"""An explanation that predicts worse where it was not fitted is given up."""

from dataclasses import replace

import numpy as np
import pytest

from planner.diagnosis import held_out_check as module
from planner.diagnosis.effects import library
from planner.diagnosis.held_out_check import judge
from planner.diagnosis.linear_diagnosis import diagnose
from planner.diagnosis.thresholds import HELD_OUT_WORSE
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.robot.robot import Robot
from tests.support.known_robots import KR210

LINES = np.linspace(6.0, 60.0, 96)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """A mass on link 5 said to explain simulated recordings of four poses, of a robot without."""
    simulation = Simulation(Robot.load(KR210.write(tmp_path_factory.mktemp("robot"))))
    q, rng = KR210.poses(4, 5), np.random.default_rng(0)
    frfs = []
    for h in simulation.accelerance(q, LINES):
        sd = 1e-3 * np.abs(h).max()
        noise = sd / np.sqrt(2) * (rng.standard_normal(h.shape) + 1j * rng.standard_normal(h.shape))
        nothing = np.full(h.shape, np.nan)
        frfs.append(Frf(LINES, h + noise, np.full(h.shape, sd**2), nothing, (3, 3, 3), (6.0, 60.0)))
    chosen = [e for e in library(simulation) if (e.name, e.at) == ("added_mass", "link_5")]
    found = diagnose(frfs, q, simulation, effects=chosen)
    mass = next(c for c in found.candidates if c.fit is not None and c.fit.effect.at)
    named, others = replace(mass, probability=0.9), [c for c in found.candidates if c is not mass]
    share = 0.1 / sum(c.probability for c in others)
    rest = (replace(c, probability=share * c.probability) for c in others)
    return replace(found, verdict="explained", candidates=(named, *rest), best=mass.fit)


def test_what_predicts_as_well_is_kept(found):
    judged = judge(found)
    assert judged.diagnosis is found
    assert judged.held_out is not None
    assert judged.held_out.explained.frac > judged.held_out.refitted.frac - HELD_OUT_WORSE


def test_what_predicts_worse_is_given_up(found, monkeypatch):
    aside, agreed = module.held_out(found.problem, found.refitted, found.best)
    assert agreed is not None
    bad = replace(agreed, explained=replace(agreed.explained, frac=agreed.refitted.frac - 0.01))
    monkeypatch.setattr(module, "held_out", lambda *_: (aside, bad))
    judged = judge(found)
    assert judged.diagnosis.verdict == "unexplained"
    assert judged.diagnosis.best is found.refitted
    assert judged.held_out is not None
    assert judged.held_out.explained == judged.held_out.refitted
    shares = [c.probability for c in judged.diagnosis.candidates]
    assert sum(shares) == pytest.approx(1.0)
    assert judged.diagnosis.candidates[0].places == (("unknown", None),)
    assert shares[0] >= 0.95


def test_refitting_alone_is_not_given_up(found, monkeypatch):
    aside, agreed = module.held_out(found.problem, found.refitted, found.best)
    assert agreed is not None
    bad = replace(agreed, explained=replace(agreed.explained, frac=agreed.refitted.frac - 0.01))
    monkeypatch.setattr(module, "held_out", lambda *_: (aside, bad))
    consistent = replace(found, verdict="consistent", best=found.refitted)
    assert judge(consistent).diagnosis is consistent
