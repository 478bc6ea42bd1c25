"""Diagnoses of small cells from the other engine: what they say, and in which form.

`pytest -m slow tests/diagnosis/test_diagnose.py` conceals all effects one after the other, and lets
all rounds look for what nothing describes.
"""

import json
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planner import Dataset, Robot, diagnose
from planner.proof.deviation import Deviation
from planner.proof.load import load_truth
from planner.proof.measurement_errors import EVERYDAY, LABORATORY
from tests.support import small_cases as cases
from tests.support.outside import call, told
from tests.support.small_cases import CONCEALED, SCATTER, SmallCase, small_case

# The others have tests of their own; a gain is concealed beside a soft base, too.
NAMES = [n for n in CONCEALED if n not in ("nothing", "outsider", "soft base", "gain", "window")]
QUICK = ("drift",)  # of the campaign; of the robot "soft base", of its sensor "window" are below


def diagnosed(case: SmallCase, *options: object) -> dict[str, Any]:
    """The answer of a command that ends with exit code 0, in the form that was promised."""
    answer = told("diagnose", case.recordings, "--robot", case.robot_toml, *options)
    assert set(answer) >= {
        "verdict", "findings", "candidates", "sets", "where", "fit", "held_out", "npz", "shares",
        "remarks", "refused", "simulated", "next", "next_sensor", "robot", "plots", "seconds",
    }  # fmt: skip
    for finding in answer["findings"]:
        assert set(finding) == {
            "effect", "at", "probability", "change_percent", "parameters", "text",
        }  # fmt: skip
        for parameter in finding["parameters"].values():
            assert set(parameter) == {"value", "sd", "unit"}
        assert len(finding["text"].split()) > 8
    assert all(set(c) == {"effect", "at", "probability", "effects"} for c in answer["candidates"])
    shares = [c["probability"] for c in answer["candidates"]]
    assert shares == sorted(shares, reverse=True)
    assert sum(shares) == pytest.approx(1.0)
    assert ("unknown", None) in [(c["effect"], c["at"]) for c in answer["candidates"]]
    where = answer["where"]
    assert all(low < high for low, high in where["bands_hz"])
    assert set(where["poses"]) <= {f"P{i + 1}" for i in range(cases.POSES)}
    assert set(where["directions"]) <= set("xyz")
    assert set(answer["shares"]) == {"stated", "refitted", "explained", "left"}
    for agreement in (answer["fit"], answer["held_out"]):
        for stage in ("nominal", "refitted", "explained"):
            assert set(agreement[stage]) == {"frac", "frobenius"}
    assert len(answer["held_out"]["poses"]) == 1
    return answer


def places(answer: dict[str, Any]) -> set[tuple[str, str]]:
    """What was found, and where."""
    return {(f["effect"], f["at"]) for f in answer["findings"]}


@pytest.mark.parametrize(
    "errors", [pytest.param(LABORATORY, marks=pytest.mark.slow), EVERYDAY], ids=["exact", "usual"]
)
def test_where_nothing_is_concealed_nothing_is_found(tmp_path, errors):
    answer = diagnosed(small_case(tmp_path, CONCEALED["nothing"], errors))
    assert answer["verdict"] == "consistent"
    assert answer["findings"] == []
    assert answer["candidates"][0]["effect"] == "none"
    assert answer["held_out"]["refitted"]["frac"] > 0.99
    assert answer["npz"] is None
    assert answer["next"] is None


TRUE = {
    "soft base": {f"stiffness of base about {a}": k for a, k in cases.BASE.items()},
    "window": {"time_constant": cases.WINDOW_S},
    "base and gain": {
        **{f"stiffness of base about {a}": k for a, k in cases.BASE.items()},
        "gain": cases.GAIN,
    },
    "added mass": {"mass": cases.MASS_KG},
    "hose": {"frequency": cases.HOSE_HZ, "mass": cases.HOSE_KG},
}


def assert_named_and_sized(answer: dict[str, Any], name: str) -> None:
    there = set(CONCEALED[name].places)
    assert answer["verdict"] == "explained"
    assert places(answer) == there
    leader = {(e["effect"], e["at"]) for e in answer["candidates"][0]["effects"]}
    assert leader == there
    assert answer["held_out"]["explained"]["frac"] > 0.99
    assert answer["shares"]["left"] < answer["shares"]["refitted"]
    found = {n: v for f in answer["findings"] for n, v in f["parameters"].items()}
    for parameter, true in TRUE.get(name, {}).items():
        value = found[parameter]
        assert value["value"] == pytest.approx(true, abs=4 * value["sd"], rel=0.05)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in NAMES]
)
def test_what_is_concealed_is_named_and_sized(tmp_path, name):
    assert_named_and_sized(diagnosed(small_case(tmp_path, CONCEALED[name])), name)


def test_what_no_effect_describes_is_unexplained(tmp_path):
    answer = diagnosed(small_case(tmp_path, CONCEALED["outsider"]))
    assert answer["verdict"] == "unexplained"
    assert answer["candidates"][0]["effect"] == "unknown"
    assert answer["findings"] == []
    assert answer["where"]["bands_hz"]


@pytest.mark.slow
def test_the_robot_that_is_written_is_read_back_and_predicts(tmp_path):
    of = CONCEALED["soft base"]
    case, out = small_case(tmp_path, of, EVERYDAY), tmp_path / "found"
    answer = diagnosed(case, "--predict", case.predict_csv, "--out", out)
    assert_named_and_sized(answer, "soft base")
    with np.load(answer["npz"]) as file:
        lines, mean = file["frequency_hz"], file["frf_mean"]
        assert mean.shape == file["frf_sd"].shape == (1, 3, 3, lines.size)
        q = np.deg2rad(file["joints_deg"])[0]
    deviation: Deviation = replace(SCATTER, **of.change)
    true = load_truth(case.robot_toml, deviation).accelerance(q, lines)
    assert np.linalg.norm(mean[0] - true) < 0.05 * np.linalg.norm(true)
    assert all(Path(plot).is_file() for plot in answer["plots"])
    assert json.loads((out / "diagnosis.json").read_text())["verdict"] == "explained"
    assert told("check", answer["robot"])["ok"]
    again = told("diagnose", case.recordings, "--robot", answer["robot"])
    assert again["verdict"] == "consistent"
    assert again["fit"]["nominal"]["frac"] == pytest.approx(answer["written"]["frac"], abs=1e-3)
    assert answer["written"]["frac"] > 0.99
    code, _, err = call("diagnose", case.recordings, "--robot", answer["robot"], "--out", out)
    assert code == 2
    assert "holds the robot that was given" in err


def test_the_function_says_what_the_command_says(tmp_path):
    case = small_case(tmp_path, CONCEALED["window"])
    robot = Robot.load(case.robot_toml)
    dataset = Dataset.read(case.recordings, robot, robot.config.band_hz)
    found = diagnose(dataset, robot, offered={"there": dataset.q[0] + 0.1})
    answer = diagnosed(case)
    assert_named_and_sized(answer, "window")
    mine = json.loads(json.dumps(found.to_json()))
    assert mine | {"seconds": 0} == answer | {"seconds": 0}
    mean, sd = found.predict(dataset.q[:2], np.array([5.0, 10.0, 15.0]))
    assert mean.shape == sd.shape == (2, 3, 3, 3)
    assert np.iscomplexobj(mean)
    assert (sd > 0).all()
    light = pickle.loads(pickle.dumps(replace(found, diagnosis=None)))
    assert light.to_json() == found.to_json()
    assert "diagnosis" not in found.to_json()
