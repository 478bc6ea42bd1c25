"""A low fidelity that learns: identified from recordings, uncertain where it should be, doubted.

And frequencies told from FRFs by its own modes.
`pytest -m slow tests/campaign/test_low_fidelity.py` leaves bearings out of the description.
"""

import re

import numpy as np
import pytest

from planner.campaign.frequencies_by_simulation import tuned_frequencies
from planner.campaign.low_fidelity import LowFidelity, identify_low_fidelity
from planner.dataset.measure import MeasuredPose
from planner.dynamics.simulation import Simulation
from planner.fit.frequency_uncertainty import log_frequency_slope
from planner.fit.posterior import RobotBelief
from planner.fit.structure import exported
from planner.fit.write_robot import updated_toml
from planner.frf.estimator import estimate
from planner.frf.frf import Frf
from planner.measurement.nuisances import Tolerances
from planner.proof.deviation import AttachedResonator, Deviation
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.recording.records import Hit
from planner.robot.robot import Robot
from tests.support.arm_with_points import poses, write_arm
from tests.support.robots import BAND_HZ, JOINTS_DEG, make_arm
from tests.support.true_modes import hits_at

HAMMER = Hammer(peak_n=60.0, duration_s=0.004, sampling_rate_hz=640.0, record_s=2.0)
COUNT = 4


def ended(hits: tuple[Hit, ...], band_hz: tuple[float, float]) -> Frf:
    """As a campaign sees a pose's hits: under a window by which decays are over."""
    found = MeasuredPose((), band_hz, given=hits).one_hit_frf
    assert found is not None
    return found


def measured(path, n: int = 4, resonators: tuple[AttachedResonator, ...] = ()):
    """FRFs at n poses and true frequencies at 20 others."""
    truth = load_truth(path, Deviation(7, 0.15, 0.15, 0.03, 0.003, resonators=resonators))
    rng = np.random.default_rng(0)
    low, high = np.deg2rad(np.transpose(JOINTS_DEG))
    q, other = rng.uniform(low, high, (n, 6)), rng.uniform(low, high, (20, 6))
    frfs = [ended(hits_at(truth, p, HAMMER, np.random.default_rng(i)), BAND_HZ)
            for i, p in enumerate(q)]  # fmt: skip
    return frfs, q, other, np.array([truth.modes(p, COUNT)[0] for p in other])


def learned(path, deviation: Deviation, n: int):
    """The simulation of an arm before and after it has learned from n poses, and the true arm."""
    band, truth, rng = (4.0, 90.0), load_truth(path, deviation), np.random.default_rng(3)
    hammer = Hammer(peak_n=250.0, duration_s=0.005, sampling_rate_hz=512.0, record_s=2.0)
    frfs = [ended(hits_at(truth, one, hammer, rng), band) for one in poses(n)]
    before = LowFidelity(COUNT, Simulation(Robot.load(path)), Tolerances())
    return before, identify_low_fidelity(before, frfs, poses(n), band), truth


@pytest.fixture(scope="module")
def right(tmp_path_factory):
    """A simulation with all the physics, before and after it has learned."""
    path = make_arm(tmp_path_factory.mktemp("arm"), transverse=True)
    frfs, q, other, true_hz = measured(path)
    before = LowFidelity(COUNT, Simulation(Robot.load(path)))
    return before, identify_low_fidelity(before, frfs, q, BAND_HZ), other, true_hz


def rmse(low: LowFidelity, q: np.ndarray, true_hz: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.log(low.simulate(q).frequency_hz / true_hz) ** 2)))


def test_with_the_right_physics_few_poses_teach_the_whole_workspace(right):
    before, after, other, true_hz = right
    assert rmse(before, other, true_hz) > 0.02
    assert rmse(after, other, true_hz) < 0.005
    assert after.remark == ""


def test_what_the_parameters_leave_open_covers_the_error(right):
    _, after, other, true_hz = right
    error = np.log(after.simulate(other).frequency_hz / true_hz)
    sd = after.frequency_sd(other, after.simulate(other))
    assert np.mean(np.abs(error) < 2.5 * np.hypot(sd, 1e-3)) > 0.8
    assert np.median(sd) < 0.01


@pytest.mark.slow
def test_springs_that_the_description_lacks_are_found_and_named(tmp_path):
    frfs, q, other, true_hz = measured(make_arm(tmp_path / "true", transverse=True), n=3)
    path = make_arm(tmp_path / "simulated")
    before = LowFidelity(COUNT, Simulation(Robot.load(path)))
    after = identify_low_fidelity(before, frfs, q, BAND_HZ)
    assert rmse(before, other, true_hz) > 0.1
    assert rmse(after, other, true_hz) < 0.01
    assert "The bearing of joint_" in after.remark


def test_a_resonator_that_is_stated_is_refitted_and_not_found_again(tmp_path):
    hose = AttachedResonator("link_4", (0.0, 0.0, 0.1), (0.0, 1.0, 0.0), 6.0, 18.0, 0.02)
    path = make_arm(tmp_path)
    frfs, q, other, true_hz = measured(path, 3, resonators=(hose,))
    joint = Robot.load(path).joint_names[3]
    stated = (
        f'\n[[resonator]]\njoint = "{joint}"\nposition_m = [0.02, 0.0, 0.08]\n'
        "direction = [0.1, 1.0, 0.0]\nmass = 5.0\nfrequency_hz = 17.4\ndamping_ratio = 0.03\n"
    )
    path.write_text(path.read_text() + stated)
    after = identify_low_fidelity(
        LowFidelity(COUNT, Simulation(Robot.load(path))), frfs, q, BAND_HZ
    )
    assert "swings" not in after.remark
    assert after.simulation is not None
    (found,) = after.simulation.robot.config.resonator
    assert found.frequency_hz == pytest.approx(18.0, rel=0.003)
    assert found.mass == pytest.approx(6.0, rel=0.1)
    assert rmse(after, other, true_hz) < 0.005
    assert after.identified_robot is not None
    written = updated_toml(path.read_text(), after.identified_robot.identified)
    assert written.count("[[resonator]]") == 1
    assert f"frequency_hz = {found.frequency_hz}" in written


