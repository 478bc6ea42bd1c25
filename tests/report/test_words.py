"""What screens say: numbers with their digits, a diagnosis that does not contradict itself, and
forecasts that hold."""

import io
from dataclasses import fields, replace
from types import SimpleNamespace

import pytest
from rich.console import Console, Group

from planner.campaign.events import HitRecord
from planner.campaign.importing import ImportReport
from planner.design.stopping import percent
from planner.diagnosis.diagnose import Established, ThreefoldSimilarity
from planner.diagnosis.mismatch import MismatchShares
from planner.diagnosis.odd_pose import OddPose
from planner.diagnosis.verdict import Candidate
from planner.measurement.agreement import Similarity
from planner.report.diagnosis import DiagnosisReport, established_effects
from planner.report.diagnosis import ranked as ranked_effects
from planner.report.imports import PoseImport
from planner.report.predictions import ExpectedMode
from planner.report.status import two_answers
from planner.report.text import UnbrokenConsole, with_sd
from planner.robot.place_names import place_names, with_names
from planner.robot.robot import Robot
from planner.words import probable, significant
from tests.support.plain_arm import make_plain_arm

UNKNOWN = (("unknown", None),)
BASE = (("base_compliance", "base"), ("transverse_compliance", "joint_1"))


@pytest.mark.parametrize(
    ("function", "values", "said"),
    [
        (with_sd, (15.985, 0.0003, ".3f"), "15.985 ± <0.001"),
        (with_sd, (15.985, 0.0006, ".3f"), "15.985 ± 0.001"),
        (with_sd, (1.5, 0.0), "1.50 ± 0.00"),  # stated to be exact
        (with_sd, (1.5, None), "1.50 ± –"),
        (with_sd, (None, None), "–"),
        (with_sd, (1.5, float("nan")), "1.50 ± –"),
        (significant, (0.01234,), "0.012"),
        (significant, (0.00949,), "0.0095"),
        (significant, (1.0,), "1.0"),
        (significant, (123.4,), "120"),
        (significant, (0,), "0"),
        (significant, (0.0996,), "0.10"),
        (significant, (float("inf"),), "inf"),
        (percent, (0.0321,), "0.032 %"),
        (percent, (99.6,), "100 %"),
        (percent, (113.0,), "more than 100 %"),
        (percent, (1.7e6,), "more than 100 %"),
        (percent, (0.0,), "0 %"),
        (probable, (0.0,), "below 0.1 %"),
        (probable, (0.004,), "0.4 %"),
        (probable, (0.92,), "92 %"),
        (probable, (0.993,), "99.3 %"),
        (probable, (1.0,), "above 99.9 %"),
    ],
)
def test_numbers_are_said_with_the_digits_that_tell(function, values, said):
    assert function(*values) == said


def test_a_damping_of_which_nothing_is_known_is_no_number():
    assert ExpectedMode(10.0, 0.1, 0.133, 2.91).cells[1] == "not known"
    assert ExpectedMode(10.0, 0.1, 0.03, 0.002).cells[1] == "3.00 ± 0.20"


def test_an_import_says_how_a_small_sd_changed():
    sds = (0.0123, 1.26), (0.0091, 0.84)
    before, after = (SimpleNamespace(frequency_sd_percent=sd) for sd in sds)
    hits = HitRecord("y.uff", "", ""), HitRecord("x.uff", "", "", accepted=False)
    done = PoseImport(ImportReport("P001", None, before, after, hits))
    drawn = io.StringIO()
    UnbrokenConsole(file=drawn, width=300).print(Group(*done.parts()))
    wanted = "sd of the frequencies of modes 1 to 2: 0.012 → 0.0091 %, 1.3 → 0.84 %"
    assert wanted in drawn.getvalue()


def report(verdict: str, *ranked) -> DiagnosisReport:
    """An answer with these explanations; FRAC 0.9999 with the best of them."""
    empty = {f.name: None for f in fields(DiagnosisReport)}
    sides = (Similarity(f, f) for f in (0.9, 0.95, 0.9999))
    given = {
        "verdict": verdict, "findings": (), "remarks": (), "plots": (), "simulated": False,
        "candidates": tuple(ranked_effects(p, q) for p, q in ranked),
        "fit": ThreefoldSimilarity(*sides), "place_names": {}, "seconds": 1.0,
        "closest": tuple(one for p, _ in ranked for one in p if one[1]),
        "where": Said(), "shares": Said(), "held_out": Said(),
    }  # fmt: skip
    return DiagnosisReport(**(empty | given))


