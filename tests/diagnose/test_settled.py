"""Evidence where hits miss: wherever a fit stopped, it is told where it is best."""

from dataclasses import replace

import numpy as np
import pytest

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.discrepancy import InnerProducts
from planner.diagnosis.linear.evidence import stated_springs
from planner.diagnosis.linear.fit import Fit, settle
from planner.diagnosis.linear.problem import Grade, Problem
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.measurement.missed_ports import actual_ports
from planner.measurement.nuisances import basis
from planner.robot.robot import Robot
from tests.support.known_robots import kr210_folder

LINES = Grade(24, 0.003)
BAND = 5.0, 55.0
SIZE, AWAY = 3e-3, 0.25  # of the discrepancy; prior sds, beyond which other minima lie


@pytest.fixture(scope="module")
def best(tmp_path_factory) -> Fit:
    """A fit of FRFs whose hits missed, under a chain that errs, of a robot that is not as stated.

    Noise is 2 % of each FRF; the robot's numbers, misses and chain are of one sd each.
    """
    simulation = Simulation(Robot.load(kr210_folder(tmp_path_factory.mktemp("kr210"))))
    rng = np.random.default_rng(8)
    q = np.array([[0.3, -1.5, 1.4, 0.4, -1.0, 0.7], [-0.6, -1.1, 1.0, -0.5, -1.3, -0.2]])
    q = np.concatenate([q, np.add(q[:1], [0.5, 0.3, -0.2, 0.6, 0.3, 0.5])])
    frequency, nan = np.linspace(*BAND, 48), np.full((3, 3, 48), np.nan)

    def problem_of(h: np.ndarray) -> Problem:
        frfs = [
            Frf(frequency, one, np.abs(0.02 * one) ** 2 + 1e-12, nan, (1, 1, 1), BAND) for one in h
        ]
        return Problem(tuple(frfs), q, simulation, BAND)

    plain = problem_of(simulation.accelerance(q, frequency))
    misfit = plain.misfit(Effect(""), Grade(48, 0.003))
    x = misfit.mean + misfit.sd * np.clip(rng.standard_normal(len(misfit.mean)), -1, 1)
    s, t = misfit.setting.s, misfit.tolerances
    assert t is not None
    open_ = basis(*misfit.values(x), s, t)
    h = misfit.parts(x, actual_ports(rng.standard_normal(open_.shape[:2]), s, t, (3, 3)))[0]
    noise = rng.standard_normal((*h.shape, 2)) @ np.array([1.0, 1j]) / np.sqrt(2)
    problem = problem_of(h + 0.02 * np.abs(h) * noise)
    return settle(problem, Fit(Effect(""), problem.misfit(Effect(""), LINES), x, None), LINES)  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(5))
def test_evidence_is_the_same_wherever_a_fit_stopped(best, seed):
    springs = stated_springs(best)
    away = AWAY * best.misfit.sd * np.random.default_rng(seed).standard_normal(len(best.x))
    x = best.x + away
    assert best.misfit.possible(x)
    far = replace(best, x=x, data=best.misfit.by_pose(x))
    near, off = (InnerProducts.of(fit, springs) for fit in (best, far))
    assert abs(off.at(SIZE, 1.0).evidence - near.at(SIZE, 1.0).evidence) > 50  # by one step
    (_, here), (_, there) = (p.settled(SIZE, 1.0, springs, 60) for p in (near, off))
    assert there.evidence == pytest.approx(here.evidence, abs=2.0)
    assert there.stays == pytest.approx(there.evidence, abs=0.5)


def test_gradient_of_what_is_followed_is_that_of_finite_differences(best):
    """Of −ln evidence but for the volumes, misses being taken around themselves."""
    springs = stated_springs(best)
    here, one = InnerProducts.of(best, springs).settled(SIZE, 1.0, springs, 60)
    assert np.all(np.abs(one.gradient / np.sqrt(np.diagonal(one.normal))) < 1.0)
    rng = np.random.default_rng(2)
    step = rng.standard_normal(len(one.u)) / np.sqrt(np.diagonal(one.normal))
    u = one.u + 3 * step
    moved = here.moved(one, u, springs)
    assert moved is not None
    at, values = moved.at(SIZE, 1.0), []
    for side in (1e-3, -1e-3):
        beside = moved.moved(at, u + side * step, springs)
        assert beside is not None
        told = beside.at(SIZE, 1.0)
        values.append(-told.stays - float(told.volumes.sum()) / 2 - _log_det(told) / 2)
    slope = (values[0] - values[1]) / 2e-3
    assert slope == pytest.approx(float(at.gradient @ step), rel=0.1)


def _log_det(told) -> float:
    whole = told.left.sum(axis=0)[1:, 1:]
    return float(np.linalg.slogdet(whole + np.eye(len(whole)))[1])
