"""Natural frequencies told from FRFs by a simulation's own modes."""

import numpy as np
import pytest

from planner.campaign.frequencies_by_simulation import tuned_frequencies
from planner.dynamics.simulation import Simulation
from planner.frf.estimator import estimate
from planner.measurement.nuisances import Tolerances
from planner.proof.deviation import Deviation
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.robot.robot import Robot
from tests.support.arm_with_points import poses, write_arm
from tests.support.true_modes import hits_at

BAND_HZ, COUNT = (4.0, 90.0), 3
NOISY = Hammer(peak_n=250.0, duration_s=0.005, sampling_rate_hz=512.0, record_s=2.0, noise=0.03)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """An arm as stated, FRFs of noisy records at three poses (n, 4), and its frequencies there."""
    path = write_arm(tmp_path_factory.mktemp("arm"))
    truth, q, rng = load_truth(path, Deviation()), poses(3), np.random.default_rng(5)
    frfs = [estimate(hits_at(truth, one, NOISY, rng), BAND_HZ).within(BAND_HZ) for one in q]
    true_hz = np.array([truth.modes(one, COUNT)[0] for one in q])
    return Simulation(Robot.load(path)), frfs, q, true_hz


def off_by(simulation: Simulation, factor: float) -> Simulation:
    """The same with all stiffnesses times a factor."""
    e = simulation.elasticity
    return simulation.changed(type(e)(factor * e.stiffness, e.damping, e.loss_factor))


@pytest.mark.parametrize("factor", [1.0, 0.98, 1.03])
def test_frequencies_are_told_though_the_simulation_is_a_percent_off(recorded, factor):
    simulation, frfs, q, true_hz = recorded
    wrong = off_by(simulation, factor)
    hz, sd = tuned_frequencies(wrong, frfs, q, BAND_HZ, Tolerances(), COUNT)
    assert np.max(np.abs(hz / true_hz - 1)) < 2e-3
    assert np.max(np.abs(hz - true_hz) / sd) < 3.5


def test_a_simulation_that_is_far_off_tells_nothing(recorded):
    simulation, frfs, q, _ = recorded
    _, sd = tuned_frequencies(off_by(simulation, 0.5), frfs, q, BAND_HZ, Tolerances(), COUNT)
    assert not np.isfinite(sd).any()