class Said:
    sentence, poses = "", ()


@pytest.mark.parametrize(
    ("verdict", "ranked", "words"),
    [
        ("unexplained", ((UNKNOWN, 0.92), (BASE, 0.08)),
         ("No effects that planner knows explain", "(probability 92 %)", "99.99 %",
          "base compliance at base and transverse compliance at joint_1; with them")),
        ("unexplained", ((UNKNOWN, 1.0), ((("none", None),), 0.0)),
         ("none of the effects that planner knows describes it",)),
        ("explained", ((BASE, 1.0),), ("with this it does:",)),
    ],
)  # fmt: skip
def test_a_verdict_names_what_comes_nearest(verdict, ranked, words):
    answer = report(verdict, *ranked)
    assert all(said in answer.verdict_text for said in words)
    assert answer.to_json()["verdict_text"] == answer.verdict_text


def test_joints_have_the_names_that_the_robot_has_for_them(tmp_path):
    robot_toml = make_plain_arm(tmp_path)
    assert place_names(Robot.load(robot_toml)) == {}
    for path in (robot_toml, tmp_path / "plain.urdf"):
        path.write_text(path.read_text().replace("joint_1", "swing").replace("link_2", "arm"))
    assert place_names(Robot.load(robot_toml)) == {"joint_1": "swing", "link_2": "arm"}
    named = with_names("joint_1 gives; joint_10 and link_2", {"joint_1": "swing", "link_2": "arm"})
    assert named == "joint_1 (swing) gives; joint_10 and link_2 (arm)"
    answer = replace(report("unexplained", (BASE, 0.08)), place_names={"joint_1": "swing"})
    assert "joint_1 (swing)" in answer.verdict_text


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (["base_compliance base"], "adds springs at A5, which the diagnosis does not name."),
        (["base_compliance base", "transverse_compliance joint_5"], ""),
        (["joint_stiffness joint_2"], ""),
        ([], ""),
    ],
)
def test_a_model_and_a_diagnosis_that_differ_are_one_answer(found, said):
    springs = [
        {"joint": joint, "stated": stated}
        for joint, stated in (("A2", 2e6), ("A5", None), ("base", None))
    ]
    each = [dict(zip(("effect", "at"), one.split(), strict=True)) for one in found]
    answer = {"findings": each, "place_names": {"joint_2": "A2", "joint_5": "A5"}}
    both = two_answers(springs, answer)
    assert said in both
    assert bool(said) == bool(both)


def test_a_diagnosis_says_small_probabilities_and_the_pose_at_odds():
    odd = OddPose("P003", 95.1, 0.009)
    answer = replace(report("explained", (BASE, 0.99), (UNKNOWN, 7e-123)), odd_pose=odd)
    drawn = io.StringIO()
    Console(file=drawn, width=300).print(answer.text())
    for said in ("below 0.1 %", "99 %", "Pose P003 is at odds with all others",
                 "(misfit 0.0090, with it 95; 1 just matters)"):  # fmt: skip
        assert said in drawn.getvalue()
    said = answer.to_json()["odd_pose"]
    assert said == {"pose": "P003", "misfit": 95.1, "misfit_without": 0.009, "text": odd.sentence}


def test_a_refit_that_is_farther_off_is_explained():
    assert "peaks are farther off" in MismatchShares(-6.3, 2.1, -34.4, -46.6).sentence
    assert "peaks" not in MismatchShares(-6.3, -9.0, -34.4, -46.6).sentence


def test_a_finding_may_be_taken_for_explanations_without_it():
    base, hose, bearing = ("base_compliance", "base"), ("local_resonator", "link_2"), (
        "transverse_compliance", "joint_2")  # fmt: skip
    found = [Established(*place, 0.9, 0.2, {}, "So.") for place in (base, hose)]
    undecided = [Candidate((base, hose), 0.6), Candidate((base, bearing), 0.4)]
    told = established_effects(SimpleNamespace(findings=found), undecided, {})
    of_base, of_hose = (effect.text for effect in told)
    assert "cannot tell it from" not in of_base
    assert "cannot tell it from: " in of_hose
    assert "transverse compliance at joint_2" in of_hose
