"""What is said of drift, of modes elsewhere, of one thing found twice, of replaced files."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest

from planner.campaign import labels
from planner.campaign.campaign import Campaign
from planner.campaign.events import (
    Entry,
    HitRecord,
    Imported,
    MeasuredMode,
    Skipped,
    Starred,
    Undone,
    Withdrawn,
)
from planner.campaign.import_checks import Claim, hit_again, suspected_drift, unexpected_modes
from planner.campaign.importing import ImportReport
from planner.campaign.model import Model
from planner.campaign.state import CampaignState, Measurement, fold
from planner.effects.resonator import LinkResonator
from planner.proof.deviation import Deviation
from planner.proof.load import load_truth
from planner.recording.joints import JointUnits
from planner.report.imports import PoseImport
from planner.robot.arm_chain import arm_chain
from tests.support.outside import record, told
from tests.support.plain_arm import make_plain_arm, plain_campaign


def modes(*hertz: float) -> tuple[MeasuredMode, ...]:
    empty = ((None, None, None),) * 9
    return tuple(MeasuredMode(hz, 1e-4 * hz, 0.02, 1e-3, (), empty) for hz in hertz)


def model(scatter: float, poses: int = 5) -> Any:
    """A model that expects 10 and 20 Hz everywhere."""
    expected = SimpleNamespace(
        frequency_hz=np.array([[10.0, 20.0]]), frequency_sd_hz=np.array([[0.02, 0.03]])
    )
    return SimpleNamespace(
        surrogate=SimpleNamespace(visit_scatter=np.array([scatter, scatter])),
        labelled=(None,) * poses, predict=lambda q: expected,
        frequencies=lambda q: (expected.frequency_hz, expected.frequency_sd_hz),
        low=SimpleNamespace(simulation=None, simulate=lambda q, more: None),
        cell=SimpleNamespace(robot=SimpleNamespace(joints=JointUnits.of(("a", "b")))),
    )  # fmt: skip


KNOWN = Measurement("P001", (0.0, 0.0), (), modes(10.0, 20.0))


@pytest.mark.parametrize(
    ("hertz", "scatter", "poses", "said"),
    [((10.0, 20.01), 1e-3, 5, "is as it was"), ((10.08, 20.0), 1e-3, 5, "differs"),
     ((10.08, 20.0), 5e-3, 5, "is as it was"), ((9.9, 19.7), 1e-3, 5, "differs"),
     ((10.08, 20.0), 5e-3, 4, "differs"),  # few poses do not tell how visits scatter
     ((12.0, 33.0), 1e-3, 5, "")],
)  # fmt: skip
def test_a_second_visit_is_held_against_the_scatter_of_visits(hertz, scatter, poses, said):
    told = "".join(hit_again(model(scatter, poses), KNOWN, modes(*hertz)))
    assert (bool(told), "P001" in told) == (bool(said), bool(said))
    assert said in told


@pytest.mark.parametrize(
    ("hertz", "hinted"),
    [((9.93, 19.86), True), ((10.07, 20.14), True), ((9.93, 20.14), False),
     ((9.99, 19.98), False), ((9.93,), False)],
)  # fmt: skip
def test_modes_to_one_side_ask_for_the_first_pose_again(hertz, hinted):
    state = CampaignState(measurements={"P001": KNOWN})
    again, text = suspected_drift(Claim(model(1e-3), state, "P004", (1.0, 1.0)), modes(*hertz))
    assert again == ("P001" if hinted else "")
    assert ("Hit P001, the first pose, again (0.000, 0.000°)" in text) == hinted


def hits(pose: str, again: str = "") -> Imported:
    return Imported(pose, (0.0, 0.0), (), modes(10.0, 20.0), again=again)


@pytest.mark.parametrize(
    ("act", "left"),
    [(hits("P001"), None), (hits("P004"), ("P001", "P003")), (Skipped("P001"), None),
     (Withdrawn("P003"), None), (Undone((3,)), None), (Starred("P001"), ("P001", "P003"))],
)  # fmt: skip
def test_drift_is_suspected_until_it_was_looked_at_or_its_hint_is_gone(act, left):
    acts = [hits("P001"), hits("P002"), hits("P003", again="P001"), act]
    assert fold([Entry(n, "", one) for n, one in enumerate(acts, 1)]).doubt == left


@pytest.mark.slow
def test_a_robot_that_softened_is_told_by_the_command(tmp_path):
    robot = make_plain_arm(tmp_path / "robot")
    plan = plain_campaign(tmp_path / "plan" / "campaign.toml", "maximin_lhs")
    cell = tmp_path / "cell"
    Campaign.new(cell, robot, plan)
    for day, common in enumerate((1.0, 1.0, 1.0, 0.98)):
        truth = load_truth(robot, Deviation(seed=3, stiffness=0.1, common=common))
        proposal = told("next", cell)["proposals"][0]
        folder = record(truth, tmp_path / f"day{day}", proposal["pose"], proposal["joints_deg"])
        last = told("import", cell, folder)
    assert any("Hit P001, the first pose, again" in text for text in last["remarks"])
    (asked,) = told("next", cell)["proposals"]
    assert asked["pose"] == "P001"
    assert "P001 hit again tells whether the robot changed" in asked["reason"]
    first = Campaign(cell).state.used[0]
    assert asked["joints_deg"] == list(first.joints_deg)
    folder = record(truth, tmp_path / "again", "P001", list(first.joints_deg), seed=8)
    again = told("import", cell, folder)
    (said,) = (text for text in again["remarks"] if "P001 was hit again" in text)
    assert "differs from the hits before" in said
    assert told("next", cell)["proposals"][0]["pose"] != "P001"
    told("undo", cell)
    told("undo", cell)
    assert told("next", cell)["proposals"][0]["pose"] == "P001"


def shown(*hertz: float):
    return tuple(SimpleNamespace(frequency_hz=f, frequency_sd_hz=0.003, likely=True) for f in hertz)


@pytest.mark.parametrize(("found", "said"), [(14.66, 0), (9.99, 1)])
def test_a_mode_far_from_where_it_was_expected_is_said(found, said, monkeypatch):
    expected = np.array([[9.23, 14.65]]), np.array([[0.02, 0.06]])
    before = SimpleNamespace(
        labelled=("P001",), frequencies=lambda q: expected, cell=None, low=None
    )
    sure, own = np.ones(2), shown(9.24, found)
    here = SimpleNamespace(pose="P002", q=np.zeros(6), modes=own, probability=sure)
    monkeypatch.setattr(labels, "label", lambda *given: (here,))
    told = unexpected_modes(before, SimpleNamespace(labelled=(here,), used=()), "P002")
    assert len(told) == said
    assert all("mode 2 at 9.99 Hz, expected at 14.650 ± 0.060 Hz (78 sd off)" in t for t in told)
    assert not unexpected_modes(SimpleNamespace(labelled=()), SimpleNamespace(labelled=()), "P002")


def test_modes_are_compared_by_what_they_are_where_their_numbers_moved(monkeypatch):
    """A mode that does not exist was the first of three expected."""
    expected = np.array([[4.0, 9.23, 14.65]]), np.array([[0.5, 0.02, 0.06]])
    before = SimpleNamespace(
        labelled=("P001",), frequencies=lambda q: expected, cell=None, low=None
    )
    first, second, third = shown(9.24, 14.66, 19.0)
    here = SimpleNamespace(pose="P002", q=np.zeros(6), modes=(first, second, third))
    here.probability = np.ones(3)
    then = SimpleNamespace(pose="P002", modes=(None, first, second))
    monkeypatch.setattr(labels, "label", lambda *given: (then,))
    model = SimpleNamespace(labelled=(here,), used=())
    found = labels.found_modes("P002", model, before)
    np.testing.assert_array_equal([one.expected_hz for one in found], [9.23, 14.65, np.nan])
    assert not unexpected_modes(before, model, "P002")
    own = tuple(
        msgspec.structs.replace(mode, shape=((1.0, 0.0), (0.0, 0.0)))
        for mode in modes(9.24, 14.66, 19.0)
    )
    measurement = Measurement("P002", (), (), own)
    answer = PoseImport(ImportReport("P002", measurement, before, model))
    answer.__dict__["expected"] = ("of 4.0 Hz", "of 9.23 Hz", "of 14.65 Hz")
    told = [(mode["label"], mode["expected"]) for mode in answer.modes]
    assert told == [(1, "of 9.23 Hz"), (2, "of 14.65 Hz"), (3, None)]


def test_a_mode_that_no_pose_has_shown_is_told():
    config = SimpleNamespace(modes=SimpleNamespace(band_hz=(3.0, 20.0)))
    poses = [
        SimpleNamespace(modes=(None, *shown(9.2), None), simulated_hz=np.array([4.0, 9.1, 30.0])),
        SimpleNamespace(modes=(None, *shown(9.5), None), simulated_hz=np.array([4.2, 9.4, 31.0])),
    ]
    cell, surrogate = SimpleNamespace(config=config), SimpleNamespace(count=3)
    model = SimpleNamespace(labelled=poses, cell=cell, surrogate=surrogate)
    assert "No pose has shown mode 1 (about 4.1 Hz)," in Model.never_found.fget(model)
    poses[0].modes = (*shown(4.0), *poses[0].modes[1:])
    assert Model.never_found.fget(model) == ""


def test_modes_beside_those_predicted_are_said_where_every_pose_shows_them():
    table = SimpleNamespace(modes=SimpleNamespace(count=2))
    poses = [SimpleNamespace(modes=shown(9.0, 14.0)), SimpleNamespace(modes=shown(9.1, 14.1))]
    used = [SimpleNamespace(modes=shown(9.0, 14.0, 29.0)), SimpleNamespace(modes=poses[1].modes)]
    model = SimpleNamespace(labelled=poses, used=used, cell=SimpleNamespace(config=table))
    assert Model.not_predicted.fget(model) == ""
    used[1].modes = shown(9.1, 14.1, 32.0)
    assert "between 29.0 and 32.0 Hz" in Model.not_predicted.fget(model)


def test_refused_files_that_were_replaced_are_none_any_more():
    bad = HitRecord("first/x_1.csv", "a" * 64, ".csv", accepted=False, reason="no hit axis")
    good = HitRecord("again/x_1.csv", "b" * 64, ".csv", "+x")
    other = msgspec.structs.replace(bad, file="first/y_1.csv")
    along = msgspec.structs.replace(bad, hit="+y")  # of the same name in another folder
    measured = Measurement("P1", (0.0,), (bad, good, other, along), ())
    assert measured.refused == (other, along)
    assert replace(measured, hits=(bad, other)).refused == (bad, other)


def swinging(mass: float, hertz: float, *way: float):
    values = {"mass": (mass, 0.4), "frequency": (hertz, 0.01)}
    return values | {f"direction_{a}": (w, 0.1) for a, w in zip("xyz", way, strict=True)}


def test_one_mass_that_swings_in_three_directions_is_told_once():
    hose = LinkResonator("link_3", joint="joint_3")
    x, y, z = (
        swinging(12.1, 14.0, 1, 0, 0.1),
        swinging(12.4, 14.0, 0, 1, 0),
        swinging(11.8, 16, 0, 0, 1),
    )
    assert hose.same_thing(x, y)
    assert hose.same_thing(x, z)
    assert not hose.same_thing(x, swinging(4.0, 14.0, 0, 1, 0))
    assert not hose.same_thing(x, swinging(12.1, 30.0, 1, 0.2, 0))
    told = hose.words_together([y, x, z])
    assert "Something of 12 kg on link_3 has a resonance of its own at" in told
    assert "14.0 Hz along x and y and 16.0 Hz along z" in told


@pytest.mark.parametrize(("name", "sensor"), [("sensor", "sensor"), ("cover", "tcp")])
def test_a_link_called_sensor_is_where_the_sensor_is(name, sensor):
    joint = '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/></joint>'
    limit = '<joint name="joint_1" type="revolute"><parent link="base"/><child link="link_1"/>'
    limit += '<limit lower="-1" upper="1"/></joint>'
    fixed = joint.format("a", "fixed", "link_1", "tcp") + joint.format("b", "fixed", "tcp", name)
    links = "".join(f'<link name="{link}"/>' for link in ("base", "link_1", "tcp", name))
    chain = arm_chain(ElementTree.fromstring(f"<robot>{links}{limit}{fixed}</robot>"))
    assert chain is not None
    assert (chain.tcp, chain.sensor) == ("tcp", sensor)
