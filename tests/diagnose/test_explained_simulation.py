"""The explained simulation in memory is the one that is read from the files written of it."""

from dataclasses import replace

import numpy as np
import pytest

from planner.diagnosis.effects import library
from planner.diagnosis.effects.combined import Both
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.linear.predict import misfit_at
from planner.diagnosis.linear.problem import COARSE, FINE, Problem
from planner.diagnosis.linear_diagnosis import Candidate, Diagnosis
from planner.diagnosis.write_explained import explained_simulation, write_explained
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.robot.robot import Robot
from tests.support.known_robots import KR210

LINES = np.linspace(6.0, 60.0, 40)
KINDS = (
    "added_mass",
    "local_resonator",
    "transverse_compliance",
    "link_flexibility",
    "base_compliance",
    "angle_dependent_stiffness",
    "structural_damping",
)


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    simulation = Simulation(Robot.load(KR210.write(tmp_path_factory.mktemp("robot"))))
    q = KR210.poses(2, 5)
    nothing = np.full((3, 3, len(LINES)), np.nan)
    frfs = tuple(
        Frf(LINES, h, np.full(h.shape, np.abs(h).max() ** 2), nothing, (3, 3, 3), (6.0, 60.0))
        for h in simulation.accelerance(q, LINES)
    )
    return Problem(frfs, q, simulation, (6.0, 60.0))


def first_of(problem, name, at=None):
    effects = library(problem.simulation)
    return next(e for e in effects if e.name == name and at in (None, e.at))


def explained(problem, effect, grade=COARSE):
    """A diagnosis that says so, its springs, inertias and the effect's own numbers off a little."""
    misfit = problem.misfit(effect, grade)
    away = np.random.default_rng(0).normal(size=len(misfit.mean))
    x = misfit.mean + 0.2 * misfit.sd * away
    fit = Fit(effect, misfit, x, misfit.by_pose(x))
    candidate = Candidate(effect.parts(), 0.9, fit)
    return Diagnosis("explained", (candidate,), fit, fit, 1.0, 0.0, problem), candidate


@pytest.mark.parametrize("kind", KINDS)
def test_in_memory_as_written_and_read(problem, tmp_path, kind):
    both = Both.of(first_of(problem, kind), first_of(problem, "added_mass", "link_6"))
    found, accepted = explained(problem, both)
    path = write_explained(tmp_path / "out", problem.simulation.robot, found, accepted)
    read, ours = Simulation(Robot.load(path)), explained_simulation(found, accepted)
    h = read.accelerance(problem.q, LINES)
    np.testing.assert_allclose(ours.accelerance(problem.q, LINES), h, rtol=1e-9)
    nominal = problem.simulation.accelerance(problem.q, LINES)
    assert np.linalg.norm(h - nominal) > 1e-2 * np.linalg.norm(nominal)
    assert ours.robot.config.effects == read.robot.config.effects


def test_what_bearings_give_is_written(problem, tmp_path):
    found, accepted = explained(replace(problem, as_built=True), Effect(""), FINE)
    path = write_explained(tmp_path / "out", problem.simulation.robot, found, accepted)
    misfit = accepted.fit.misfit
    h = Simulation(Robot.load(path)).accelerance(problem.q, LINES)
    nothing = misfit_at(found.problem, Effect(""), problem.q, LINES)
    np.testing.assert_allclose(h, nothing.values(accepted.fit.x)[0], rtol=2e-3)
    stiff = explained_simulation(*explained(problem, Effect(""))).accelerance(problem.q, LINES)
    assert np.linalg.norm(h - stiff) > 1e-2 * np.linalg.norm(stiff)
    assert misfit.split[0] > 2 * problem.simulation.elastic.size


def test_effects_are_added_to_those_that_the_robot_has(problem, tmp_path):
    found, accepted = explained(problem, first_of(problem, "transverse_compliance", "joint_2"))
    path = write_explained(tmp_path / "first", problem.simulation.robot, found, accepted)
    again = Problem(problem.frfs, problem.q, Simulation(Robot.load(path)), problem.band_hz)
    found, accepted = explained(again, first_of(again, "added_mass"))
    path = write_explained(tmp_path / "second", again.simulation.robot, found, accepted)
    read, ours = Simulation(Robot.load(path)), explained_simulation(found, accepted)
    assert len(ours.robot.config.effects) == 2
    h = read.accelerance(problem.q, LINES)
    np.testing.assert_allclose(ours.accelerance(problem.q, LINES), h, rtol=1e-9)
