"""Concealed cases: readable by outsiders, sealed, repeatable, solvable, and telling nothing."""

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planner.errors import InputError
from planner.proof import cases
from planner.proof.arms import ARMS
from planner.proof.cases import ConcealedCase, make_case
from planner.proof.deviation import Deviation, ScaledJoint, StiffnessRipple
from planner.proof.fault_injection import InjectedFaults
from planner.proof.laws import HarmonicDrive
from planner.proof.load import load_truth
from planner.proof.measurement_errors import LABORATORY
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


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("one")


@pytest.fixture(scope="module")
def case(folder) -> ConcealedCase:
    return make_case("added_mass", "kr210", 3, folder, LABORATORY)


@pytest.fixture
def few_poses(monkeypatch):
    """Cases of two measured poses, where nothing hangs on how many there are."""
    monkeypatch.setattr(cases, "POSES", 2)


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
    assert len(first) == 9
    assert len(rows) in (81, 90)
    assert len(read_poses(recordings / "predict.csv", robot.joint_names)) == 4
    for pose in first:
        assert {str(row.hit)[1] for row in rows if row.pose == pose} == {"x", "y", "z"}
    with open(recordings / "recordings.csv", encoding="utf-8") as file:
        peaks = [
            float(np.max(np.abs(read(recordings / row["file"])[0].channels[0].samples)))
            for row in list(csv.DictReader(file))[:9]
        ]
    assert max(peaks) / min(peaks) > 3  # force levels


def test_nothing_in_the_folder_tells_the_answer(case, folder):
    text = b"".join(p.read_bytes() for p in folder.rglob("*") if p.is_file())
    for word in (b"added_mass", b"mass_kg", b"seed", b"MuJoCo"):
        assert word not in text
    assert "answer" not in "".join(str(p) for p in folder.rglob("*"))


def test_held_out_truth_is_that_of_its_robot(few_poses, tmp_path):
    case = make_case("null", "kr210", 5, tmp_path)
    assert list(case.concealed) == []
    real, imaginary = np.array(case.held_out["frf"])
    assert real.shape == imaginary.shape == (4, 3, 3, len(case.held_out["frequency_hz"]))
    robot_toml = tmp_path / "robot" / "robot.toml"
    robot = Robot.load(robot_toml)
    poses = read_poses(tmp_path / "recordings" / "predict.csv", robot.joint_names)
    nominal = load_truth(robot_toml)
    for pose, H in zip(poses, real + 1j * imaginary, strict=True):
        f = np.array(case.held_out["frequency_hz"])
        expected = nominal.accelerance(np.deg2rad(pose.joints_deg), f)
        # Scatter of ± 15 % moves the peaks, so only sizes can be alike.
        ratio = np.linalg.norm(H, axis=2) / np.linalg.norm(expected, axis=2)
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
