"""The public command on a case from the other engine: pytest -m slow tests/diagnose -s"""

import json

import numpy as np
import pytest

from planner.cli.run import run
from planner.dynamics.simulation import Simulation
from planner.robot.robot import Robot
from planner.truth.cases import make_case

pytestmark = pytest.mark.slow


def test_found_effect_is_written_read_back_and_predicts(tmp_path, capsys):
    case = make_case("added_mass", "kr210", 5, tmp_path / "case")
    command = ["diagnose", str(case.recordings), "--robot", str(case.robot_toml), "--json"]
    command += ["--predict", str(case.recordings / "predict.csv"), "--out", str(tmp_path / "out")]
    assert run(command) in (0, 3)
    answer = json.loads(capsys.readouterr().out)
    true = json.loads(case.answer)["effects"][0]
    assert answer["verdict"] == "explained"
    assert (answer["findings"][0]["effect"], answer["findings"][0]["at"]) == (
        true["effect"],
        true["at"],
    )
    assert sum(c["probability"] for c in answer["candidates"]) == pytest.approx(1.0)
    assert answer["held_out"]["explained"]["frac"] > answer["held_out"]["refitted"]["frac"]
    robot = Robot.load(tmp_path / "out" / "robot.toml")
    assert robot.config.effects[0].effect == "added_mass"
    with np.load(answer["npz"]) as file:
        q = np.deg2rad(file["joints_deg"])
        h = Simulation(robot).accelerance(q, file["frequency_hz"])
        assert np.linalg.norm(h - file["frf_mean"]) < 0.01 * np.linalg.norm(h)
    assert all((tmp_path / "out" / name).is_file() for name in ("residuals.png", "robot.urdf"))


def test_the_shipped_campaign_names_what_its_simulation_lacks(tmp_path, capsys):
    folder = tmp_path / "campaign"
    assert run(["demo", "--dir", str(folder), "--measurements", "4", "--json"]) == 0
    capsys.readouterr()
    assert run(["diagnose", str(folder), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    finding = answer["findings"][0]
    assert (finding["effect"], finding["at"]) == ("base_compliance", "base")
    # Of the truth that made the shipped recordings; see campaigns/.
    for axis, true in (("x", 2.2e7), ("y", 1.9e7)):
        told = finding["parameters"][f"stiffness of base about {axis}"]
        assert abs(told["value"] - true) < 3 * told["sd"]
    assert answer["simulated"]
    assert answer["next"] is None  # nothing is tied


def test_a_nonlinear_joint_beside_a_linear_effect(tmp_path, capsys):
    """Seed 6001 was looked at while this was developed."""
    case = make_case("pair", "kr10", 6001, tmp_path / "case")
    command = ["diagnose", str(case.recordings), "--robot", str(case.robot_toml), "--json"]
    assert run(command) in (0, 3)
    answer = json.loads(capsys.readouterr().out)
    true = {(e["effect"], e["at"]) for e in json.loads(case.answer)["effects"]}
    assert {kind for kind, _ in true} == {"local_resonator", "nonlinear_stiffness"}
    assert {(f["effect"], f["at"]) for f in answer["findings"]} == true
    first = answer["candidates"][0]
    assert {(e["effect"], e["at"]) for e in first["effects"]} == true
