"""Hits that miss axis and point: what they do, by another engine; how it is told and taken out."""

from dataclasses import replace

import numpy as np
import pytest

from planner.dataset.dataset import Dataset
from planner.diagnosis.laws.equivalent_stiffness import equivalent, system_of
from planner.diagnosis.laws.level_refits import base
from planner.diagnosis.linear.problem import tolerances_of
from planner.diagnosis.misses_again import abstained
from planner.diagnosis.screens import force_levels
from planner.diagnosis.screens.compared_levels import disproportion
from planner.diagnosis.screens.force_levels import PROPORTIONAL
from planner.diagnosis.screens.hit_errors import beyond_any_hand, taken_out
from planner.diagnosis.screens.screen import screen
from planner.dynamics.gradient import response_turned
from planner.dynamics.simulation import Simulation
from planner.measurement.nuisances import (
    OPEN,
    Tolerances,
    basis,
    chain_basis,
    hit_basis,
    marginal,
)
from planner.robot.robot import Robot
from planner.truth.deviation import Deviation
from planner.truth.handling import Aim, MeasuringChain
from planner.truth.hits import Hammer, write_recordings
from planner.truth.load import load_truth
from planner.truth.secret import HitVisit, Secret, hit_poses
from tests.support.known_robots import KR10

HZ = np.linspace(6.0, 60.0, 40)
S = 2j * np.pi * HZ[None]
UNIT = Tolerances(*[1.0] * 9)


@pytest.fixture(scope="module")
def robot_toml(tmp_path_factory):
    return KR10.write(tmp_path_factory.mktemp("kr10"))


def answered(truth, q, wrench):
    """Accelerance (3, F) to a unit wrench (6,), by the other engine."""
    poles, shapes, entry, hit, sensor = truth.modal(q)
    drive = np.vstack([hit, truth.turning(q)]).T @ wrench
    iw = 2j * np.pi * HZ
    return iw**2 * ((sensor @ shapes) @ ((entry @ drive)[:, None] / (iw - poles[:, None])))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_hit_that_misses_is_answered_as_the_other_engine_says(robot_toml, axis):
    simulation, truth = Simulation(Robot.load(robot_toml)), load_truth(robot_toml)
    q = KR10.poses(1, 5)[0]
    h, turned = response_turned(simulation.elastic.matrices(q), simulation.elasticity, S)
    across = [(axis + 1) % 3, (axis + 2) % 3]
    eta = np.array([0.03, -0.02, 0.004, 0.007])
    direction, offset = np.zeros(3), np.zeros(3)
    direction[across], offset[across] = eta[:2], eta[2:]
    wrong = answered(truth, q, Aim(direction, offset).wrench(axis))
    right = answered(truth, q, Aim().wrench(axis))
    change = np.einsum("k,kif->if", eta, hit_basis(h, turned.moment, UNIT)[0, axis])
    assert change == pytest.approx(wrong - right, abs=2e-6 * np.abs(right).max())


def test_a_sensor_beside_its_place_shows_what_the_other_engine_says(robot_toml):
    simulation, truth = Simulation(Robot.load(robot_toml)), load_truth(robot_toml)
    q, place = KR10.poses(1, 6)[0], (0.004, -0.01, 0.007)
    h, turned = response_turned(simulation.elastic.matrices(q), simulation.elasticity, S)
    from dataclasses import replace

    moved = replace(truth, sensor_offset_m=place).accelerance(q, HZ)
    change = chain_basis(h, turned.turning, S, UNIT)[0, 9:12]
    expected = moved - truth.accelerance(q, HZ)
    assert np.einsum("k,kijf->ijf", place, change) == pytest.approx(
        expected, abs=2e-6 * np.abs(h).max()
    )


@pytest.mark.parametrize("joint", range(6))
def test_a_joint_beside_its_readback_shows_what_the_other_engine_says(robot_toml, joint):
    simulation, truth = Simulation(Robot.load(robot_toml)), load_truth(robot_toml)
    q, turn = KR10.poses(1, 6)[0], 1e-5 * np.eye(6)[joint]
    h, turned = response_turned(simulation.elastic.with_slopes(q), simulation.elasticity, S)
    change = (truth.accelerance(q + turn, HZ) - truth.accelerance(q - turn, HZ)) / 2e-5
    # The sag that goes with the angle is left out: a thousandth.
    least = 1e-5 * np.abs(h).max()
    expected = pytest.approx(change, abs=3e-3 * np.abs(change).max() + least)
    assert turned.by_angle[0, joint] == expected


def test_integrating_out_is_the_dense_gaussian():
    rng = np.random.default_rng(0)
    r, j, b = rng.standard_normal(30), rng.standard_normal((4, 30)), rng.standard_normal((5, 30))
    covariance = np.eye(30) + b.T @ b
    found = marginal(r, j, b)
    assert found.chi2 == pytest.approx(r @ np.linalg.solve(covariance, r))
    assert found.gradient == pytest.approx(j @ np.linalg.solve(covariance, r))
    assert found.normal == pytest.approx(j @ np.linalg.solve(covariance, j.T))
    assert found.log_volume == pytest.approx(np.linalg.slogdet(covariance)[1])
    assert found.eta == pytest.approx(b @ np.linalg.solve(covariance, r))


