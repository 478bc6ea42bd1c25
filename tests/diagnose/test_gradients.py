"""Every effect's derivatives against finite differences, in the misfit that is minimised."""

from dataclasses import replace

import numpy as np
import pytest

from planner.diagnosis.effects import library
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.hanging_resonator import HangingResonator
from planner.diagnosis.effects.link_flexibility import LinkFlexibility
from planner.diagnosis.effects.two_hanging_resonators import TwoHangingResonators
from planner.diagnosis.linear.problem import Grade, Problem
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.measurement.missed_ports import actual_ports
from planner.measurement.nuisances import basis
from planner.robot.robot import Robot
from tests.support.known_robots import kr210_folder

EFFECTS = (
    "joint_stiffness joint_2", "transverse_compliance joint_3", "base_compliance base",
    "link_flexibility link_2", "link_flexibility beam",
    "added_mass link_3", "local_resonator link_4", "local_resonator hanging",
    "local_resonator two",
    "angle_dependent_stiffness joint_2",
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
    effects["local_resonator hanging"] = HangingResonator.of(effects["local_resonator link_4"])
    effects["local_resonator two"] = TwoHangingResonators.of(effects["local_resonator link_4"])
    bends = effects["link_flexibility link_2"]
    assert isinstance(bends, LinkFlexibility)
    effects["link_flexibility beam"] = bends.as_beam()
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


def missed(misfit, eta):
    """FRFs and derivatives between the ports that eta (n, l) tell of, and what changes them."""
    s, t = misfit.setting.s, misfit.tolerances
    h, slope, turned = misfit.parts(misfit.mean, actual_ports(eta, s, t, (3, 3)))
    return h, slope, basis(h, turned, s, t)


@pytest.fixture(scope="module")
def told(problem):
    misfit = problem.misfit(Effect(""), Grade(12))
    open_ = basis(*misfit.values(misfit.mean), misfit.setting.s, misfit.tolerances)
    return misfit, np.random.default_rng(3).standard_normal(open_.shape[:2])


def test_misses_of_nothing_are_the_stated_ports(told):
    misfit, eta = told
    h, slope, open_ = missed(misfit, 0 * eta)
    plain = misfit.parts(misfit.mean)
    assert h == pytest.approx(plain[0])
    assert slope == pytest.approx(plain[1])
    assert open_ == pytest.approx(
        basis(plain[0], plain[2], misfit.setting.s, misfit.tolerances), abs=1e-12
    )


def test_what_misses_change_around_misses_is_that_of_finite_differences(told):
    misfit, eta = told
    open_ = missed(misfit, eta)[2]
    for number in range(eta.shape[1]):
        step = np.zeros_like(eta)
        step[:, number] = 1e-4
        expected = (missed(misfit, eta + step)[0] - missed(misfit, eta - step)[0]) / 2e-4
        # Where a hit beside its point moves with a joint that is turned is left out.
        assert np.abs(open_[:, number] - expected).max() <= 0.01 * np.abs(expected).max(), number


def test_misses_and_parameters_act_together(problem, told):
    """The misfit's gradient, where hits and chain err by as much as they may."""
    misfit, eta = told
    measured = replace(misfit.measured, accelerance=missed(misfit, eta)[0])
    misfit = replace(misfit, measured=measured)
    x = misfit.mean + 0.02 * misfit.sd * np.random.default_rng(4).standard_normal(len(misfit.mean))
    at = misfit(x)
    whitened = np.linalg.cholesky(at.normal)
    found = []
    for direction in np.linalg.inv(whitened):
        step = 0.02 * direction
        found.append((misfit(x + step).value - misfit(x - step).value) / 0.04)
    expected = np.linalg.solve(whitened, at.gradient)
    off = np.linalg.norm(np.array(found) - expected)
    assert off < 0.02 * np.linalg.norm(expected), (off, np.linalg.norm(expected))
