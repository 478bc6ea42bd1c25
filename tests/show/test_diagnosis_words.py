"""A diagnosis does not contradict itself: words, table and file say the same."""

from dataclasses import fields, replace
from io import StringIO

import numpy as np
import pytest
from matplotlib.colors import LogNorm, to_rgb
from rich.console import Console

from planner.diagnosis.odd_pose import OddPose
from planner.report.agreement import FrfSimilarity, ThreeSimilarities
from planner.report.diagnosis import DiagnosisReport, EffectAtPlace, RankedExplanation
from planner.report.diagnosis_plots import STYLES, _residuals
from planner.report.frf_plots import ComparedFrfs, Side
from planner.report.kept_diagnosis import two_answers
from planner.report.mismatch import MismatchShares, Residuals
from planner.report.plot_marks import ink
from planner.report.refitted_springs import RefittedSpring
from planner.robot.place_names import place_names, with_names
from planner.robot.robot import Robot
from planner.words import probable
from tests.support.plain_arm import make_plain_arm

UNKNOWN = (("unknown", None),)
BASE = (("base_compliance", "base"), ("transverse_compliance", "joint_1"))


def report(verdict: str, *ranked) -> DiagnosisReport:
    """An answer with these explanations; FRAC 0.9999 with the best of them."""
    empty = {f.name: None for f in fields(DiagnosisReport)}
    sides = (FrfSimilarity(f, f) for f in (0.9, 0.95, 0.9999))
    given = {
        "verdict": verdict, "findings": (), "remarks": (), "plots": (), "simulated": False,
        "candidates": tuple(RankedExplanation.of(p, q) for p, q in ranked),
        "fit": ThreeSimilarities(*sides), "place_names": {},
        "closest": tuple(EffectAtPlace(*one) for p, _ in ranked for one in p if one[1]),
    }  # fmt: skip
    return DiagnosisReport(**(empty | given))


def test_what_comes_nearest_is_named_beside_the_unknown():
    said = report("unexplained", (UNKNOWN, 0.92), (BASE, 0.08)).verdict_text
    assert said.startswith("None of the effects that planner knows explains")
    assert "(probability 92 %)" in said
    assert "base compliance at base and transverse compliance at joint_1:" in said
    assert "0.9999" in said


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


def test_where_nothing_is_near_nothing_is_named():
    said = report("unexplained", (UNKNOWN, 1.0), ((("none", None),), 0.0)).verdict_text
    assert "none of the effects that planner knows describes it" in said
    assert "explains" in report("explained", (BASE, 1.0)).verdict_text
    assert report("explained", (BASE, 1.0)).to_json()["verdict_text"]


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (["base_compliance base"], "adds springs at A5 and base, the diagnosis names base."),
        (["base_compliance base", "transverse_compliance joint_5"], ""),
        (["joint_stiffness joint_2"], ""),
        ([], ""),
    ],
)
def test_a_model_and_a_diagnosis_that_differ_are_one_answer(found, said):
    axis = (1.0, 0.0, 0.0)
    springs = [
        RefittedSpring(joint, axis, stated, 1e6, 1e4, "N·m/rad", True)
        for joint, stated in (("A2", 2e6), ("A5", None), ("base", None))
    ]
    each = [dict(zip(("effect", "at"), one.split(), strict=True)) for one in found]
    answer = {"findings": each, "place_names": {"joint_2": "A2", "joint_5": "A5"}}
    both = two_answers(springs, answer)
    assert said in both
    assert bool(said) == bool(both)


def test_small_probabilities_are_not_called_none():
    answer = report("explained", (BASE, 0.99), (UNKNOWN, 7e-123))
    out = StringIO()
    made = Console(file=out, width=120)
    made.print(_table_of(answer))
    assert "below 0.1 %" in out.getvalue()
    assert "99 %" in out.getvalue()


def _table_of(answer: DiagnosisReport):
    """The table of candidates alone; the rest of the text needs a whole diagnosis."""
    object.__setattr__(answer, "where", _Said())
    object.__setattr__(answer, "shares", _Said())
    object.__setattr__(answer, "held_out", _Said())
    object.__setattr__(answer, "seconds", 1.0)
    return answer.text()


