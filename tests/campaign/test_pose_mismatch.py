"""Refused hits, hits of another pose, with wrong angles or axes: in the log, asked about, not used.

How often it is asked after more poses, and of what else: test_pose_mismatch_rates.py.
`pytest -m slow tests/campaign/test_pose_mismatch.py` adds hits to a measured pose, too.
"""

import json
import shutil
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from planner.campaign import pose_mismatch
from planner.campaign.campaign import Campaign
from planner.campaign.events import Question
from planner.campaign.import_checks import Claim, question_about
from planner.campaign.low_fidelity import LowFidelity
from planner.campaign.model import Model
from planner.campaign.pose_mismatch import known_poses
from planner.campaign.store import CONFIG
from planner.dataset.measure import MeasuredPose, measure
from planner.dataset.screened_files import Source
from planner.recording.folder import TABLE
from planner.replay import replay
from planner.report.imports import how_to_answer
from planner.report.status import status
from tests.support.outside import FROZEN, call, record
from tests.support.plain_arm import BAND_HZ

STOOD, SAID = [35.0, -30.0, 70.0, 40.0], [-20.0, -60.0, 35.0, -50.0]


@contextmanager
def unlearned(directory):
    """The simulation as stated meanwhile: a fit to hits that contradict others takes long."""
    config = directory / CONFIG
    decided = config.read_text()
    config.write_text(f"{decided}\n{FROZEN}")
    yield
    config.write_text(decided)


def measured_at(truth, folder: Path, stood) -> MeasuredPose:
    """What hits there give."""
    files = sorted((record(truth, folder, "X1", stood) / "data").iterdir())
    return measure([Source(path, path.name) for path in files], BAND_HZ)


@pytest.fixture
def campaign(two_poses):
    return two_poses[0]


@pytest.fixture(scope="module")
def two(two_poses_once):
    """The campaign itself, which knows its model: not to be changed."""
    return two_poses_once[0]


@pytest.fixture(scope="module")
def truth(two_poses_once):
    return two_poses_once[1]


@pytest.fixture(scope="module")
def there(truth, tmp_path_factory):
    return measured_at(truth, tmp_path_factory.mktemp("there"), STOOD)


@pytest.fixture(scope="module")
def wrong(truth, tmp_path_factory):
    """Hits of another pose than the table says of X1."""
    folder = record(truth, tmp_path_factory.mktemp("wrong") / "hits", "X1", STOOD)
    head, *rows = (line.split(",") for line in (folder / TABLE).read_text().splitlines())
    rows = [[row[0], *map(str, SAID), *row[1 + len(SAID) :]] for row in rows]
    (folder / TABLE).write_text("\n".join(map(",".join, [head, *rows])))
    return folder


@pytest.fixture(scope="module")
def held_once(two_poses_once, wrong, tmp_path_factory):
    """The campaign in which they are held, to be copied, and what the import's command said."""
    folder = tmp_path_factory.mktemp("held") / "campaign"
    shutil.copytree(two_poses_once[0].directory, folder)
    return folder, *call("import", folder, wrong, "--json")


@pytest.fixture
def held(held_once, tmp_path):
    return Campaign(shutil.copytree(held_once[0], tmp_path / "held"))


def test_hits_of_another_pose_are_held_until_confirmed(two, held, held_once, wrong):
    before, (folder, code, out, err) = two.model.frequency_sd_percent, held_once
    # After a crash all is known from the log, and nothing of it is used.
    again = held
    assert list(again.state.measurements) == ["P001", "P002"]
    asked = again.state.held["X1"].question
    assert asked is not None
    assert asked.off_percent > 20
    assert "Is the robot at X1?" in asked.text
    assert asked.fits == ""
    answer = json.loads(out)
    assert (code, answer["accepted"]) == (3, [])
    assert (answer["question"]["pose"], answer["question"]["text"]) == ("X1", asked.text)
    assert {entry["reason"] for entry in answer["refused"]} == {asked.text}
    assert asked.text in err
    assert f"planner confirm {folder} X1" in err
    assert len(err.splitlines()) == 1
    assert not again.orphans()
    np.testing.assert_allclose(again.model.frequency_sd_percent, before, rtol=1e-6)
    (held,) = status(again).to_json()["held"]
    assert held["question"]["text"] == asked.text
    (once_more,) = again.import_paths((wrong,))
    assert once_more.question == asked
    assert len(once_more.already) == 9
    assert call("confirm", again.directory, "P001")[0] == 2
    with unlearned(again.directory):
        said = call("confirm", again.directory, "X1")[1]
    assert "frequency (Hz)" in said
    assert "hits accepted" in said
    again = Campaign(again.directory)
    assert "X1" in [m.pose for m in again.state.used]
    assert not again.state.held
    again.undo()
    assert again.state.held["X1"].question == asked
    again.undo()
    assert not again.state.held
    (fresh,) = again.import_paths((wrong,))
    assert fresh.question is not None


