"""A consistent simulation whose inertias had to give far says so, and where."""

from dataclasses import replace

import pytest

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.hidden_inertias import hidden_inertias
from planner.diagnosis.linear.fit import Fit
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
