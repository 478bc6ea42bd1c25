"""Refused hits, and hits of another pose than stated: in the log, asked about, not used.

`pytest -m slow tests/campaign/test_pose_mismatch.py` imports hits of a wrong sensitivity, too.
"""

import csv
import json
import shutil
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from planner.campaign import pose_mismatch
from planner.campaign.campaign import Campaign
from planner.campaign.import_checks import Claim, question_about
from planner.campaign.state import fold
from planner.campaign.store import CONFIG
from planner.dataset.measure import MeasuredPose, measure
from planner.dataset.screened_files import Source
from planner.recording.folder import TABLE
from planner.replay import replay
from planner.report.status import status
from tests.support.chain_cases import scaled
from tests.support.outside import FROZEN, call
from tests.support.shipped_campaign import RECORDINGS, shipped_campaign, shipped_pool

MEASURED = ("A11", "A57")
WRONG, CLAIMED = "A25", "A42"


@pytest.fixture(scope="module")
def pool():
    return shipped_pool()


@pytest.fixture(scope="module")
def three(tmp_path_factory, pool):
    """A campaign of two poses, to be copied."""
    campaign = shipped_campaign(tmp_path_factory.mktemp("three"))
    for pose in MEASURED:
        (report,) = campaign.import_paths((RECORDINGS,), pose)
        assert report.question is None
    return campaign.directory


@contextmanager
def unlearned(directory):
    """The simulation as stated meanwhile: a fit to hits that contradict others takes long."""
    config = directory / CONFIG
    decided = config.read_text()
    config.write_text(f"{decided}\n{FROZEN}")
    yield
    config.write_text(decided)


@pytest.fixture
def campaign(three, tmp_path):
    shutil.copytree(three, tmp_path / "campaign")
    return Campaign(tmp_path / "campaign")


def claim(folder, pool, at=CLAIMED, off_deg=(0.0,) * 6, other_way="", louder=1.0):
    """A recordings folder whose table says that the hits of WRONG, called X1, were made at `at`.

    `off_deg` is added to its angles; hits along `other_way` are said to have the other direction;
    accelerations are `louder` times as large.
    """
    (folder / "data").mkdir(parents=True)
    with open(folder / TABLE, "w", newline="") as file:
        table = csv.writer(file)
        joints = [f"joint_{i}_deg" for i in range(1, 7)]
        table.writerow(["pose", *joints, "hit", "repeat", "file"])
        for row in pool[WRONG]:
            scaled(row, folder / "data", louder)
            angles = np.add(pool[at][0].joints_deg, off_deg)
            sign, axis = row.hit
            hit = f"{'-' if sign == '+' else '+'}{axis}" if axis == other_way else row.hit
            table.writerow(["X1", *angles, hit, row.repeat, f"data/{row.file.name}"])
    return folder


@pytest.fixture(scope="module")
def wrong(tmp_path_factory, pool):
    """Hits of another pose under the name X1."""
    return claim(tmp_path_factory.mktemp("wrong") / "hits", pool)


@pytest.fixture(scope="module")
def held_once(three, wrong, tmp_path_factory):
    """The campaign in which they are held, to be copied, and what the import's command said."""
    folder = shutil.copytree(three, tmp_path_factory.mktemp("held") / "campaign")
    return folder, *call("import", folder, wrong, "--json")


@pytest.fixture
def held(held_once, tmp_path):
    return Campaign(shutil.copytree(held_once[0], tmp_path / "held"))


def test_hits_of_another_pose_are_held_until_confirmed(campaign, held, held_once, wrong):
    before, (folder, code, out, err) = campaign.model.frequency_sd_percent, held_once
    # After a crash all is known from the log, and nothing of it is used.
    again = held
    assert list(again.state.measurements) == list(MEASURED)
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
    np.testing.assert_array_equal(again.model.frequency_sd_percent, before)
    (held,) = status(again).to_json()["held"]
    assert held["question"]["text"] == asked.text
    (once_more,) = again.import_paths((wrong,))
    assert once_more.question == asked
    assert len(once_more.already) == 12
    assert call("confirm", again.directory, "A11")[0] == 2
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


def test_a_refused_import_says_nothing_of_the_robot_again(campaign, pool, tmp_path):
    broken = tmp_path / "broken.csv"
    broken.write_text("time_s,force_n\n0,0\n0.001,1\n")
    assert campaign.model.remarks
    (report,) = campaign.import_paths((broken,), "A11")
    assert len(report.refused) == 1
    assert not set(campaign.model.remarks) & set(report.remarks)