def test_held_hits_set_aside_are_refused_ones_and_further_ones_wait(held, wrong, truth, tmp_path):
    other = record(truth, tmp_path / "other", "X1", SAID) / "data" / "X1_px_1.uff"
    (report,) = held.import_paths((other,), "X1")
    assert "wait for an answer" in report.left_out[0].reason
    held.withdraw("X1")
    again = Campaign(held.directory)
    assert not again.state.held
    assert len(again.state.refused) == 9
    reasons = {hit.reason for _, hit in again.state.refused.values()}
    assert all(reason.startswith("refused by the engineer; held before: ") for reason in reasons)
    assert all("% off the FRFs expected" in reason for reason in reasons)
    (report,) = again.import_paths((wrong,))
    assert report.accepted == ()
    assert len(report.left_out) == 9
    assert not again.orphans()


def test_a_refused_import_says_nothing_of_the_robot_again(campaign, tmp_path, monkeypatch):
    monkeypatch.setattr(Model, "remarks", ("The base gives way.",))
    broken = tmp_path / "broken.csv"
    broken.write_text("time_s,force_n\n0,0\n0.001,1\n")
    (report,) = campaign.import_paths((broken,), "P001")
    assert len(report.refused) == 1
    assert not set(campaign.model.remarks) & set(report.remarks)


def test_what_is_wrong_with_hits_is_asked_about(two, there):
    """Axes of files that do not say them themselves."""

    def asked(*along, louder=1.0, off_deg=0.0):
        turned = dict(zip("xyz", along or ("+x", "+y", "+z"), strict=True))
        hits = tuple(
            replace(h, axis=turned[h.axis[1]], acceleration_m_s2=louder * h.acceleration_m_s2)
            for h in there.hits
        )
        stated = *STOOD[:2], STOOD[2] + off_deg, STOOD[3]
        found = question_about(
            Claim(two.model, two.state, "X1", stated), MeasuredPose((), BAND_HZ, given=hits)
        )
        return (found.about, found.text) if found else None

    def said(found, about, words):
        assert found[0] == about
        assert words in found[1]
        return found[1].split(words)[1]

    assert asked() is None
    said(asked("+x", "+z", "+y"), "chain", "were those along y along z, z along y?")
    said(asked("-x", "+y", "+z"), "chain", "hits along x look struck the other way")
    said(asked(louder=1.12), "chain", "12 % too large")
    read = said(asked(off_deg=20.0), "readback", "fit joint_3 at ")
    assert abs(float(read.split("°")[0]) - STOOD[2]) < 0.5


def test_angles_in_radians_are_asked_about_as_that(two):
    state = SimpleNamespace(proposals={"P9": SimpleNamespace(joints_deg=tuple(STOOD))})
    for typed, said in (
        (tuple(np.deg2rad(STOOD) + 0.01), "are its angles in radians?"),
        ((*STOOD[:2], STOOD[2] + 8, STOOD[3]), "(joint_3 at"),
    ):
        (asked,) = pose_mismatch._setpoint(Claim(two.model, state, "P9", typed))
        assert said in asked.what


def test_angles_at_the_first_pose_are_held_against_its_setpoint(first_pose):
    """FRFs tell nothing then, for the simulation alone lacks too much."""
    table, angle = first_pose.made / TABLE, first_pose.joints_deg[4]
    text, campaign = table.read_text(), Campaign(first_pose.cell)
    read = text.splitlines()[1].split(",")[5]
    for off_deg, asks in ((60.0, True), (3.0, False)):
        table.write_text(text.replace(f",{read},", f",{angle - off_deg:.4f},"))
        (report,) = campaign.import_paths((first_pose.made,))
        assert (report.question is not None) == asks
        if report.question is not None:
            assert report.question.about == "readback"
            assert "60.00° from its setpoint" in report.question.text
            campaign.undo()


