"""Scores of a proof, on answers and diagnoses written by hand."""

import hashlib
import json

import numpy as np
import pytest

from planner.errors import InputError
from planner.proof.curves import share
from planner.proof.report import write
from planner.proof.run import Proof, unseal
from planner.proof.score import calibration_error, score
from planner.proof.summary import summary

NOTHING = {"frac": 0.9, "frobenius": 0.9}
MASS, BASE, NOISE_OF = ("added_mass", "link_3"), ("base_compliance", "base"), ("none", None)
UNKNOWN = ("unknown", None)


def answer(*effects, outside=False, nats=1e3, imperfections=(), left=0.1):
    return {
        "robot": "kr210",
        "outside_library": outside,
        "effects": [
            {
                **{"effect": e, "at": at, "parameters": p, "nats": nats, "nats_open": nats},
                **{"change": 0.5, "left": left},
            }
            for e, at, p in effects
        ],
        "imperfections": [{"effect": e, "at": at} for e, at in imperfections],
        "held_out": {},
    }


def told(*places, probability=0.9, parameters=None, sets=()):
    verdict = {"none": "consistent", "unknown": "unexplained"}.get(places[0][0], "explained")
    return {
        "verdict": verdict,
        "findings": [
            {"effect": e, "at": at, "parameters": parameters or {}} for e, at in places if at
        ],
        "candidates": [
            {"effects": [{"effect": e, "at": at} for e, at in places], "probability": probability}
        ],
        "sets": [[{"effect": e, "at": at} for e, at in members] for members in sets],
        "held_out": {"refitted": NOTHING, "explained": NOTHING},
        "npz": None,
        "seconds": 1.0,
    }


def test_effect_and_place_must_both_be_right():
    true = answer((*MASS, {"mass": 10.0}))
    assert score("a", true, told(MASS)).right
    wrong = score("a", true, told(("added_mass", "link_4")))
    assert not wrong.right
    assert wrong.false_names == (("added_mass", "link_4"),)
    assert not score("a", true, told(UNKNOWN)).right


def test_null_outsider_and_pair():
    assert score("a", answer(), told(NOISE_OF)).right
    assert not score("a", answer(), told(UNKNOWN)).right
    outside = answer((*UNKNOWN, {}), outside=True)
    assert score("a", outside, told(UNKNOWN)).right
    assert not score("a", outside, told(NOISE_OF)).right
    assert score("a", outside, told(NOISE_OF)).group == "outsider"
    pair = answer((*MASS, {}), (*BASE, {"stiffness": [1, 2]}))
    assert score("a", pair, told(BASE, MASS)).right
    half = score("a", pair, told(BASE))
    assert not half.right
    assert [e.named for e in half.shown] == [False, True]


def test_what_nothing_tells_of_may_be_left_out_but_nothing_else_named():
    faint = answer((*MASS, {}), nats=2.0)
    assert score("a", faint, told(NOISE_OF)).right
    assert score("a", faint, told(MASS)).right
    assert not score("a", faint, told(BASE)).right
    assert score("a", answer((*UNKNOWN, {}), outside=True, nats=2.0), told(NOISE_OF)).right
    plainly = answer((*MASS, {}), nats=5.0)
    assert not score("a", plainly, told(NOISE_OF)).right


def test_a_set_of_two_counts_beside_the_name_and_a_larger_one_does_not():
    true, other = answer((*MASS, {})), ("added_mass", "link_4")
    two = score("a", true, told(other, sets=[[MASS, other]]))
    assert (two.shown[0].named, two.shown[0].in_set, two.false_names) == (False, True, ())
    three = score("a", true, told(other, sets=[[MASS, other, BASE]]))
    assert (three.shown[0].in_set, three.false_names) == (False, (other,))
    unsaid = score("a", true, told(NOISE_OF, sets=[[MASS, other]]))
    assert not unsaid.shown[0].in_set  # a set of which nothing is named tells nobody anything


def test_an_imperfection_is_no_false_name_and_no_silence():
    null = answer(imperfections=[("friction", "joint_2")])
    found = score("a", null, told(("friction", "joint_2")))
    assert found.false_names == ()
    assert not found.right
    assert found.holds
    assert calibration_error([found]) == pytest.approx(0.9)
    assert calibration_error([found], "holds") == pytest.approx(0.1)
    assert summary([found])["nulls_silent"]["right"] == 0
    assert score("a", null, told(("friction", "joint_3"))).false_names == (("friction", "joint_3"),)


