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
    """Sixty kilograms on link 5 in simulated recordings of four poses, and their diagnosis."""
    folder = tmp_path_factory.mktemp("robot")
    toml = KR210.write(folder)
    simulation = Simulation(Robot.load(toml))
    heavy = '\n[[payload]]\nlink = "link_5"\nmass = 60.0\ncom_m = [0.1, 0.05, 0.1]\n'
    toml.write_text(toml.read_text() + heavy)
    q, rng = KR210.poses(4, 5), np.random.default_rng(0)
    frfs = []
    for h in Simulation(Robot.load(toml)).accelerance(q, LINES):
        sd = 1e-3 * np.abs(h).max()
        noise = sd / np.sqrt(2) * (rng.standard_normal(h.shape) + 1j * rng.standard_normal(h.shape))
        nothing = np.full(h.shape, np.nan)
        frfs.append(Frf(LINES, h + noise, np.full(h.shape, sd**2), nothing, (3, 3, 3), (6.0, 60.0)))
    chosen = [e for e in library(simulation) if (e.name, e.at) == ("added_mass", "link_5")]
    return diagnose(frfs, q, simulation, effects=chosen)


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


@pytest.mark.parametrize(
    ("off", "less", "kept"),
    [(1.6, 0.003, False), (1.6, -0.003, True), (1.6, 1e-5, True), (1.05, 0.003, True)],
)
def test_where_both_predict_well_what_predicts_clearly_worse_is_given_up(
    found, monkeypatch, off, less, kept
):
    """By how much of the little that is off, if the Frobenius similarity (less so) agrees."""
    aside, agreed = module.held_out(found.problem, found.refitted, found.best)
    assert agreed is not None
    before = replace(agreed.refitted, frac=0.9990, frobenius=0.96)
    after = replace(agreed.explained, frac=1 - off * 0.0010, frobenius=0.96 - less)
    near = replace(agreed, refitted=before, explained=after)
    monkeypatch.setattr(module, "held_out", lambda *_: (aside, near))
    assert (judge(found).diagnosis is found) is kept


def test_refitting_alone_is_not_given_up(found, monkeypatch):
    aside, agreed = module.held_out(found.problem, found.refitted, found.best)
    assert agreed is not None
    bad = replace(agreed, explained=replace(agreed.explained, frac=agreed.refitted.frac - 0.01))
    monkeypatch.setattr(module, "held_out", lambda *_: (aside, bad))
    consistent = replace(found, verdict="consistent", best=found.refitted)
    assert judge(consistent).diagnosis is consistent
