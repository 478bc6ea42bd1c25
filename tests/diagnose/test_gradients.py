"""Every effect's derivatives against finite differences, in the misfit that is minimised."""

import numpy as np
import pytest

from planner.diagnosis.effects import library
from planner.diagnosis.linear.problem import Grade, Problem
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.robot.robot import Robot
from tests.support.known_robots import kr210_folder

EFFECTS = (
    "joint_stiffness joint_2", "transverse_compliance joint_3", "base_compliance base",
    "link_flexibility link_2",
    "added_mass link_3", "local_resonator link_4", "angle_dependent_stiffness joint_2",
    "structural_damping joints", "sensor_rotation sensor", "sensor_gain sensor_y",
    "polarity sensor_x", "channel_delay sensor", "exponential_window sensor",
)  # fmt: skip


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    simulation = Simulation(Robot.load(kr210_folder(tmp_path_factory.mktemp("kr210"))))
    q = np.array([[0.3, -1.5, 1.4, 0.4, -1.0, 0.7], [-0.6, -1.1, 1.0, -0.5, -1.3, -0.2]])
    frequency, nan = np.linspace(5.0, 55.0, 12), np.full((3, 3, 12), np.nan)
    frfs = tuple(
        Frf(frequency, 1.1 * h, np.abs(0.05 * h) ** 2 + 1e-12, nan, (1, 1, 1), (5.0, 55.0))
        for h in simulation.accelerance(q, frequency)
    )
    return Problem(frfs, q, simulation, (5.0, 55.0))


@pytest.mark.parametrize("wanted", EFFECTS)
def test_gradient_is_that_of_finite_differences(problem, wanted):
    effects = {f"{e.name} {e.at}": e for e in library(problem.simulation)}
    misfit = problem.misfit(effects[wanted], Grade(12))
    start = misfit.effect.starts()[0]
    x = misfit.mean
    x[misfit.split[1] :] = start
    rng = np.random.default_rng(1)
    x = x + 0.1 * misfit.sd * rng.standard_normal(len(x))
    h, slope = misfit.response(x)
    for i in rng.permutation(len(x))[:12].tolist() + list(range(misfit.split[1], len(x))):
        step = np.zeros(len(x))
        step[i] = 1e-5 * misfit.sd[i]
        moved = misfit.response(x + step)[0] - misfit.response(x - step)[0]
        expected = moved / (2 * step[i])
        assert np.abs(slope[:, i] - expected).max() <= 2e-5 * max(np.abs(expected).max(), 1e-9)
    assert h.shape == (2, 3, 3, 12)


def test_every_kind_is_tested(problem):
    assert {e.name for e in library(problem.simulation)} == {w.split()[0] for w in EFFECTS}
