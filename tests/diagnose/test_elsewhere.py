"""A resonator that was fitted on a neighbouring link is found on its own; ties are carried on."""

from dataclasses import replace

import numpy as np
import pytest

from planner.diagnosis.effects import library
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear import search
from planner.diagnosis.linear.fit import Fit, fit, settle
from planner.diagnosis.linear.found import Found
from planner.diagnosis.linear.other_places import elsewhere
from planner.diagnosis.linear.problem import COARSE, Problem
from planner.diagnosis.linear_diagnosis import again, diagnose
from planner.truth.deviation import AttachedResonator
from tests.support.concealed import hidden
from tests.support.known_robots import IRB6640

LOOSE = AttachedResonator("link_3", (0.2, 0.05, 0.1), (0.0, 0.0, 1.0), 14.0, 22.0, 0.02)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return hidden(IRB6640, tmp_path_factory.mktemp("cell"), 76, loose=(LOOSE,), poses=5)


def of_kind(recorded, name: str) -> dict[str, Effect]:
    return {e.at: e for e in library(recorded[2]) if e.name == name}


@pytest.mark.parametrize("neighbour", ["link_2", "link_4"])
def test_it_is_found_from_the_next_link(recorded, neighbour):
    frfs, q, simulation = recorded
    resonators = of_kind(recorded, "local_resonator")
    problem = Problem(tuple(frfs), q, simulation, simulation.robot.config.band_hz)
    wrong = settle(problem, fit(problem, resonators[neighbour]), steps=8)
    found = elsewhere(problem, wrong, list(resonators.values()))
    assert {f.effect.at for f in found} == set(resonators) - {neighbour}
    ends = [settle(problem, f, steps=30) for f in found]
    best = min(ends, key=lambda f: f.per_value)
    assert best.effect.at == "link_3"
    assert best.per_value < 1.0
    assert wrong.per_value > 1.3 * best.per_value


@pytest.mark.parametrize("bent", [0.0, 4.0])
def test_at_the_noise_it_is_asked_elsewhere_where_inertias_are_bent(recorded, monkeypatch, bent):
    """They may make up for the wrong place, up to the noise."""
    frfs, q, simulation = recorded
    resonators = of_kind(recorded, "local_resonator")
    problem = Problem(tuple(frfs), q, simulation, simulation.robot.config.band_hz)
    near = settle(problem, fit(problem, resonators["link_4"], grade=COARSE), COARSE, steps=1)
    x = near.misfit.mean.copy()
    x[near.misfit.split[0]] += bent * near.misfit.sd[near.misfit.split[0]]
    silent = replace(near, x=x, data=replace(near.data, chi2=np.zeros(len(q))))
    asked: list[Fit] = []
    monkeypatch.setattr(search, "elsewhere", lambda _, found, __: asked.append(found) or ())
    search._moved(problem, Found((silent,), ()), list(resonators.values()))
    assert asked == ([silent] if bent else [])


def test_joints_are_not_moved(recorded):
    frfs, q, simulation = recorded
    problem = Problem(tuple(frfs), q, simulation, simulation.robot.config.band_hz)
    springs = list(of_kind(recorded, "joint_stiffness").values())
    start = settle(problem, fit(problem, springs[0]), steps=2)
    assert elsewhere(problem, start, springs) == ()


def test_further_recordings_are_told_by_the_same_candidates(recorded):
    frfs, q, simulation = recorded
    resonators = of_kind(recorded, "local_resonator")
    some = [resonators[at] for at in ("link_2", "link_3", "link_4")]
    before = diagnose(frfs[:3], q[:3], simulation, effects=some)
    after = again(before, frfs, q)
    assert after.candidates[0].places == (("local_resonator", "link_3"),)
    assert after.candidates[0].probability > 0.8  # it changes hardly more than what matters
    assert sum(c.probability for c in after.candidates) == pytest.approx(1.0)
    assert len(after.problem.frfs) == len(frfs)
    tied = {c.places for c in before.undecided} | {(("none", None),), (("unknown", None),)}
    assert {c.places for c in after.candidates} <= tied
