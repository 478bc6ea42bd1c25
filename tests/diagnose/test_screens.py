"""Screens on hits whose cause is known because the planner's own simulation made them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planner.dataset.dataset import Dataset
from planner.dataset.visits import Visit
from planner.diagnosis.effects.drift import Drift
from planner.diagnosis.effects.effect import Effect, Quantity
from planner.diagnosis.effects.sensor_chain import SensorChain
from planner.diagnosis.finding import Finding
from planner.diagnosis.laws.equivalent_stiffness import equivalent, system_of
from planner.diagnosis.linear.drift_fit import problem_of
from planner.diagnosis.linear.fit import fit
from planner.diagnosis.linear.problem import Grade
from planner.diagnosis.screens import artefacts, compared_levels, drift
from planner.diagnosis.screens import screen as screens
from planner.diagnosis.screens.exponential_window import screen_window
from planner.diagnosis.thresholds import CLEAR
from planner.dynamics.simulation import Simulation
from planner.recording.records import Hit
from planner.robot.robot import Robot
from tests.support.known_robots import KR210
from tests.support.synthetic_hits import RATE_HZ, recorded

POSES = 5


@pytest.fixture(scope="module")
def simulation(tmp_path_factory):
    return Simulation(Robot.load(KR210.write(tmp_path_factory.mktemp("kr210"))))


@pytest.fixture(scope="module")
def plain(simulation):
    return recorded(simulation, KR210.poses(POSES, 3))


def disturbed(plain: Dataset, change) -> Dataset:
    visits = [replace(v, hits=tuple(replace(h, **change(h)) for h in v.hits)) for v in plain.visits]
    return Dataset.of_visits(tuple(visits), plain.band_hz)


def mixed(matrix: np.ndarray):
    return lambda hit: {"acceleration_m_s2": matrix @ hit.acceleration_m_s2}


def windowed(hit, rate=2.0):
    fade = np.exp(-rate * np.maximum(np.arange(len(hit.force_n)) / RATE_HZ - 0.06, 0))
    return {"force_n": fade * hit.force_n, "acceleration_m_s2": fade * hit.acceleration_m_s2}


def test_recordings_in_order_give_no_finding(plain, simulation):
    assert screens.screen(plain, simulation).findings == ()


TURNED = artefacts.Rotation.from_rotvec([0.1, -0.3, 0.2]).as_matrix()
CHANNELS = {
    "sensor_rotation sensor": TURNED,
    "sensor_gain sensor_y": np.diag([1.0, 0.7, 1.0]),
    "polarity sensor_x": np.diag([-1.0, 1.0, 1.0]),
    "swapped_axes sensor_yz": np.eye(3)[[0, 2, 1]],
}


@pytest.mark.parametrize("wanted", CHANNELS)
def test_a_chain_out_of_order_is_named_and_put_right(plain, simulation, wanted):
    wrong = disturbed(plain, mixed(CHANNELS[wanted]))
    (found,) = artefacts.screen(wrong, simulation)
    assert f"{found.effect} {found.at}" == wanted
    right = artefacts.correct(wrong, [found])
    for was, now in zip(plain.visits, right.visits, strict=True):
        a, b = was.hits[0].acceleration_m_s2, now.hits[0].acceleration_m_s2
        assert np.linalg.norm(a - b) < 0.03 * np.linalg.norm(a)


@pytest.mark.parametrize("visits", [1, 2])
@pytest.mark.parametrize(
    ("wanted", "said"), [("sensor_gain sensor_y", 0), ("polarity sensor_x", 1)]
)
def test_at_a_single_pose_a_gain_is_left_to_the_explanation(
    plain, simulation, wanted, said, visits
):
    wrong = disturbed(plain, mixed(CHANNELS[wanted]))
    returned = tuple(replace(wrong.visits[0], order=float(n)) for n in range(visits))
    found = artefacts.screen(wrong.corrected(returned), simulation)
    assert [f"{f.effect} {f.at}" for f in found] == [wanted] * said


def test_delay_is_measured_and_taken_back(plain, simulation):
    late = 1.5e-3
    told = Finding("channel_delay", "sensor", 99.0, {"delay": (-late, 0.0, "s")})
    wrong = artefacts.correct(plain, [told])  # the correction of a negative delay delays
    (found,) = artefacts.screen(wrong, simulation)
    value, sd, _ = found.parameters["delay"]
    assert found.effect == "channel_delay"
    assert abs(value - late) < 4 * sd < 2e-4


@pytest.mark.parametrize("rate", [0.8, 2.0, 5.0])
def test_window_shows_in_the_noise_of_the_force(plain, rate):
    found = screen_window(disturbed(plain, lambda hit: windowed(hit, rate)))
    assert found is not None
    value, sd, _ = found.parameters["rate"]
    assert abs(value - rate) < 4 * sd < 0.2
    assert screen_window(plain) is None


def test_a_blanked_force_tells_nothing_of_windows(plain):
    def blanked(hit):
        force = hit.force_n.copy()
        force[60:] = 0.0
        return {"force_n": force}

    assert screen_window(disturbed(plain, blanked)) is None


def ringing(fade: float, before: float = 0.0) -> Dataset:
    """Hits whose accelerations ring, noisily, under a window; the robot may ring `before` too."""
    rng, t = np.random.default_rng(7), np.arange(2048) / RATE_HZ
    force = np.where(np.arange(2048) < 4, 200.0, 0.0)
    force, since = np.roll(force, 100), np.maximum(t - 100 / RATE_HZ, 0.0)
    visits = []
    for number in range(3):
        hits = []
        for axis in ("+x", "-y", "+z"):
            rings = np.exp(-3 * since) * np.sin(2 * np.pi * 12 * since)
            early = before * np.exp(-3 * t) * np.sin(2 * np.pi * 90 * t)
            a = rings + early + 1e-3 * rng.standard_normal((3, 2048))
            a *= np.exp(-fade * since)
            noisy = force + 0.1 * rng.standard_normal(2048)
            hits.append(Hit(Path("x"), axis, RATE_HZ, noisy, a))
        visits.append(Visit(f"P{number}", np.zeros(6), number / 2, tuple(hits)))
    return Dataset.of_visits(tuple(visits), (5.0, 60.0))


@pytest.mark.parametrize("rate", [0.3, 0.8, 2.0, 4.0])
def test_window_over_the_accelerations_alone_shows_in_their_noise(rate):
    found = screen_window(ringing(rate))
    assert found is not None
    value, sd, _ = found.parameters["rate"]
    assert abs(value - rate) < 3 * sd < 0.15 + 0.2 * rate
    assert found.log_evidence > CLEAR
    assert "noise of the accelerations" in found.text


def test_what_rings_feigns_no_window():
    assert screen_window(ringing(0.0)) is None
    struck_early = ringing(0.0, before=0.3)
    assert screen_window(struck_early) is None
    one = ringing(0.0)
    few = replace(one.visits[0], hits=(struck_early.visits[0].hits[0], *one.visits[0].hits[1:]))
    visits = (few, *one.visits[1:])
    assert screen_window(Dataset.of_visits(visits, one.band_hz)) is None


def test_drift_is_told_from_what_goes_with_the_pose(simulation):
    course = np.array([0.0, 0.3, 0.5, 0.75, 0.9, 1.0])
    q = KR210.poses(6, 4)
    (found,) = drift.screen(recorded(simulation, q, lambda i, _: 1 + 0.2 * course[i]), simulation)
    value, sd, _ = found.parameters["change"]
    assert found.effect == "drift"
    assert abs(value - 0.2) < 0.01
    assert sd < 0.01


def test_drift_of_one_joint_is_told_as_its_own(simulation):
    course = np.array([0.0, 0.3, 0.5, 0.75, 0.9, 1.0])
    one = np.eye(6)[1]
    q = KR210.poses(6, 4)
    softer = recorded(simulation, q, lambda i, _: 1 - 0.1 * course[i] * one)
    (found,) = drift.screen(softer, simulation)
    value, sd, _ = found.parameters["change"]
    assert found.parameters["change of joint_2"] == found.parameters["change"]
    assert abs(value + 0.1) < 3 * sd
    assert sd < 0.01
    assert ": joint_2 by -9." in found.text


def test_a_pose_that_answers_as_before_has_not_drifted(plain):
    first = plain.visits[0]
    again = replace(first, order=1.0)
    back = Dataset.of_visits((*plain.visits, again), plain.band_hz)
    assert drift.returned(back) == 0.0
    assert drift.returned(plain) is None


def test_without_drift_its_misfit_is_the_plain_one_and_gradients_agree(plain, simulation):
    problem = problem_of(plain, simulation)
    quantities = (Quantity("change", "1", 0.0, 0.2), Quantity("bend", "1", 0.0, 3.0))
    gradual, step = Drift("campaign", quantities), Drift.at_once(0.5)
    laws = gradual, gradual.of_each(simulation), step, step.of_each(simulation)
    for law, own in zip(laws, (2, 7, 1, 6), strict=True):
        misfit = problem.misfit(law, Grade(8))
        still = problem.misfit(Effect(""), Grade(8))
        x = misfit.mean
        assert np.allclose(misfit.response(x)[0], still.response(still.mean)[0], rtol=1e-12)
        x = x + 0.1 * misfit.sd * np.random.default_rng(0).standard_normal(len(x))
        check_gradient(misfit, x, range(len(x) - own, len(x)))


def test_gradient_of_the_chain(plain, simulation):
    problem = problem_of(plain, simulation)
    misfit = problem.misfit(SensorChain.build([np.eye(3)], windowed=True), Grade(8))
    x = misfit.mean + 0.05 * misfit.sd * np.random.default_rng(1).standard_normal(len(misfit.sd))
    check_gradient(misfit, x, range(len(x) - 11, len(x)))


def check_gradient(misfit, x, which):
    slope = misfit.response(x)[1]
    for i in which:
        step = np.zeros(len(x))
        step[i] = 1e-5 * misfit.sd[i]
        moved = misfit.response(x + step)[0] - misfit.response(x - step)[0]
        expected = moved / (2 * step[i])
        assert np.abs(slope[:, i] - expected).max() <= 2e-5 * max(np.abs(expected).max(), 1e-9)


@given(st.floats(-8, 8), st.floats(0, 1))
def test_bend_of_a_course_keeps_its_ends(bend, order):
    shape = Drift("campaign").log_factor(np.array([0.0, order, 1.0]), np.array([1.0, bend]))[0]
    shape = shape[:, 0]
    assert shape[0] == 0
    assert shape[2] == pytest.approx(1)
    assert -1e-12 <= shape[1] <= 1 + 1e-12


def test_equivalent_stiffness_is_that_of_the_joint_that_changed(simulation):
    softer = np.ones(6)
    softer[2] = 0.8
    q = KR210.poses(4, 5)
    data = recorded(simulation, q, lambda _, level: softer if level == 0 else np.ones(6))
    system = system_of(fit(problem_of(data, simulation), Effect("")))
    found = equivalent(data, system)
    assert compared_levels.disproportion(found) > 5
    assert compared_levels.equivalent_share(found) > 0.9
    assert system.ports[int(np.argmin(found.chi2.sum(axis=0)))] == "joint_3"
    weight = found.precision[:, 2]
    delta = np.sum(weight * found.delta[:, 2]) / weight.sum()
    expected = -0.2 * simulation.elasticity.stiffness[2]
    assert delta.real == pytest.approx(expected, rel=0.1)
    assert abs(delta.imag) < 0.1 * abs(expected)
