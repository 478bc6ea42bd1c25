"""Concealed cases: readable by outsiders, sealed, repeatable, solvable, and telling nothing.

Those of real cells: imperfections are small, and every effect can have any size.
`pytest -m slow tests/proof/test_cases.py` draws the other effects and makes all kinds.
"""

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planner.errors import InputError
from planner.proof import cases
from planner.proof.arms import ARMS, in_a_cell
from planner.proof.cases import SCATTER, ConcealedCase, make_case
from planner.proof.detectability import without_effect
from planner.proof.deviation import Deviation, ScaledJoint, StiffnessRipple
from planner.proof.fault_injection import InjectedFaults
from planner.proof.imperfections import imperfect
from planner.proof.laws import HarmonicDrive
from planner.proof.load import load_truth
from planner.proof.nonlinear import HitPose, respond
from planner.proof.scene import Scene
from planner.proof.table import DRIVES, KINDS, TABLE, drawn
from planner.recording.folder import read_poses, read_recordings
from planner.recording.read import read
from planner.robot.robot import Robot

PLACES = {
    "joint_stiffness": "joint_", "transverse_compliance": "joint_", "friction": "joint_",
    "nonlinear_stiffness": "joint_", "backlash": "joint_", "angle_dependent_stiffness": "joint_",
    "base_compliance": "base", "link_flexibility": "link_", "added_mass": "link_",
    "local_resonator": "link_", "drift": "campaign",
    "sensor_rotation": "sensor", "channel_delay": "sensor", "exponential_window": "sensor",
    "sensor_gain": "sensor_", "polarity": "sensor_",
}  # fmt: skip
STEP_S, N = 1 / 3200, 240
EXACTLY = np.eye(6)  # wrenches of hits exactly along an axis of the tcp, and at it


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("one")


