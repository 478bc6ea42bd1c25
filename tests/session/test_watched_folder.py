"""What comes into the watched folder beside hits: tables in subfolders, without joints; streams."""

import csv
import shutil

import pytest

from planner.campaign.campaign import Campaign
from planner.dataset.screened_files import Source
from planner.recording.folder import TABLE
from planner.session.inbox import FolderTable
from tests.support.hit_files import write_hit
from tests.support.outside import HAMMER, call
from tests.support.streams import joined, write_wav


@pytest.fixture
def posed(cell, first_pose):
    """A campaign with a proposed pose, what was recorded there, and a folder to watch."""
    campaign, _, inbox = cell
    return campaign, campaign.next()[0], first_pose.made, inbox


def without(folder, unwanted):
    """The table without some columns, and files that do not say their axis themselves."""
    with (folder / TABLE).open() as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        path = folder / row["file"]
        (hit,), _ = Source(path, path.name).read()
        write_hit(path.with_suffix(".csv"), hit, stated=False)
        path.unlink()
        row["file"] = row["file"].replace(".uff", ".csv")
    kept = [name for name in rows[0] if not unwanted(name)]
    with (folder / TABLE).open("w", newline="") as file:
        writer = csv.DictWriter(file, kept, extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)


@pytest.mark.parametrize("by", ["session", "import"])
def test_a_table_without_joints_is_of_proposed_poses(posed, session, by):
    """Axis and pose come from it, the joints from the proposal."""
    campaign, pose, made, inbox = posed
    without(made, lambda name: name.endswith("_deg"))
    shutil.copytree(made, inbox / "export")
    if by == "session":
        said = session(campaign, inbox, until="go to pose P002").flat
        assert "along which axis" not in said
    else:
        assert call("import", campaign.directory, inbox)[0] == 0
    (measured,) = Campaign(campaign.directory).state.used
    assert (measured.pose, measured.joints_deg) == (pose.pose, pose.joints_deg)
    assert len(measured.accepted) == 9


def test_a_table_of_another_pose_without_joints_says_what_it_lacks(posed, session):
    campaign, pose, made, _ = posed
    without(made, lambda name: name.endswith("_deg"))
    table = made / TABLE
    table.write_text(table.read_text().replace(f"{pose.pose},", "P077,"))
    code, _, said = call("import", campaign.directory, made)
    assert code == 2
    assert "No joint angles are known for pose P077; give recordings.csv columns of" in said


def test_hits_of_another_pose_by_their_table_are_not_counted_here(posed, session):
    campaign, pose, made, inbox = posed
    table = made / TABLE
    table.write_text(table.read_text().replace(f"{pose.pose},", "X1,"))
    shutil.copytree(made, inbox / "export")
    said = session(campaign, inbox, until="X1: 9 hits in").flat
    assert "not from here: of X1 by recordings.csv" in said
    assert "all hits are in" not in said
    assert [m.pose for m in campaign.state.used] == ["X1"]


def test_a_left_over_file_of_the_pose_before_is_left_out_alone(posed, first_pose, session):
    campaign, pose, made, inbox = posed
    campaign.import_paths((made,))
    second = campaign.next()[0]
    there = first_pose.at(inbox / "there", second.pose, second.joints_deg)
    (left,) = (there / "data").glob("*z_3.uff")
    shutil.copy(next((made / "data").glob("*z_1.uff")), left)
    said = session(campaign, inbox, until="8 hits in").flat
    assert "the same data are in use as" in said
    assert f"of pose {pose.pose}; put what was recorded at" in said
    assert [len(m.accepted) for m in campaign.state.used] == [9, 8]


def test_an_angle_that_no_joint_reaches_is_said_at_once_and_read_again(posed, session):
    campaign, pose, made, inbox = posed
    right = (made / TABLE).read_text()
    stated = right.splitlines()[1].split(",")[1]
    (made / TABLE).write_text(right.replace(f",{stated},", ",624.87,"))
    shutil.copytree(made, inbox / "export")
    said = "at 624.87° is outside its limits"
    assert said in session(campaign, inbox, until=said).flat
    robot = campaign.cell.robot
    table = FolderTable(inbox, robot.joints, robot.points, campaign.cell.check_pose)
    path = inbox / "export" / TABLE
    assert (table.follow(), [where for where, _ in table.waiting]) == (set(), [path])
    path.write_text(right)
    assert (table.follow(), table.waiting, table.follow()) == ({path}, [], set())
    session(campaign, inbox, until="go to pose P002")
    assert [m.pose for m in campaign.state.used] == [pose.pose]


def test_a_table_without_one_of_the_joints_is_not_followed_and_says_why(posed, session):
    campaign, _, made, inbox = posed
    without(made, lambda name: name == "joint_a2_deg")
    shutil.copytree(made, inbox / "export")
    said = session(campaign, inbox, until="has no column").flat
    assert "cannot be used: recordings.csv" in said
    assert "has no column joint_a2_deg" in said
    assert not campaign.state.used


def test_streams_wait_for_their_scales_and_are_judged_hit_by_hit(cell, first_pose, session):
    campaign, _, inbox = cell
    rate = round(HAMMER.sampling_rate_hz)
    for axis in "xyz":
        samples = joined(first_pose.made, f"p{axis}")
        if axis == "x":  # the second hit rebounds
            top = rate + int(samples[0, rate : 4 * rate].argmax())
            samples[0, top + 40 : top + 80] += 0.5 * samples[0, top - 20 : top + 20]
        write_wav(inbox / f"{axis}.wav", samples, f"+{axis}", rate_hz=rate)
    table = (inbox / "channels.csv").read_text()
    (inbox / "channels.csv").unlink()

    def scale(text):
        if "says nothing of scale" not in " ".join(text.split()):
            return False
        (inbox / "channels.csv").write_text(table)
        return True

    text = session(
        campaign, inbox, (scale, "s"), ("3 hits in x.wav: 2 good", "a"), ("Hits are missing", "a"),
        ("P001: 8 hits in", "q"), limit_s=40,
    ).flat  # fmt: skip
    assert "3 hits in y.wav: 3 good" in text
    assert "refused x.wav (hit 2 at 2.47 s)" in text
    assert len(campaign.state.used[0].accepted) == 8
