"""A consistent simulation whose inertias had to give far says so, and where."""

from dataclasses import replace

import numpy as np
import pytest

from planner.diagnosis.effects import library
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.hidden_inertias import hidden_inertias
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.linear.other_places import named_as_mass
from planner.diagnosis.linear.problem import COARSE, Problem
from planner.diagnosis.linear_diagnosis import Candidate, Diagnosis
from tests.support.exact_problem import exact_problem


@pytest.fixture(scope="module")
def fitted(tmp_path_factory) -> tuple[Problem, Fit]:
    problem = exact_problem(tmp_path_factory.mktemp("robot"))
    misfit = problem.misfit(Effect(""), COARSE)
    return problem, Fit(Effect(""), misfit, misfit.mean, misfit.by_pose(misfit.mean))


def said(fitted, sds: float) -> tuple[str, ...]:
    problem, fit = fitted
    x = fit.x.copy()
    bodies = fit.misfit.setting.simulation.elastic.bodies
    third = fit.misfit.setting.simulation.robot.joint_names[2]
    assert third in bodies
    x[fit.misfit.names.index(f"mass of {third}")] += sds
    there = Candidate((Effect(""),), 1.0, replace(fit, x=x))
    return hidden_inertias(Diagnosis("consistent", (there,), fit, fit, 1.0, 0.0, problem))


def test_a_mass_that_had_to_give_far_is_said_with_its_link(fitted):
    (text,) = said(fitted, 3.8)
    assert "inertias of link 3 3.8 times" in text


def test_what_tolerances_allow_is_not_said(fitted):
    assert said(fitted, 1.5) == ()


@pytest.mark.parametrize(("sds", "named"), [(5.5, "link_3"), (4.0, None)])
def test_farther_than_any_robots_are_off_a_mass_there_is_named(fitted, sds, named):
    problem, fit = fitted
    third = fit.misfit.setting.simulation.robot.joint_names[2]
    x = fit.x + sds * np.array([n == f"mass of {third}" for n in fit.misfit.names])
    masses = [e for e in library(problem.simulation) if e.name == "added_mass"]
    others = [Fit(e, m := problem.misfit(e, COARSE), m.mean, fit.data) for e in masses]
    shares = [0.7, *[0.3 / len(others)] * len(others)]
    now = named_as_mass([replace(fit, x=x), *others], shares)
    places = dict(zip((f.effect.at for f in others), now[1:], strict=True))
    assert sum(now) == pytest.approx(1.0)
    assert now[0] == (0.0 if named else 0.7)
    assert not named or places[named] > 0.7
