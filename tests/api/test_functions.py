"""What scripts call, on hits of a small arm: the same as the commands say, and typed."""

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest

from planner import Dataset, Frf, Hit, Robot, analyse, diagnose, identify
from planner.cli.run import run
from planner.diagnosis import linear_diagnosis
from planner.diagnosis.effects import library
from planner.errors import InputError, RefusedError
from planner.modal.modes import ModalModel
from planner.recording.hits import hits_from
from planner.recording.read import read
from planner.report.diagnosis import DiagnosisReport
from planner.report.plot_files import Pictures
from planner.truth.hits import record_poses
from tests.support.outside import HAMMER, make_cell


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


def test_identify_says_what_the_command_says_and_more(recorded, dataset, capsys):
    folder, robot_toml, robot = recorded
    found = identify(dataset, robot)
    command = ["identify", str(folder), "--robot", str(robot_toml), "--json"]
    assert run(command) == 0
    told = json.loads(capsys.readouterr().out)
    mine = json.loads(json.dumps(found.to_json()))
    assert list(mine) == list(told)
    assert mine | {"seconds": 0} == told | {"seconds": 0}
    assert found.parameters[0].stiffness == told["parameters"][0]["stiffness"]
    h = found.simulation.accelerance(dataset.q[:1], np.array([5.0, 10.0]))
    assert h.shape == (1, 3, 3, 2)
    assert found.with_pictures(Pictures()) is found


@pytest.fixture(scope="module")
def diagnosed(dataset, recorded):
    """With a single effect in the library: what all of them find is tested elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        few = [e for e in library(recorded_simulation(recorded)) if e.name == "base_compliance"]
        patch.setattr(linear_diagnosis, "library", lambda simulation, sensors: few[:1])
        offered = {"there": dataset.q[0] + 0.1}
        return diagnose(dataset, recorded[2], offered=offered)


def recorded_simulation(recorded):
    from planner import Simulation

    return Simulation(recorded[2])


def test_a_diagnosis_is_typed_predicts_and_travels_without_its_fits(diagnosed, dataset):
    assert isinstance(diagnosed, DiagnosisReport)
    assert diagnosed.verdict in ("consistent", "explained", "unexplained")
    assert sum(c.probability for c in diagnosed.candidates) == pytest.approx(1.0)
    assert diagnosed.simulated
    mean, sd = diagnosed.predict(dataset.q[:2], np.array([5.0, 10.0, 15.0]))
    assert mean.shape == sd.shape == (2, 3, 3, 3)
    assert np.iscomplexobj(mean)
    assert (sd >= 0).all()
    light = pickle.loads(pickle.dumps(replace(diagnosed, explained=None)))
    assert light.to_json() == diagnosed.to_json()
    assert "explained" not in diagnosed.to_json()


def test_json_of_a_diagnosis_has_what_the_contract_names(diagnosed):
    told = json.loads(json.dumps(diagnosed.to_json()))
    assert {"verdict", "findings", "candidates", "where", "fit", "held_out", "npz"} <= set(told)
    assert {"effect", "at", "probability", "effects"} == set(told["candidates"][0])
    assert {"bands_hz", "poses", "directions"} == set(told["where"])
    assert {"nominal", "refitted", "explained"} == set(told["fit"])
    assert {"poses", "nominal", "refitted", "explained"} == set(told["held_out"])
    assert {"frac", "frobenius"} == set(told["fit"]["nominal"])