def test_damping_that_is_partly_a_loss_factor_is_no_lack_of_compliance(tmp_path):
    """Nothing is wrong but how gears dissipate: no spring is made up for it."""
    path = write_arm(tmp_path)
    stated = path.read_text()
    damped = re.sub(r"damping = ([\d.e+]+)", lambda m: f"damping = {4 * float(m[1])}", stated)
    path.write_text(damped)
    _, after, _ = learned(path, Deviation(8, 0.15, 0.15, 0.03, 0.003, mixed=1.0), 3)
    assert after.is_identified
    assert after.identified_robot is not None
    assert after.identified_robot.added == 0
    assert "loss factors" in after.remark
    assert "swings" not in after.remark


def test_a_mass_that_swings_on_a_link_is_found_and_named(tmp_path):
    hose = AttachedResonator("l4", (0.15, 0.01, 0.0), (-0.8, 0.3, 0.5), 2.3, 59.8, 0.03)
    deviation = Deviation(7, 0.15, 0.15, 0.03, 0.003, resonators=(hose,))
    before, after, truth = learned(write_arm(tmp_path), deviation, 2)
    assert after.is_identified
    other = poses(12, seed=2)
    true_hz = np.array([truth.modes(one, COUNT)[0] for one in other])
    assert rmse(after, other, true_hz) < 0.01 < 0.1 < rmse(before, other, true_hz)
    assert "on link_4 has a resonance of its own at 59.8 Hz" in after.remark


def test_a_joint_that_only_creeps_is_no_modes_stiffness(right):
    """A soft joint's overdamped mode lies among the others and is no natural frequency."""
    before, _, other, _ = right
    structure, q = before.prior.stated(), other[:3]
    x, stiff = structure.mean.copy(), structure.stiffnesses
    own = int(np.argmin(x[:stiff]))
    x[own] -= np.log(100.0)
    x[stiff : 2 * stiff] = -30.0  # ln of damping over stiffness: none but its own
    x[stiff + own] = structure.mean[stiff + own] + np.log(300.0)
    soft = structure.elasticity(x).stiffness

    def creeping(factor: float = 1.0) -> Simulation:
        there = x + np.log(factor) * np.eye(len(x))[own]
        there[stiff + own] -= np.log(factor)  # the damper stays
        changed = exported(structure, there)[0]
        changed.elastic = changed.elastic.carried_by(soft)  # in the posture in which it sags now
        return changed

    belief = RobotBelief(structure, x, np.eye(structure.size), Tolerances())
    modes = creeping().modes(q, COUNT)
    both = log_frequency_slope(belief, q, modes)
    slope = both[:, :, own] - both[:, :, stiff + own]
    hertz = creeping().modes(q, len(soft)).frequency_hz
    assert np.all(np.isnan(hertz[:, -1])), "one mode does not swing"
    step = 1e-3
    moved = np.log(creeping(1 + step).modes(q, COUNT).frequency_hz)
    by_difference = (moved - np.log(creeping(1 - step).modes(q, COUNT).frequency_hz)) / (2 * step)
    np.testing.assert_allclose(slope, by_difference, atol=1e-6)


WIDE_HZ, FEW = (4.0, 90.0), 3
NOISY = Hammer(peak_n=250.0, duration_s=0.005, sampling_rate_hz=512.0, record_s=2.0, noise=0.03)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """An arm as stated, FRFs of noisy records at three poses (n, 4), and its frequencies there."""
    path = write_arm(tmp_path_factory.mktemp("arm"))
    truth, q, rng = load_truth(path, Deviation()), poses(3), np.random.default_rng(5)
    frfs = [estimate(hits_at(truth, one, NOISY, rng), WIDE_HZ).within(WIDE_HZ) for one in q]
    true_hz = np.array([truth.modes(one, FEW)[0] for one in q])
    return Simulation(Robot.load(path)), frfs, q, true_hz


def off_by(simulation: Simulation, factor: float) -> Simulation:
    """The same with all stiffnesses times a factor."""
    e = simulation.elasticity
    return simulation.changed(type(e)(factor * e.stiffness, e.damping, e.loss_factor))


@pytest.mark.parametrize("factor", [1.0, 0.98, 1.03])
def test_frequencies_are_told_though_the_simulation_is_a_percent_off(recorded, factor):
    simulation, frfs, q, true_hz = recorded
    wrong = off_by(simulation, factor)
    hz, sd = tuned_frequencies(wrong, frfs, q, WIDE_HZ, Tolerances(), FEW)
    assert np.max(np.abs(hz / true_hz - 1)) < 2e-3
    assert np.max(np.abs(hz - true_hz) / sd) < 3.5


def test_a_simulation_that_is_far_off_tells_nothing(recorded):
    simulation, frfs, q, _ = recorded
    _, sd = tuned_frequencies(off_by(simulation, 0.5), frfs, q, WIDE_HZ, Tolerances(), FEW)
    assert not np.isfinite(sd).any()