@pytest.fixture(scope="module")
def few_poses():
    """Cases of two measured poses and one that is asked for: nothing hangs on how many."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cases, "POSES", 2)
        patch.setattr(cases, "PREDICTED", 1)
        yield


@pytest.fixture(scope="module")
def case(few_poses, folder) -> ConcealedCase:
    return make_case("friction", "kr210", 2, folder)


def test_every_effect_can_be_concealed(tmp_path):
    arm = ARMS["kr210"]
    plain, rng = InjectedFaults(Deviation()), np.random.default_rng(0)
    scene = Scene(arm, load_truth(arm.write(tmp_path)), 1, arm.poses(4), 1000.0, plain, rng)
    for name in TABLE:
        for seed in range(5):
            one = drawn(name, replace(scene, rng=np.random.default_rng(seed)))
            load_truth(tmp_path / "robot.toml", one.injected.deviation)  # its places exist
            if name in PLACES:
                assert one.effect == name
                assert one.at is not None
                assert one.at.startswith(PLACES[name])
            else:
                assert (one.effect, one.at) == ("unknown", None)
            json.dumps(one.parameters)
    assert PLACES.keys() <= TABLE.keys()


@pytest.mark.parametrize("law", ["backlash", "nonlinear_stiffness"])
def test_a_law_leaves_stiffness_in_a_joint_that_an_earlier_effect_made_soft(law, tmp_path):
    arm = ARMS["kr210"]
    path = arm.write(tmp_path)
    joints = [f"joint_{n}" for n in range(1, 7)]
    soft = Deviation(
        scaled=tuple(ScaledJoint(j, 0.4) for j in joints),
        harmonics=tuple(StiffnessRipple(j, 1, 0.3, 0.4) for j in joints),
    )
    for seed in range(20):
        rng, truth = np.random.default_rng(seed), load_truth(path)
        scene = Scene(arm, truth, 1, arm.poses(2), 1000.0, InjectedFaults(soft), rng)
        one = drawn(law, scene)
        at_rest: Any = one.injected.ports[0].law
        taken = abs(at_rest.stiffness) * (2 if isinstance(at_rest, HarmonicDrive) else 1)
        if law == "nonlinear_stiffness" and float(at_rest.at(np.array(1.0))) > 0:
            continue  # it hardens
        # 0.4 of the stated stiffness, and half of that where the harmonic is at its least.
        assert taken < 0.2 * scene.stiffness(str(one.at))


def test_the_folder_has_what_a_diagnosis_needs(case, folder):
    robot, recordings = Robot.load(folder / "robot" / "robot.toml"), folder / "recordings"
    rows = read_recordings(recordings, robot.joint_names)
    first = {row.pose for row in rows}
    assert len(first) == 2
    assert len(rows) in (18, 27)
    assert len(read_poses(recordings / "predict.csv", robot.joint_names)) == 1
    for pose in first:
        assert {str(row.hit)[1] for row in rows if row.pose == pose} == {"x", "y", "z"}
    with open(recordings / "recordings.csv", encoding="utf-8") as file:
        peaks = [
            float(np.max(np.abs(read(recordings / row["file"])[0].channels[0].samples)))
            for row in list(csv.DictReader(file))[:9]
        ]
    assert max(peaks) / min(peaks) > 3  # force levels


def test_a_case_says_what_it_should_and_hides_the_rest(case, folder):
    [effect] = case.concealed
    assert effect.effect == "friction"
    assert effect.parameters["law"] in ("Friction", "BoucWen", "Iwan", "LuGre")
    assert 0.03 <= effect.size <= 1
    assert ("drift", "campaign") in case.imperfections
    text = b"".join(p.read_bytes() for p in folder.rglob("*") if p.is_file())
    for word in (b"friction", b"rumble", b"nats", b"seed", b"MuJoCo"):
        assert word not in text
    assert "answer" not in "".join(str(p) for p in folder.rglob("*"))


def test_held_out_truth_is_that_of_its_robot(case, folder):
    real, imaginary = np.array(case.held_out["frf"])
    f = np.array(case.held_out["frequency_hz"])
    assert real.shape == imaginary.shape == (1, 3, 3, len(f))
    robot_toml = folder / "robot" / "robot.toml"
    names = Robot.load(robot_toml).joint_names
    (pose,) = read_poses(folder / "recordings" / "predict.csv", names)
    expected = load_truth(robot_toml).accelerance(np.deg2rad(pose.joints_deg), f)
    # Scatter of ± 15 % moves the peaks, so only sizes can be alike.
    ratio = np.linalg.norm(real[0] + 1j * imaginary[0], axis=2) / np.linalg.norm(expected, axis=2)
    assert np.all((np.diag(ratio) > 0.5) & (np.diag(ratio) < 2))


@pytest.mark.slow
@pytest.mark.parametrize("robot", sorted(ARMS))
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_every_robot(tmp_path, kind, robot):
    effects = make_case(kind, robot, 11, tmp_path).concealed
    least, most = {"null": (0, 0), "pair": (2, 2), "drives": DRIVES}.get(kind, (1, 1))
    assert least <= len(effects) <= most


def test_an_unknown_kind_is_said_in_words(tmp_path):
    with pytest.raises(InputError, match="kinds are null"):
        make_case("gremlins", "kr210", 0, tmp_path)


def scene_of(robot: str, folder):
    """A scene with an imperfect robot, and where its robot.toml is."""
    arm, rng = in_a_cell(robot), np.random.default_rng(1)
    path, plain = arm.write(folder), InjectedFaults(replace(SCATTER, seed=1))
    truth = load_truth(path, plain.deviation)
    scene = Scene(arm, truth, 1, arm.poses(3), arm.peak_n, plain, rng)
    injected, _ = imperfect(scene)
    return replace(scene, truth=load_truth(path, injected.deviation), injected=injected), path


def drawn_in(scene: Scene, name: str, size: float = 1.0, seed: int = 3):
    """An effect of some size beside what is concealed in a scene."""
    return drawn(name, replace(scene, size=size, rng=np.random.default_rng(seed)))


def heard(scene: Scene, injected: InjectedFaults, path, progress: float = 1.0) -> np.ndarray:
    """(3, 3, n): how three hits move the sensor at first, as speeds in m/s."""
    truth = injected.at(load_truth(path, injected.deviation), progress)
    t = np.arange(N) * STEP_S
    force = scene.peak_n * np.sin(np.pi * np.clip(t / 0.008, 0, 1)) ** 2
    pose = HitPose(truth, scene.poses[0], np.tile(force, (3, 1)), EXACTLY[[0, 1, 2]])
    return STEP_S * np.cumsum(respond([pose], injected.ports, STEP_S)[0], axis=2)


@pytest.mark.parametrize("robot", sorted(ARMS))
def test_imperfections_are_everywhere_and_small(robot, tmp_path):
    scene, path = scene_of(robot, tmp_path)
    injected = scene.injected
    assert {port.joint for port in injected.ports} == {f"joint_{n}" for n in range(1, 7)}
    plain = replace(injected.deviation, beams=(), compensators=(), harmonics=(), extra=())
    ours = scene.truth.modes(scene.poses[0], 2)[0]
    without = load_truth(path, plain).modes(scene.poses[0], 2)[0]
    change = np.abs(ours / without - 1)
    assert 0 < np.max(change) < 0.08
    assert np.all(scene.truth.poles(scene.poses[0])[0].real < 0)


CHANNELS = (
    "sensor_rotation", "sensor_gain", "polarity", "channel_delay", "exponential_window",
    "tonal_disturbance",
)  # fmt: skip
QUICK = *CHANNELS, "added_mass", "base_compliance", "friction", "drift", "rattling_part"


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in TABLE]
)
def test_every_effect_does_something_and_goes_with_its_size(name, tmp_path):
    scene, path = scene_of("kr210", tmp_path)
    injected = scene.injected
    if name in CHANNELS:
        small, large = (drawn_in(scene, name, size).injected for size in (0.01, 1.0))
        assert small != injected
        assert small != large or name == "polarity"
        return
    plain = heard(scene, injected, path)
    changes = []
    for size in (0.01, 1.0):
        one = drawn_in(scene, name, size)
        json.dumps(one.parameters)
        changes.append(np.linalg.norm(heard(scene, one.injected, path) - plain))
        left = without_effect(one.injected, injected, one.injected)
        assert np.linalg.norm(heard(scene, left, path) - plain) < 1e-6 * changes[0]
    assert 0 < changes[0] < 0.2 * changes[1]
    assert changes[0] < 0.15 * np.linalg.norm(plain)  # a base's long lever is the most


def test_what_changes_with_time_is_what_gives_or_what_is_carried(tmp_path):
    """A joint that grows softer, or another tool: half-way through both differ from before."""
    scene, path = scene_of("kr210", tmp_path)
    injected = scene.injected
    drifts = [drawn_in(scene, "drift", seed=n) for n in range(12)]
    assert {(d.effect, d.at) for d in drifts} == {("drift", "campaign")}
    tools = [d for d in drifts if d.injected.load is not None]
    assert 0 < len(tools) < len(drifts)
    assert all("load_factor" in d.parameters for d in tools)
    for one in (tools[0], next(d for d in drifts if d.injected.load is None)):
        early, late = (heard(scene, one.injected, path, progress) for progress in (0.0, 1.0))
        assert np.linalg.norm(late - early) > 1e-4 * np.linalg.norm(early)
    [without] = {without_effect(d.injected, injected, d.injected).load for d in tools}
    assert without is None