def test_a_pose_at_odds_with_the_others_is_named_in_words_and_json():
    odd = OddPose("P003", 95.1, 0.009)
    answer = replace(report("unexplained", (UNKNOWN, 1.0)), odd_pose=odd)
    out = StringIO()
    Console(file=out, width=300).print(_table_of(answer))
    assert "Pose P003 is at odds with all others" in out.getvalue()
    assert "(misfit 0.0090, with it 95; 1 just matters)" in out.getvalue()
    said = answer.to_json()["odd_pose"]
    assert said == {"pose": "P003", "misfit": 95.1, "misfit_without": 0.009, "text": odd.sentence}


class _Said:
    sentence, poses = "", ()


def test_residuals_by_direction_share_a_scale_that_is_shown():
    rng = np.random.default_rng(0)
    places = [
        Residuals(np.linspace(4, 60, 9), *(s * rng.uniform(1, 30, n) for n in (8, 3, (3, 3))))
        for s in (1.0, 0.05)
    ]
    figure = _residuals(*places, ["A$1$", "B", "C"])
    figure.canvas.draw()  # pose names are no formulas
    images = [image for axes in figure.axes for image in axes.images]
    assert images[0].norm is images[1].norm
    assert isinstance(images[0].norm, LogNorm)
    assert any("mean square residual" in axes.get_ylabel() for axes in figure.axes[4:])


def test_a_refit_that_is_farther_off_is_explained():
    assert "peaks are farther off" in MismatchShares(-6.3, 2.1, -34.4, -46.6).sentence
    assert "peaks" not in MismatchShares(-6.3, -9.0, -34.4, -46.6).sentence


@pytest.mark.parametrize("picture", ["residuals", "frf"])
def test_curves_that_agree_are_all_seen(picture):
    """By the colours on the picture: none is covered by one that is drawn later."""
    lines, curve = np.linspace(4.0, 60.0, 100), 10 ** np.linspace(-3.0, 1.0, 100)
    place = Residuals(np.linspace(4, 60, 9), np.full(8, 3.0), np.full(3, 2.0), np.ones((3, 3)))
    if picture == "residuals":
        figure, colours = _residuals(place, place, ["A", "B", "C"]), ("tab:orange", "tab:red")
    else:
        same = np.broadcast_to(curve, (3, 3, 100))
        sides = (
            Side(n, n, STYLES[n], h[None])
            for n, h in zip(STYLES, (0.3 * same, same, same), strict=True)
        )
        figure = ComparedFrfs(("A",), lines[None], same[None], tuple(sides)).overlay(0)
        colours = "0.25", "tab:blue", "tab:orange", "tab:red"
    for legend in (*figure.legends, *(panel.get_legend() for panel in figure.axes)):
        if legend is not None:
            legend.set_visible(False)
    figure.canvas.draw()
    seen = np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(int)
    for colour in colours:
        wanted = np.round(255 * np.array(to_rgb(colour)))
        assert np.sum(np.max(np.abs(seen - wanted), axis=-1) <= 12) > 100, colour


@pytest.mark.parametrize("colour", [(1, 1, 0), (0.99, 0.91, 0.14), (0.1, 0.2, 0.5), (0.5,) * 3])
def test_words_on_colours_are_read(colour):
    """Contrast as WCAG 2 defines it: at least 4.5 with the ink that is chosen."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour]
    light = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    contrast = 1.05 / (light + 0.05) if ink(colour) == "white" else (light + 0.05) / 0.05
    assert contrast >= 4.5


@pytest.mark.parametrize(
    ("probability", "said"),
    [
        (0.0, "below 0.1 %"),
        (0.004, "0.4 %"),
        (0.92, "92 %"),
        (0.993, "99.3 %"),
        (1.0, "above 99.9 %"),
    ],
)
def test_probabilities_are_never_none_nor_all(probability, said):
    assert probable(probability) == said
