"""What scripts call, on hits of a small arm: the same as the commands say, and typed."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from planner import Dataset, Frf, Hit, Robot, analyse, identify
from planner.errors import InputError, RefusedError
from planner.modal.modes import ModalModel
from planner.proof.recordings import record_poses
from planner.recording.hits import hits_from
from planner.recording.read import read
from planner.report.pictures import Pictures
from tests.support.outside import HAMMER, make_cell, told


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    root = tmp_path_factory.mktemp("arm")
    robot_toml, _, truth = make_cell(root)
    robot = Robot.load(robot_toml)
    rng = np.random.default_rng(5)
    middle, reach = (robot.lower_rad + robot.upper_rad) / 2, robot.upper_rad - robot.lower_rad
    q = middle + 0.3 * reach * rng.uniform(-0.5, 0.5, (3, len(middle)))
    poses = [(f"P{i}", row) for i, row in enumerate(q)]
    folder = record_poses(truth, poses, root / "hits", repeats=2, hammer=HAMMER, seed=1)
    return folder, robot_toml, robot


@pytest.fixture(scope="module")
def dataset(recorded):
    folder, _, robot = recorded
    return Dataset.read(folder, robot)


def test_a_data_set_says_what_it_holds(recorded, dataset):
    folder, _, robot = recorded
    assert repr(dataset).startswith("Dataset(3 poses, 3 visits, ")
    assert Dataset.read(str(folder), robot).poses == dataset.poses
    assert all(isinstance(hit, Hit) for visit in dataset.visits for hit in visit.hits)
    assert isinstance(dataset.frfs[0], Frf)


def test_hits_files_frf_and_a_pose_of_a_data_set_give_the_same_modes(recorded, dataset):
    folder, _, robot = recorded
    band = robot.config.band_hz
    files = sorted((folder / "data").glob("P1_*"))
    hits = [hit for file in files for hit in hits_from(read(file))]
    by_files = analyse(files, band_hz=band)
    assert isinstance(by_files, ModalModel)
    assert by_files.modes
    frf = dataset.frfs[dataset.poses.index("P1")]
    for other in (
        analyse(hits, band_hz=band),
        analyse(dataset, pose="P1"),
        analyse(frf, band_hz=band),
    ):
        found = [mode.frequency_hz for mode in other.modes]
        np.testing.assert_allclose(found, [m.frequency_hz for m in by_files.modes], rtol=1e-6)


def test_what_cannot_be_analysed_is_said(recorded, dataset, tmp_path):
    with pytest.raises(InputError, match="P9"):
        analyse(dataset, pose="P9")
    with pytest.raises(InputError, match="several"):
        analyse(dataset.frfs[0], pose="P1")
    with pytest.raises(InputError, match="does not exist"):
        analyse(tmp_path / "none.uff")
    with pytest.raises(InputError, match="h1, h2 or hv"):
        analyse(dataset.frfs[0], estimator="h3")
    with pytest.raises(InputError, match="nothing"):
        analyse([])
    (tmp_path / "torn.uff").write_bytes(b"    -1\n    58\n")
    with pytest.raises(RefusedError, match="No modes"):
        analyse(tmp_path / "torn.uff")


def test_identify_says_what_the_command_says_and_more(recorded, dataset):
    folder, robot_toml, robot = recorded
    found = identify(dataset, robot)
    answer = told("identify", folder, "--robot", robot_toml)
    mine = json.loads(json.dumps(found.to_json()))
    assert list(mine) == list(answer)
    assert mine | {"seconds": 0} == answer | {"seconds": 0}
    assert found.parameters[0].stiffness == answer["parameters"][0]["stiffness"]
    h = found.simulation.accelerance(dataset.q[:1], np.array([5.0, 10.0]))
    assert h.shape == (1, 3, 3, 2)
    assert found.with_pictures(Pictures()) is found


ROOT = Path(__file__).parents[2]


def test_types_hold():
    command = (
        sys.executable, "-m", "pyrefly", "check", "--python-interpreter-path", sys.executable,
        "--config", str(ROOT / "pyproject.toml"), "--min-severity", "error",
    )  # fmt: skip
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
