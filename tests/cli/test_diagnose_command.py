"""The command's diagnosis of small cases from the other engine: what it says, and in which form."""

import numpy as np
import pytest

from planner.truth.deviation import Spring
from planner.truth.handling import EVERYDAY, LABORATORY
from planner.truth.load import load_truth
from planner.truth.secret import Artefact
from tests.support.known_robots import KR10
from tests.support.outside import told
from tests.support.small_cases import SmallCase, small_case, unlike

BASE = {"x": 1.5 * KR10.torsion[1], "y": 1.2 * KR10.torsion[1]}  # N·m/rad
GAIN = 0.7


def diagnosed(case: SmallCase, *options: object) -> dict:
    """The answer of a command that ends with exit code 0, in the form that was promised."""
    answer = told("diagnose", case.recordings, "--robot", case.robot_toml, *options)
    assert set(answer) >= {
        "verdict", "findings", "candidates", "where", "fit", "held_out", "npz",
    }  # fmt: skip
    for finding in answer["findings"]:
        assert set(finding) >= {"effect", "at", "probability", "parameters", "text"}
        for parameter in finding["parameters"].values():
            assert set(parameter) >= {"value", "sd", "unit"}
        assert len(finding["text"].split()) > 8
    assert all(set(c) >= {"effect", "at", "probability"} for c in answer["candidates"])
    shares = [c["probability"] for c in answer["candidates"]]
    assert shares == sorted(shares, reverse=True)
    assert sum(shares) == pytest.approx(1.0)
    assert ("unknown", None) in [(c["effect"], c["at"]) for c in answer["candidates"]]
    where = answer["where"]
    assert all(low < high for low, high in where["bands_hz"])
    assert set(where["poses"]) <= {"P1", "P2", "P3", "P4"}
    assert set(where["directions"]) <= set("xyz")
    for agreement in (answer["fit"], answer["held_out"]):
        for stage in ("nominal", "refitted", "explained"):
            assert set(agreement[stage]) >= {"frac", "frobenius"}
    assert len(answer["held_out"]["poses"]) == 1
    return answer


def leader(answer: dict) -> tuple[str, str | None]:
    """Effect and place of the most probable candidate."""
    return answer["candidates"][0]["effect"], answer["candidates"][0]["at"]


@pytest.mark.parametrize("handling", [LABORATORY, EVERYDAY], ids=["exact hits", "everyday's"])
def test_where_nothing_is_concealed_nothing_is_found(tmp_path, handling):
    answer = diagnosed(small_case(tmp_path, handling=handling))
    assert answer["verdict"] == "consistent"
    assert answer["findings"] == []
    assert leader(answer) == ("none", None)
    assert answer["held_out"]["refitted"]["frac"] > 0.99
    assert answer["npz"] is None


def test_a_soft_base_is_named_sized_and_predicted(tmp_path):
    axes = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}
    extra = tuple(Spring("base", axes[a], k, 5e-4 * k) for a, k in BASE.items())
    case = small_case(tmp_path, unlike(extra=extra), handling=EVERYDAY)
    answer = diagnosed(case, "--predict", case.predict_csv, "--out", tmp_path / "found")
    assert answer["verdict"] == "explained"
    assert leader(answer) == ("base_compliance", "base")
    (finding,) = answer["findings"]
    assert (finding["effect"], finding["at"]) == ("base_compliance", "base")
    for axis, true in BASE.items():
        stiffness = finding["parameters"][f"stiffness of base about {axis}"]
        assert stiffness["unit"] == "N·m/rad"
        assert stiffness["value"] == pytest.approx(true, rel=0.05)
    held_out = answer["held_out"]
    assert held_out["explained"]["frac"] > max(0.99, held_out["refitted"]["frac"])
    with np.load(answer["npz"]) as file:
        lines, mean = file["frequency_hz"], file["frf_mean"]
        assert mean.shape == file["frf_sd"].shape == (1, 3, 3, lines.size)
        q = np.deg2rad(file["joints_deg"])[0]
    true = load_truth(case.robot_toml, unlike(extra=extra)).accelerance(q, lines)
    assert np.linalg.norm(mean[0] - true) < 0.05 * np.linalg.norm(true)


def test_a_wrong_sensitivity_is_called_that_and_no_physics(tmp_path):
    answer = diagnosed(small_case(tmp_path, artefact=Artefact(gain=(1.0, GAIN, 1.0))))
    assert answer["verdict"] == "explained"
    assert leader(answer) == ("sensor_gain", "sensor_y")
    (finding,) = answer["findings"]
    assert (finding["effect"], finding["at"]) == ("sensor_gain", "sensor_y")
    assert finding["parameters"]["gain"]["value"] == pytest.approx(GAIN, rel=0.02)