def test_hits_listed_along_wrong_axes_are_asked_about(campaign, pool):
    """Of files that do not say their axes themselves."""
    rows, band_hz = pool[WRONG], campaign.cell.config.modes.band_hz
    hits = measure([Source(row.file, row.file.name, row.hit) for row in rows], band_hz).hits

    def asked(along):
        listed = tuple(replace(h, axis=h.axis[0] + along[h.axis[1]]) for h in hits)
        measured = MeasuredPose((), band_hz, given=listed)
        claim = Claim(campaign.model, campaign.state, "X1", rows[0].joints_deg)
        return question_about(claim, measured)

    assert asked({"x": "x", "y": "y", "z": "z"}) is None
    question = asked({"x": "x", "y": "z", "z": "y"})
    assert question is not None
    assert question.about == "chain"
    assert "were those along y along z, z along y?" in question.text


@pytest.mark.parametrize(
    ("wrong", "about", "said"),
    [
        ({"off_deg": (0, 0, 8.0, 0, 0, 0)}, "readback", "fit joint_3 at"),
        ({"other_way": "x"}, "chain", "hits along x look struck the other way"),
        pytest.param({"louder": 1.12}, "chain", "12 % too large", marks=pytest.mark.slow),
    ],
)
def test_misread_angles_and_hits_from_behind_are_asked_about(
    campaign, pool, tmp_path, wrong, about, said
):
    folder = claim(tmp_path / "wrong", pool, WRONG, **wrong)
    (report,) = campaign.import_paths((folder,))
    assert report.question is not None
    assert report.question.about == about
    assert said in report.question.text
    if about == "readback":
        read = float(report.question.text.split(said)[1].split("°")[0])
        stated = np.array(pool[WRONG][0].joints_deg)
        assert abs(read - stated[int(said.split("_")[1][0]) - 1]) < 0.5


def test_angles_in_radians_are_asked_about_as_that(campaign, pool):
    sent = pool[WRONG][0].joints_deg
    state = SimpleNamespace(proposals={"P9": SimpleNamespace(joints_deg=sent)})
    for typed, said in (
        (tuple(np.deg2rad(sent) + 0.01), "are its angles in radians?"),
        ((*sent[:2], sent[2] + 8, *sent[3:]), "(joint_3 at"),
    ):
        (asked,) = pose_mismatch._setpoint(Claim(campaign.model, state, "P9", typed))
        assert said in asked.what


@pytest.mark.slow
def test_more_hits_at_a_measured_pose_are_looked_at_alone(campaign, pool, tmp_path):
    extra = tmp_path / "extra.uff"
    shutil.copy(pool["A21"][0].file, extra)
    (report,) = campaign.import_paths((extra,), "A57")
    assert report.question is not None
    assert [h.file for h in report.refused] == [str(extra)]
    assert len(campaign.state.measurements["A57"].hits) == 12
    assert campaign.state.used == fold(campaign.entries[:4]).used


def test_held_hits_set_aside_are_refused_ones_and_further_ones_wait(held, wrong, pool, tmp_path):
    other = tmp_path / "other.uff"
    shutil.copy(pool[CLAIMED][0].file, other)
    (report,) = held.import_paths((other,), "X1")
    assert "wait for an answer" in report.left_out[0].reason
    held.withdraw("X1")
    again = Campaign(held.directory)
    assert not again.state.held
    assert len(again.state.refused) == 12
    reasons = {hit.reason for _, hit in again.state.refused.values()}
    assert all(reason.startswith("refused by the engineer; held before: ") for reason in reasons)
    assert all("% off the FRFs expected" in reason for reason in reasons)
    (report,) = again.import_paths((wrong,))
    assert report.accepted == ()
    assert len(report.left_out) == 12
    assert not again.orphans()


def test_refused_files_stay_out_unless_they_are_named(tmp_path, pool):
    campaign = shipped_campaign(tmp_path, FROZEN)
    files = tuple(row.file for row in pool["A46"])
    version = campaign.state.model_version
    campaign.refuse("A46", files[:3])
    again = Campaign(campaign.directory)
    listed = [r for r in status(again).to_json()["refused"] if r["pose"] == "A46"]
    assert [r["file"] for r in listed] == [str(path) for path in files[:3]]
    assert {r["reason"] for r in listed} == {"refused by the engineer"}
    assert again.state.model_version == version
    (report,) = again.import_paths((RECORDINGS,), "A46")
    assert len(report.accepted) == 9
    assert [hit.file for hit in report.left_out] == [str(path) for path in files[:3]]
    (report,) = again.import_paths((files[0],), "A46")
    assert len(report.accepted) == 1
    assert any("refused by the engineer at A46 before" in text for text in report.remarks)
    assert len(again.state.refused) == 2
    assert all(step.check in ("identical", "kept") for step in replay(again))
    for _ in range(3):
        again.undo()
    assert not again.state.refused
    assert not again.state.measurements
