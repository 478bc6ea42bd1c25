"""A pose of which every hit was refused is still to be measured, and counts nowhere as measured."""

import pytest

from planner.campaign.campaign import Campaign
from planner.recording.folder import TABLE
from tests.support.outside import call, said, told


@pytest.fixture
def refused(first_pose, tmp_path):
    """A campaign after the import of a file that is no recording, and what was said of it."""
    bad = tmp_path / "notes.sh"
    bad.write_text("no recording")
    code, out, _ = call("import", first_pose.cell, bad)
    assert code == 3
    return first_pose, out


def test_the_pose_stays_open_and_nothing_is_counted(refused):
    first, screen = refused
    cell = first.cell
    assert "still to be measured" in " ".join(screen.split())
    assert "→" not in screen  # nothing changed, so no change is told
    assert "expected (Hz)" not in screen
    found = told("status", cell)
    assert (found["measurements"], found["used"]) == ([], 0)
    assert [p["pose"] for p in found["open"]] == [first.pose]
    again = told("next", cell)["proposals"][0]
    assert (again["pose"], again["joints_deg"]) == (first.pose, first.joints_deg)
    assert call("withdraw", cell, first.pose)[0] == 2
    assert told("report", cell)["measurements"] == 0
    said("import", cell, first.made)
    (cell / "more.sh").write_text("no recording either")
    assert "SIMULATED" in call("import", cell, cell / "more.sh", "--pose", first.pose)[1]
    poses = cell / "poses.csv"
    columns = Campaign(cell).cell.robot.joints.columns
    rows = ",".join(["pose", *columns]), ",".join(["a", *map(str, first.joints_deg)])
    poses.write_text("\n".join(rows))
    assert told("predict", cell, poses)["measurements"] == told("status", cell)["used"] == 1
    assert "1 pose measured" in " ".join(said("status", cell).split())
    assert told("replay", cell)["reproduced"]


def test_undo_takes_the_refused_import_back(refused):
    cell = refused[0].cell
    told("next", cell)
    undone = told("undo", cell)
    assert undone["event"] == "imported"
    assert "refused all of 1 hit" in undone["what"]
    assert told("next", cell)["proposals"][0]["pose"] == refused[0].pose
    assert told("status", cell)["refused"] == []


def test_another_readback_is_taken_where_nothing_was_accepted(refused):
    """The first file's angles were those of the proposal; the robot stood a little beside it."""
    first, table = refused[0], refused[0].made / TABLE
    names, *rows = (line.split(",") for line in table.read_text().splitlines())
    beside = first.joints_deg[0] + 0.5
    for row in rows:
        row[names.index("joint_a1_deg")] = str(beside)
    table.write_text("\n".join(map(",".join, [names, *rows])) + "\n")
    said("import", first.cell, first.made)
    assert Campaign(first.cell).state.used[0].joints_deg[0] == pytest.approx(beside)