def test_consistent_says_that_nothing_matters_not_that_nothing_is_there():
    """A robot that can be refitted to within less than what matters is said to be consistent."""
    slight, large = (
        score("a", answer((*UNKNOWN, {}), outside=True, left=left), told(NOISE_OF))
        for left in (0.002, 0.05)
    )
    assert [s.right for s in (slight, large)] == [False, False]
    assert [s.fair for s in (slight, large)] == [True, False]
    assert calibration_error([slight, large], "fair") == pytest.approx(0.4)
    figures = summary([slight, large])
    assert figures["outsiders_unknown_that_matter"]["of"] == 1
    assert figures["outsiders_unknown"]["of"] == 2
    faint = score("a", answer((*UNKNOWN, {}), outside=True, nats=10.0), told(NOISE_OF))
    assert summary([faint])["outsiders_unknown_that_matter"]["of"] == 0
    assert not faint.fair
    unfounded = score("a", answer((*UNKNOWN, {}), outside=True, left=0.002), told(MASS))
    assert not unfounded.fair
    small = score("a", answer((*MASS, {}), left=0.002), told(MASS))
    assert small.fair
    hose = answer((*UNKNOWN, {}), outside=True, left=0.002, imperfections=[BASE])
    assert score("a", hose, told(BASE)).fair
    assert not score("a", hose | {"effects": []}, told(UNKNOWN)).fair
    strong = answer((*UNKNOWN, {}), outside=True, imperfections=[BASE])
    assert not score("a", strong, told(BASE)).fair
    named = summary([small, score("b", answer((*MASS, {})), told(MASS))])["named_that_matter"]
    assert (named["right"], named["of"]) == (1, 1)


def test_curves_put_effects_into_bins_of_nats():
    cases = [
        score("a", answer((*MASS, {}), nats=n), told(*says))
        for n, says in [(1.0, [NOISE_OF]), (30.0, [MASS]), (30.0, [BASE]), (5e6, [MASS])]
    ]
    figures = summary(cases)
    for measure in ("nats", "nats_open"):
        rows = {row["least"]: row["named"] for row in figures["curves"][measure]}
        assert {k: (v["right"], v["of"]) for k, v in rows.items() if v["of"]} == {
            0.0: (0, 1), 20.0: (1, 2), 1e5: (1, 1)
        }  # fmt: skip
        assert figures["clearly"][measure]["named"]["of"] == 3
    assert figures["cases_with_false_names"]["right"] == 1
    assert figures["undetectable_abstained"] == share([True]).__dict__ | {
        "interval95": list(share([True]).interval95)
    }
    json.dumps(figures)


def test_wilsons_interval_is_that_of_the_score_test():
    for right, of in [(0, 12), (9, 12), (12, 12), (170, 200)]:
        found = share([k < right for k in range(of)])
        p = right / of
        for bound in found.interval95:  # where the test of a share just fails at 5 %
            if 0 < bound < 1:
                assert abs(p - bound) == pytest.approx(1.96 * np.sqrt(bound * (1 - bound) / of))
        assert found.interval95[0] - 1e-9 <= p <= found.interval95[1] + 1e-9
    assert share([]).share is None


def test_all_files_of_a_report(tmp_path):
    cases = [
        score("a", answer((*MASS, {})), told(MASS)),
        score("b", answer(), told(BASE)),
        score("c", answer((*BASE, {"stiffness": [1.0, 2.0]})), {"failed": "it broke"}),
    ]
    found = write(Proof(tmp_path, {}, "00"), cases)
    for name in ("curves.png", "confusion.png", "calibration.png"):
        assert (tmp_path / name).stat().st_size > 5000
    text = found.text()
    assert "| 1000 – 10000 | 1/2 · 50%" in text
    assert "| cases with false names | 1/3 | 33%" in text
    assert [s.name for s in found.misses] == ["b", "c"]
    assert json.loads((tmp_path / "report.json").read_text())["nulls_silent"]["of"] == 1


@pytest.mark.parametrize(("sd", "inside"), [(1.0, 1), (0.5, 0)])
def test_interval_covers(sd, inside):
    true = answer(("added_mass", "link_3", {"mass": 10.0}))
    found = {"mass": {"value": 11.0, "sd": sd, "unit": "kg"}}
    assert score("a", true, told(MASS, parameters=found)).covered == (inside, 1)


def test_a_failure_is_wrong_and_artefacts_called_physics_are_counted():
    true = answer(("polarity", "sensor_x", {}))
    scored = [
        score("a", true, {"failed": "it broke"}),
        score("b", true, told(("added_mass", "link_3"), probability=1.0)),
        score("c", true, told(("polarity", "sensor_x"), probability=1.0)),
    ]
    assert not scored[0].right
    figures = summary(scored)
    assert figures["groups"]["artefact"]["right"] == 1
    assert figures["artefacts_called_physics"]["right"] == 1
    assert figures["failed"]["right"] == 1
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
