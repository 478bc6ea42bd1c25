"""Scores of a proof, on answers and diagnoses written by hand."""

import hashlib
import json

import pytest

from planner.errors import InputError
from planner.prove.run import Proof, unseal
from planner.prove.score import calibration_error, score, summary

NOTHING = {"frac": 0.9, "frobenius": 0.9}


def answer(*effects, outside=False):
    return {
        "robot": "kr210",
        "outside_library": outside,
        "effects": [
            {"effect": e, "at": at, "parameters": p, "change": 0.5} for e, at, p in effects
        ],
        "held_out": {},
    }


def told(*places, probability=0.9, parameters=None):
    return {
        "verdict": "explained",
        "findings": [
            {"effect": e, "at": at, "parameters": parameters or {}} for e, at in places if at
        ],
        "candidates": [
            {"effects": [{"effect": e, "at": at} for e, at in places], "probability": probability}
        ],
        "held_out": {"refitted": NOTHING, "explained": NOTHING},
        "npz": None,
        "seconds": 1.0,
    }


def test_effect_and_place_must_both_be_right():
    true = answer(("added_mass", "link_3", {"mass": 10.0}))
    assert score("a", true, told(("added_mass", "link_3"))).right
    assert not score("a", true, told(("added_mass", "link_4"))).right
    assert not score("a", true, told(("unknown", None))).right


def test_null_outsider_and_pair():
    assert score("a", answer(), told(("none", None))).right
    outside = answer(("unknown", None, {}), outside=True)
    assert score("a", outside, told(("unknown", None))).right
    assert score("a", outside, told(("none", None))).group == "outsider"
    pair = answer(("added_mass", "link_3", {}), ("base_compliance", "base", {"stiffness": [1, 2]}))
    assert score("a", pair, told(("base_compliance", "base"), ("added_mass", "link_3"))).right
    assert not score("a", pair, told(("base_compliance", "base"))).right


@pytest.mark.parametrize(("sd", "inside"), [(1.0, 1), (0.5, 0)])
def test_interval_covers(sd, inside):
    true = answer(("added_mass", "link_3", {"mass": 10.0}))
    found = {"mass": {"value": 11.0, "sd": sd, "unit": "kg"}}
    assert score("a", true, told(("added_mass", "link_3"), parameters=found)).covered == (inside, 1)


def test_a_failure_is_wrong_and_artefacts_called_physics_are_counted():
    true = answer(("polarity", "sensor_x", {}))
    scored = [
        score("a", true, {"failed": "it broke"}),
        score("b", true, told(("added_mass", "link_3"), probability=1.0)),
        score("c", true, told(("polarity", "sensor_x"), probability=1.0)),
    ]
    assert not scored[0].right
    figures = summary(scored)
    assert figures["groups"]["artefact"] == {"right": 1, "of": 3, "share": 1 / 3}
    assert figures["artefacts_called_physics"] == 2  # a failure counts as no artefact either
    assert calibration_error(scored) == pytest.approx(2 / 3)


def test_a_changed_answer_is_noticed(tmp_path):
    (tmp_path / "answers").mkdir()
    path = tmp_path / "answers" / "case_001.json"
    path.write_text(json.dumps(answer()))
    proof = Proof(tmp_path, {"case_001": hashlib.sha256(path.read_bytes()).hexdigest()}, "")
    assert unseal(proof, "case_001")["robot"] == "kr210"
    path.write_text(json.dumps(answer(("polarity", "sensor_x", {}))))
    with pytest.raises(InputError, match="changed after it was sealed"):
        unseal(proof, "case_001")
