"""The shipped campaign: poses of Table A1, recordings that can be made again."""

import csv
import json

import numpy as np
import pytest
import pyuff

from planner.demo import shipped
from planner.proof.hits import Hammer, simulate_hit
from planner.proof.load import load_truth
from planner.robot.collision import Collisions
from planner.robot.robot import Robot
from planner.studies.kr240_plane import regenerate

FOLDER = shipped("kr240_plane")
# Table A1 of Busch et al. 2022, whose 35 positions are the whole grid.
X_M, Y_M = (0.95, 1.175, 1.4, 1.625, 1.85), (-0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)


@pytest.fixture(scope="module")
def nominal():
    return load_truth(FOLDER / "robot" / "robot.toml")


@pytest.fixture(scope="module")
def rows():
    with open(FOLDER / "recordings" / "recordings.csv", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def poses(rows):
    joints = [k for k in rows[0] if k.endswith("_deg")]
    return {r["pose"]: np.deg2rad([float(r[k]) for k in joints]) for r in rows}


@pytest.fixture(scope="module")
def true():
    return json.loads((FOLDER / "truth.json").read_text())["poses"]


def test_every_pose_of_the_table_is_there_and_can_be_stood_at(nominal, poses):
    robot = Robot.load(FOLDER / "robot" / "robot.toml")
    collisions = Collisions(robot)
    assert sorted(poses) == [f"A{i}{j}" for i in range(1, 6) for j in range(1, 8)]
    rotations = []
    for name, q in poses.items():
        i, j = int(name[1]) - 1, int(name[2]) - 1
        rotation, position, _ = nominal.tcp(q)
        assert position == pytest.approx([X_M[i], Y_M[j], 1.24], abs=1e-3)  # readback of ± 0.01°
        assert rotation[:, 2] == pytest.approx([0, 0, -1], abs=2e-3)
        rotations.append(rotation)
        assert collisions.limits(q) == ()
        assert collisions.contacts(q) == ()
        assert q[4] < 0  # one branch of the wrist
        assert q[2] > 0  # and of the elbow
    assert np.ptp(rotations, axis=0).max() < 2e-3


def test_recordings_are_complete_small_and_labelled_as_simulated(rows):
    hits = {(r["pose"], r["hit"], r["repeat"]) for r in rows}
    assert len(hits) == len(rows) == 35 * 3 * 4
    files = [FOLDER / "recordings" / r["file"] for r in rows]
    for file in files:
        assert b"SIMULATED" in file.read_bytes()[:300]
    everything = [p for p in FOLDER.rglob("*") if p.is_file()]
    assert sum(p.stat().st_size for p in everything) < 25e6
    assert len([p for p in everything if p.suffix == ".uff"]) == len(files)
    notes = (FOLDER / "NOTES.md").read_text()
    assert "SIMULATED" in notes
    assert "Table A1" in notes
    assert "SIMULATED" in json.loads((FOLDER / "truth.json").read_text())["note"]


def test_the_script_makes_these_recordings(rows, poses, true):
    truth = load_truth(FOLDER / "robot" / "robot.toml", regenerate.DEVIATION)
    for number, (name, q) in enumerate(poses.items()):
        frequency, damping, _ = truth.modes(q, 4)
        # truth.json is for the setpoint, which the readback misses by up to 0.01°.
        assert frequency == pytest.approx(true[name]["frequency_hz"], rel=1e-3)
        assert damping == pytest.approx(true[name]["damping_ratio"], rel=1e-2)
        if number % 12:
            continue
        rng = np.random.default_rng([regenerate.SEED, number])
        rng.uniform(-1, 1, 6)  # the readback's scatter
        hit = simulate_hit(truth, q, "+x", Hammer(), rng)
        row = next(r for r in rows if r["pose"] == name)
        sets = pyuff.UFF(str(FOLDER / "recordings" / row["file"])).read_sets()
        stored = np.array([s["data"] for s in sets])
        assert stored[0] == pytest.approx(hit.force_n, abs=1e-6 * np.max(stored[0]))
        largest = np.max(np.abs(stored[1:]))
        assert np.max(np.abs(stored[1:] - hit.acceleration_m_s2)) < 1e-6 * largest


def test_the_script_finds_these_poses(nominal, poses):
    found = regenerate.joint_angles(nominal)
    assert list(found) == list(poses)
    for name, q in found.items():
        assert np.max(np.abs(np.rad2deg(q - poses[name]))) < 0.0101