def test_another_pose_is_asked_about_before_three_are_measured(campaign, there, truth, tmp_path):
    campaign.undo(), campaign.undo()  # a proposal, and the second pose
    (first,) = campaign.state.used
    again = measured_at(truth, tmp_path / "again", list(first.joints_deg))
    claim = Claim(campaign.model, campaign.state, "X", tuple(STOOD))
    assert question_about(claim, there) is None
    # A wrong chain is asked about too; what fits nothing that is known is not after one pose.
    for change, words in (("acceleration_m_s2", "1000 times too large"), ("sampling_rate_hz", "")):
        by = 1e3 if words else 1.5
        hits = tuple(replace(h, **{change: by * getattr(h, change)}) for h in there.hits)
        asked = question_about(claim, MeasuredPose((), BAND_HZ, given=hits))
        assert bool(asked) == bool(words)
        assert words in (asked.text if asked else "")
    repeated = question_about(claim, again)
    assert repeated is not None
    assert repeated.fits == "P001"
    assert "are like those measured at P001" in repeated.text
    # Only what is like the hits of then may repeat them.
    for one, repeats in ((again, True), (there, False)):
        found = [a.pose for a in known_poses(claim, one.one_hit_frf.within(BAND_HZ))]
        assert ("P001" in found) == repeats


def test_how_an_angle_of_a_pose_before_is_corrected(tmp_path):
    asked = Question("These hits contradict those of P001.", fits="P001", about="earlier")
    assert "--pose P001b" in how_to_answer(tmp_path, "P002", asked)
    # Of new hits of the same pose `withdraw` would set aside these: their import is undone first.
    own = how_to_answer(tmp_path, "P001", asked)
    assert own.index("planner undo") < own.index("planner withdraw") < own.index("--pose P001b")
    assert "--pose P001c" in own


def test_other_commands_take_poses_where_they_stood(campaign, monkeypatch):
    stated = [np.deg2rad(m.joints_deg) for m in campaign.state.used]
    assert all(np.array_equal(r.q, stated[0]) for r in campaign.used_recordings[:9])
    monkeypatch.setattr(LowFidelity, "stood", lambda self, q: q + 0.1)
    monkeypatch.setattr(LowFidelity, "misread", ("At P001 a1 stood elsewhere.",))
    np.testing.assert_allclose(campaign.used_recordings[0].q, stated[0] + 0.1)
    assert campaign.dataset(BAND_HZ).remarks[0] == "At P001 a1 stood elsewhere."


@pytest.mark.slow
def test_more_hits_at_a_measured_pose_are_looked_at_alone(campaign, truth, tmp_path):
    before = campaign.state.used
    extra = record(truth, tmp_path / "extra", "X1", STOOD) / "data" / "X1_px_1.uff"
    (report,) = campaign.import_paths((extra,), "P002")
    assert report.question is not None
    assert [h.file for h in report.refused] == [str(extra)]
    assert len(campaign.state.measurements["P002"].hits) == 9
    assert campaign.state.used == before


def test_refused_files_stay_out_unless_they_are_named(first_pose):
    campaign, pose, files = Campaign(first_pose.cell), first_pose.pose, first_pose.files
    version = campaign.state.model_version
    campaign.refuse(pose, files[:3])
    again = Campaign(campaign.directory)
    listed = [r for r in status(again).to_json()["refused"] if r["pose"] == pose]
    assert [r["file"] for r in listed] == [str(path) for path in files[:3]]
    assert {r["reason"] for r in listed} == {"refused by the engineer"}
    assert again.state.model_version == version
    (report,) = again.import_paths((first_pose.made,))
    assert len(report.accepted) == 6
    assert [hit.file for hit in report.left_out] == [str(path) for path in files[:3]]
    (report,) = again.import_paths((files[0],), pose)
    assert len(report.accepted) == 1
    assert any(f"refused by the engineer at {pose} before" in text for text in report.remarks)
    assert len(again.state.refused) == 2
    assert all(step.check in ("identical", "kept") for step in replay(again))
    for _ in range(3):
        again.undo()
    assert not again.state.refused
    assert not again.state.measurements
