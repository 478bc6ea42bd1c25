"""One law at several joints at once: hits in time, derivatives, and robots that do it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.dataset.dataset import Dataset, Visit
from planner.diagnosis.finding import Finding
from planner.diagnosis.law_beside_linear import leaves_room
from planner.diagnosis.laws.equivalent_stiffness import receptances
from planner.diagnosis.laws.one_joint_response import seen, spectra, strokes, torques
from planner.diagnosis.laws.several_joint_response import joints_of, rates, torque_spectra
from planner.diagnosis.laws.torque_laws import LAWS, Law
from planner.diagnosis.screens.screen import screen
from planner.dynamics.simulation import Elasticity, Simulation
from planner.recording.records import Hit
from planner.robot.robot import Robot
from planner.truth.deviation import Deviation
from planner.truth.hits import Hammer
from planner.truth.laws import Friction, Hardening
from planner.truth.load import load_truth
from planner.truth.nonlinear import Port
from planner.truth.scene import Scene
from planner.truth.secret import HitVisit, Secret, hit_poses
from tests.support.known_robots import KR10
from tests.support.struck import VISITS, struck_robot

STIFFENING, DAHL, DEAD_ZONE = LAWS


@pytest.fixture(scope="module")
def struck(tmp_path_factory):
    """A system, hits along three axes at two poses, the same in fewer steps, and lines."""
    system, columns = struck_robot(tmp_path_factory.mktemp("kr210"))
    s = 2j * np.pi * np.linspace(6, 45, 9) + 4
    return system, strokes(VISITS, columns), strokes(VISITS, columns, 3, 0.7), s


def with_spring(law: Law, more: np.ndarray) -> Law:
    """The law with linear springs beside it."""

    def step(xp, k, a, state, before, now):
        torque, slope, after = law.step(xp, k, a, state, before, now)
        return torque + more * now, slope + more, after

    return replace(law, step=step)


def test_linear_torques_at_all_joints_are_stiffer_springs(struck):
    system, hits, _, s = struck
    joints = joints_of(system, hits, 500.0)
    more = np.array([0.4, 0.2, 0.5, 0.3, 0.1, 0.2]) * joints.stiffness
    one = np.ones(6)
    found = torque_spectra(with_spring(STIFFENING, more), 0 * one, one, joints, hits, s)
    k = system.elasticity.stiffness.copy()
    k[system.blocks] += more
    springs = Elasticity(k, system.elasticity.damping, system.elasticity.loss_factor)
    stiffer = replace(system, elasticity=springs)
    force = spectra(hits.force.T, hits, s)
    for c in range(6):
        swing = receptances(stiffer, int(hits.visit[c]), s).port_hit[:, :, hits.axis[c]]
        expected = (more * swing).T
        ratio = found.spectrum[:, c] / force[c]
        assert np.allclose(ratio, expected, atol=0.02 * np.abs(expected).max())
    assert np.allclose(found.stiffer, more, rtol=1e-6)


@pytest.mark.parametrize(
    ("law", "rest"),
    [*((law, 0.0) for law in LAWS), (DEAD_ZONE, 3.2e-4), (DEAD_ZONE, -1e-4)],
    ids=lambda value: value.effect if isinstance(value, Law) else f"held at {value:g}",
)
def test_a_law_at_one_joint_is_what_it_is_by_itself(struck, law, rest):
    """Dahl's slope jumps where a joint turns, so that Newton's steps end elsewhere by a little."""
    system, hits, _, s = struck
    joints, port = joints_of(system, hits, 500.0), 2
    joints = replace(joints, rest=np.full((6, 6), rest))
    k, a = np.full(6, 1e-6 * joints.stiffness[0]), np.full(6, 3e-4)
    k[port] = 0.5 * joints.stiffness[port]
    together = torque_spectra(law, k, a, joints, hits, s).spectrum[port]
    view = seen(system, port, hits, 500.0)
    numbers = np.full(6, k[port]), np.full(6, 3e-4), np.zeros(6)
    alone = torques([(law, slice(0, 6))], *numbers, view, np.full(6, rest))
    expected = spectra(alone, hits, s)
    assert np.allclose(together, expected, atol=5e-3 * np.abs(expected).max())


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.effect)
def test_derivatives_follow_the_swings_in_time(struck, law):
    system, _, hits, s = struck
    joints = joints_of(system, hits, 500.0)
    k = np.array([0.5, 0.4, 0.6, 0.5, 0.3, 0.5]) * joints.stiffness
    a = np.full(6, 3e-4)
    found = rates(law, k, a, joints, hits, s)
    for joint in (1, 4):
        bump = np.where(np.arange(6) == joint, 1e-4, 0.0)
        ends = {
            0: [(law, k * np.exp(sign * bump), a) for sign in (1, -1)],
            1: [(law, k, a * np.exp(sign * bump)) for sign in (1, -1)],
            2: [(with_spring(law, sign * bump * joints.stiffness), k, a) for sign in (1, -1)],
        }
        for kind, (up, down) in ends.items():
            over, under = (torque_spectra(*end, joints, hits, s).spectrum for end in (up, down))
            slope = (over - under) / 2e-4
            assert np.allclose(found[kind, joint], slope, atol=0.02 * np.abs(slope).max())


def recorded(folder: Path, drives: tuple[int, ...], law: str, poses: int) -> tuple:
    """KR10 whose drives follow a law each, hit at three levels, and its simulation."""
    toml = KR10.write(folder)
    truth, q = load_truth(toml, Deviation(3, inertia=0.03)), KR10.poses(poses, seed=3)
    hammer = Hammer(150.0, 0.003, 1000.0, 1.28, noise=0.01)
    scene = Scene(KR10, truth, 3, q, 50.0)
    laws = {}
    for number in drives:
        joint = f"joint_{number}"
        k, a = scene.stiffness(joint), scene.angle(joint)
        laws[joint] = Hardening(k, 0.6 * a) if law == "hardening" else Friction(k, k * a / 3)
    ports = tuple(Port(one, joint=joint) for joint, one in laws.items())
    shots = [("+" + axis, share * hammer.peak_n) for axis in "xyz" for share in (0.4, 1.0, 2.5)]
    planned, rng = [HitVisit(row, shots) for row in q], np.random.default_rng(5)
    made = hit_poses(truth, Secret(Deviation(3, inertia=0.03), ports), planned, hammer, rng)
    visits = []
    for i, (row, hits) in enumerate(zip(q, made, strict=True)):
        of_pose = tuple(
            Hit(Path("hit"), h.axis, 1000.0, h.force_n, h.acceleration_m_s2, simulated=True)
            for h in hits
        )
        visits.append(Visit(f"P{i}", row, i / max(poses - 1, 1), of_pose))
    simulation = Simulation(Robot.load(toml))
    return Dataset.of_visits(tuple(visits), simulation.robot.config.band_hz), simulation, laws


def test_two_drives_that_harden_are_named_and_no_others(tmp_path):
    hit, simulation, laws = recorded(tmp_path, (2, 3), "hardening", 5)
    found = screen(hit, simulation).findings
    assert {(f.effect, f.at) for f in found} == {("nonlinear_stiffness", at) for at in laws}
    for f in found:
        true = vars(laws[f.at])
        for (value, sd, _), expected in zip(f.parameters.values(), true.values(), strict=True):
            assert abs(value - expected) < 3 * sd


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("drives", [(1, 3), (2, 3, 5)], ids=["two", "three"])
def test_drives_that_stick_and_slide_are_named(tmp_path, drives):
    hit, simulation, laws = recorded(tmp_path, drives, "friction", 7)
    found = screen(hit, simulation).findings
    assert {(f.effect, f.at) for f in found} == {("friction", at) for at in laws}


def test_beside_laws_of_several_joints_nothing_linear_is_looked_for():
    crude = [Finding("friction", at, 50.0, misfit=40.0) for at in ("joint_1", "joint_2")]
    assert leaves_room(crude[:1])
    assert not leaves_room(crude)
