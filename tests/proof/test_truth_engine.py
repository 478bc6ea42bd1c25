"""Engines behind simulated recordings: analytic cases, laws; two that share no formula are one.

Robots drawn at random are sound. `pytest -m slow tests/proof/test_truth_engine.py` makes a whole
case twice.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.proof import cases, inverse
from planner.proof.arms import ARMS, KR10, in_a_cell
from planner.proof.cases import RANDOM, SCATTER, make_case
from planner.proof.deviation import AttachedMass, Deviation, Spring
from planner.proof.fault_injection import InjectedFaults
from planner.proof.imperfections import imperfect
from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.proof.random_arms import BAND_HZ, LAYOUTS, draw_arm, standing
from planner.proof.scene import Scene
from planner.proof.table import drawn
from planner.robot.robot import Robot
from planner.robot.workspace import Workspace
from tests.support.pendulums import pendulum_urdf

MASS, RADIUS, MOMENT, STIFFNESS, DAMPING = 3.0, 0.4, 0.05, 2.0e4, 12.0
INERTIA = MOMENT + MASS * RADIUS**2

PENDULUM = pendulum_urdf(MASS, MOMENT, (RADIUS, 0, 0), (0.7, 0, 0), (0, 0, 1))

PENDULUM_TOML = f"""name = "one"
urdf = "one.urdf"
tcp_frame = "tip"
sensor_frame = "tip"
[[compliance]]
joint = "turn"
axis = [0, 0, 1]
stiffness = {STIFFNESS}
damping = {DAMPING}
"""


@pytest.fixture
def pendulum(tmp_path) -> Path:
    (tmp_path / "one.urdf").write_text(PENDULUM)
    path = tmp_path / "robot.toml"
    path.write_text(PENDULUM_TOML)
    return path


def folder(tmp_path: Path, name: str, per_joint: int) -> Path:
    return ARMS[name].write(tmp_path / name, per_joint)


def test_one_degree_of_freedom_is_the_textbook_oscillator(pendulum):
    truth, q = load_truth(pendulum), np.array([0.8])
    frequency, damping, residues = truth.modes(q, 3)
    natural = np.sqrt(STIFFNESS / INERTIA)
    assert frequency == pytest.approx([natural / (2 * np.pi)], rel=1e-12)
    assert damping == pytest.approx([DAMPING / (2 * np.sqrt(STIFFNESS * INERTIA))], rel=1e-10)
    damped = natural * np.sqrt(1 - damping[0] ** 2)
    assert residues[0, 1, 1] == pytest.approx(0.7**2 / INERTIA / (2j * damped), rel=1e-10)

    f = np.linspace(1.0, 60.0, 97)
    w = 2 * np.pi * f
    yy = -(w**2) * 0.7**2 / (STIFFNESS - INERTIA * w**2 + 1j * w * DAMPING)
    accelerance = truth.accelerance(q, f)
    assert accelerance[1, 1] == pytest.approx(yy, rel=1e-9)
    others = accelerance[[0, 0, 0, 1, 1, 2, 2, 2], [0, 1, 2, 0, 2, 0, 1, 2]]
    assert np.max(np.abs(others)) < 1e-12 * np.max(np.abs(yy))


@pytest.mark.parametrize("per_joint", [1, 2, 3])
@pytest.mark.parametrize("name", sorted(ARMS))
def test_agrees_with_the_planners_own_simulation(tmp_path, name, per_joint):
    """MuJoCo and Pinocchio, two URDF readers, two eigenproblems: one robot."""
    path = folder(tmp_path, name, per_joint)
    truth, simulation = load_truth(path), Simulation(Robot.load(path))
    f = np.linspace(4, 120, 60)
    for q in ARMS[name].poses(3, seed=per_joint):
        ours, theirs = truth.accelerance(q, f), simulation.accelerance(q, f)[0]
        assert np.max(np.abs(ours - theirs)) < 1e-7 * np.max(np.abs(ours))


@pytest.mark.parametrize("tilt", [(0.0, 0.0, -9.81), (3.0, -2.0, -9.0)])
def test_gravity_is_left_out_of_both_engines_where_robot_toml_says_so(tmp_path, tilt):
    arm, f = ARMS["kr10"], np.linspace(4, 120, 60)
    path, q = folder(tmp_path, "kr10", 2), arm.poses(1)[0]
    text = path.read_text().replace("[0.0, 0.0, -9.81]", str(list(tilt)))
    found = []
    for said in ("", "geometric_stiffness = true\n", "geometric_stiffness = false\n"):
        path.write_text(said + text)
        truth, simulation = load_truth(path), Simulation(Robot.load(path))
        ours, theirs = truth.accelerance(q, f), simulation.accelerance(q, f)[0]
        assert np.max(np.abs(ours - theirs)) < 1e-7 * np.max(np.abs(ours))
        assert np.any(truth.gravity_stiffness(q)) == ("false" not in said)
        found.append(ours)
    np.testing.assert_array_equal(found[0], found[1])
    assert np.max(np.abs(found[2] - found[1])) > 1e-3 * np.max(np.abs(found[1]))


def test_deviations_follow_the_seed(tmp_path):
    path, q = folder(tmp_path, "kr10", 2), KR10.poses(1)[0]

    def modes(seed: int, **scatter: float) -> np.ndarray:
        return load_truth(path, Deviation(seed, **scatter)).modes(q, 5)[0]

    scatter = {"stiffness": 0.2, "damping": 0.1, "inertia": 0.05, "com_m": 0.002}
    assert np.array_equal(modes(7, **scatter), modes(7, **scatter))
    assert np.all(np.abs(modes(7, **scatter) / modes(8, **scatter) - 1) > 1e-5)
    assert np.array_equal(modes(7), modes(8))
    assert modes(0, inertia=0.04) == pytest.approx(modes(0), rel=0.1)
    assert not np.allclose(modes(0, inertia=0.04), modes(0), rtol=1e-4)


@pytest.mark.parametrize("name", sorted(ARMS))
def test_inverse_kinematics_reaches_the_placement(tmp_path, name):
    truth, known = load_truth(folder(tmp_path, name, 1)), ARMS[name]
    rng = np.random.default_rng(1)
    for q in known.poses(5):
        rotation, position, _ = truth.tcp(q)
        found = inverse.joint_angles(truth, rotation, position, q + rng.uniform(-0.2, 0.2, 6))
        assert found is not None
        again, place, _ = truth.tcp(found)
        assert np.allclose(again, rotation, atol=1e-9)
        assert np.allclose(place, position, atol=1e-9)
        assert np.all((found >= truth.lower_rad) & (found <= truth.upper_rad))
    assert inverse.joint_angles(truth, np.eye(3), np.array([9.0, 0, 1]), known.poses(1)[0]) is None


@pytest.mark.parametrize("axis", [(0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.6, 0.0, -0.8)])
def test_rotation_about_the_tool_means_what_the_planner_means(axis):
    workspace = Workspace(np.zeros(4), np.zeros(4), (), np.array(axis))
    for angle in (-0.7, 0.0, 1.2):
        ours = inverse.tool_rotation(np.array(axis), angle)
        assert np.allclose(ours, workspace.rotation(angle), atol=1e-12)
        assert np.linalg.det(ours) == pytest.approx(1)


def test_what_cannot_be_built_is_said_in_words(pendulum, monkeypatch):
    with pytest.raises(InputError, match=r"cannot be read"):
        load_truth(pendulum.with_name("nothing.toml"))
    with pytest.raises(InputError, match=r"no joint or link elbow"):
        load_truth(pendulum, Deviation(extra=(Spring("elbow", (1.0, 0, 0), 1e6, 1.0),)))
    with pytest.raises(InputError, match=r"no joint or link hose"):
        load_truth(pendulum, Deviation(added=(AttachedMass("hose", (0.0, 0, 0), 1.0),)))
    text = pendulum.read_text()
    pendulum.write_text(text.replace('tcp_frame = "tip"', 'tcp_frame = "tap"'))
    with pytest.raises(InputError, match=r"no joint or link tap"):
        load_truth(pendulum)
    pendulum.write_text(text[: text.index("[[")])
    with pytest.raises(InputError, match=r"no \[\[compliance\]\]"):
        load_truth(pendulum)
    pendulum.write_text(text)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(InputError, match=r"pip install"):
        load_truth(pendulum)


def same(one: Truth, other: Truth, q: np.ndarray) -> None:
    """Whatever an engine tells of a robot: matrices, frames, and what its links weigh."""
    for a, b in zip(one.matrices(q), other.matrices(q), strict=True):
        assert np.max(np.abs(a - b)) < 1e-7 * max(np.max(np.abs(a)), 1e-12)
    (a, parts), (b, others) = one.frames(q), other.frames(q)
    assert a == pytest.approx(b, abs=1e-9)
    assert list(parts) == list(others)
    for link, part in parts.items():
        assert part == pytest.approx(others[link], abs=1e-9)
    for a, b in zip(one.tcp(q), other.tcp(q), strict=True):
        assert a == pytest.approx(b, abs=1e-12)
    for link, pieces in one.pieces().items():
        for (m, centre, tensor), (n, middle, inertia) in zip(
            pieces, other.pieces()[link], strict=True
        ):
            assert m == n
            assert centre == pytest.approx(middle, abs=1e-9)
            assert tensor == pytest.approx(inertia, rel=1e-6, abs=1e-8)


LACKING = (
    "base_compliance", "added_mass", "rattling_part", "bridging_cable", "link_flexibility",
    "turning_spindle",
)  # fmt: skip


@pytest.mark.parametrize("name", LACKING)
def test_both_engines_are_one_robot_whatever_it_lacks(tmp_path, name):
    arm, rng = in_a_cell("irb6640"), np.random.default_rng(2)
    path, plain = arm.write(tmp_path), InjectedFaults(replace(SCATTER, seed=4))
    scene = Scene(arm, load_truth(path), 1, arm.poses(2), 1e3, plain, rng)
    deviation = drawn(name, replace(scene, injected=imperfect(scene)[0])).injected.deviation
    one, other = (load_truth(path, deviation, engine) for engine in ("mujoco", "tree"))
    same(one, other, scene.poses[1])
    same(one.loaded("spindle", 1.4), other.loaded("spindle", 1.4), scene.poses[1])


def test_both_engines_split_a_link_and_shift_a_base_alike(tmp_path):
    path = ARMS["kr10"].write(tmp_path, 3)
    springs = (
        Spring("link_2", (0.0, 0.0, 1.0), 1e5, 10.0),
        Spring("base", (0.0, 1.0, 0.0), 1e7, 1.0, slide=True),
    )
    both = (load_truth(path, Deviation(7, inertia=0.05, extra=springs), e)
            for e in ("mujoco", "tree"))  # fmt: skip
    same(*both, ARMS["kr10"].poses(1)[0])


@pytest.mark.parametrize("seed", range(3))
def test_robots_drawn_at_random_stand_and_have_modes_in_the_band(tmp_path, seed):
    per_joint, rng = 1 + 2 * (seed % 2), np.random.default_rng(seed)
    arm = draw_arm(rng, tmp_path, per_joint)
    one, other = (load_truth(tmp_path / "robot.toml", engine=e) for e in ("mujoco", "tree"))
    assert arm.name.split("-")[0] in LAYOUTS
    assert len(one.springs) == per_joint * len(arm.joints)
    for q in standing(rng, arm, one, 3):
        same(one, other, q)
        frequency, damping, _ = one.modes(q, 3)
        assert 3 < frequency[0] < 20
        assert frequency[-1] < BAND_HZ[1]
        assert np.all((damping > 0.002) & (damping < 0.2))


@pytest.mark.slow
def test_a_case_of_a_robot_drawn_at_random_is_whole_and_the_same_again(tmp_path, monkeypatch):
    monkeypatch.setattr(cases, "POSES", 2)
    monkeypatch.setattr(cases, "PREDICTED", 1)
    one, two = (make_case("sensor_gain", RANDOM, 7, tmp_path / name) for name in "ab")
    assert [c.effect for c in one.concealed] == ["sensor_gain"]
    assert one.held_out == two.held_out
    folders = [tmp_path / name / "recordings" for name in "ab"]
    tables = [(folder / "recordings.csv").read_bytes() for folder in folders]
    assert tables[0] == tables[1]
    files = list((folders[0] / "data").glob("*.uff"))
    assert len(files) == tables[0].count(b"\n") - 1