def test_all_of_them_are_of_the_poses_and_scale_with_their_sds(robot_toml):
    simulation = Simulation(Robot.load(robot_toml))
    q = KR10.poses(2, 7)
    s = np.repeat(S, 2, axis=0)
    h, turned = response_turned(simulation.elastic.with_slopes(q), simulation.elasticity, s)
    made = basis(h, turned, s, UNIT)
    assert made.shape == (2, OPEN + 6, 3, 3, HZ.size)
    chain = chain_basis(h, turned.turning, s, UNIT)
    assert np.array_equal(made[:, 12:OPEN], chain)
    hits = hit_basis(h, turned.moment, UNIT)
    for axis in range(3):
        own = made[:, 4 * axis : 4 * axis + 4]
        assert np.array_equal(own[:, :, :, axis], hits[:, axis])
        assert np.count_nonzero(own) == np.count_nonzero(hits[:, axis])
    half = Tolerances(*[0.5] * 9)
    assert basis(h, turned, s, half) == pytest.approx(basis(h, turned, s, UNIT) / 2)


@pytest.fixture(scope="module")
def missed(robot_toml, tmp_path_factory):
    """Visits of a linear robot hit at three force levels, each hit off by 2° and 5 mm."""
    rng = np.random.default_rng(3)
    truth = load_truth(robot_toml, Deviation(stiffness=0.1, damping=0.1, seed=4))
    secret = Secret(truth.deviation, chain=MeasuringChain())
    hammer, shots = Hammer(150.0, 0.006, noise=0.01), []
    shots = [(f"+{a}", 150.0 * k) for a in "xyz" for k in (0.4, 1.0, 2.5)]
    visits, aims = [], []
    for q in KR10.poses(3, 8):
        own = []
        for axis, _ in shots:
            across = 1.0 - np.eye(3)["xyz".index(axis[1])]
            own.append(
                Aim(np.deg2rad(2.0) * across * rng.standard_normal(3),
                    0.005 * across * rng.standard_normal(3))
            )  # fmt: skip
        aims.append(own)
        visits.append(HitVisit(q, shots, 0.0, own))
    found = hit_poses(truth, secret, visits, hammer, rng)
    rows = [
        (f"P{i}", np.rad2deg(visit.q), k, hit)
        for i, (visit, hits) in enumerate(zip(visits, found, strict=True))
        for k, hit in enumerate(hits, 1)
    ]
    folder = tmp_path_factory.mktemp("missed")
    write_recordings(folder, truth.joint_names, rows, hammer, "test")
    robot = Robot.load(robot_toml)
    return Dataset.read(folder, robot), Simulation(robot), aims


def test_misses_are_told_and_taken_out(missed):
    visits, simulation, aims = missed
    clean, errors = taken_out(visits, simulation)
    told, true = [], []
    for visit, own, truth in zip(visits.visits, errors, aims, strict=True):
        for axis in range(3):
            group = [i for i, hit in enumerate(visit.hits) if hit.axis_index == axis]
            across = [(axis + 1) % 3, (axis + 2) % 3]
            real = np.array(
                [[*truth[i].direction[across], *truth[i].offset_m[across]] for i in group]
            )
            true += list(real - real.mean(axis=0))
            told += [[*own[i].tilt_rad, *own[i].offset_m] for i in group]
    told, true = np.array(told), np.array(true)
    for part in (slice(0, 2), slice(2, 4)):
        assert np.corrcoef(told[:, part].ravel(), true[:, part].ravel())[0, 1] > 0.9
    assert not beyond_any_hand(errors, tolerances_of(simulation))
    worse = [[replace(e, offset_m=6 * e.offset_m) for e in own] for own in errors]
    assert beyond_any_hand(worse, tolerances_of(simulation))
    system = system_of(base(clean, simulation))
    assert disproportion(equivalent(visits, system)) > 10
    assert disproportion(equivalent(clean, system)) < PROPORTIONAL


def test_misses_beyond_any_hand_are_called_unknown(missed, monkeypatch):
    """Levels that misses alone explain, were they larger than any hand's: nothing is corrected."""
    visits, simulation, _ = missed
    assert screen(visits, simulation, chain=False).hit_errors
    monkeypatch.setattr("planner.diagnosis.screens.hit_errors.BEYOND_ANY_HAND", 0.1)
    assert screen(visits, simulation, chain=False).hit_errors  # open misses explain the levels
    monkeypatch.setattr(force_levels, "PROPORTIONAL", 0.01)
    monkeypatch.setattr(force_levels, "BY_CHANCE", -1.0)
    found = screen(visits, simulation, chain=False)
    assert [f.effect for f in found.findings] == ["unknown"]
    assert not found.hit_errors
    assert found.clean is visits
    (_, (remark,)) = abstained(found.findings)
    assert "more than any hand's misses" in remark
