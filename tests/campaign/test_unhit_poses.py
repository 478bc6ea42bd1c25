"""A pose of which every hit was refused is still to be measured, and counts nowhere as measured."""

import shutil

import pytest

from planner.campaign.campaign import Campaign
from tests.support.outside import call, make_cell, record, told


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A new campaign with a proposal, what was recorded there, and a file that is no recording."""
    root = tmp_path_factory.mktemp("unhit")
    robot, plan, truth = make_cell(root, learns=False)
    assert call("new", root / "cell", "--robot", robot, "--campaign", plan)[0] == 0
    pose = told("next", root / "cell")["proposals"][0]
    bad = root / "notes.sh"
    bad.write_text("no recording")
    return root / "cell", pose, record(truth, root / "good", pose["pose"], pose["joints_deg"]), bad


@pytest.fixture
def refused(made, tmp_path):
    """A copy of it, after the import of the file that is no recording."""
    cell = shutil.copytree(made[0], tmp_path / "cell")
    code, out, _ = call("import", cell, made[3])
    assert code == 3
    return cell, out


def test_the_pose_stays_open_and_nothing_is_counted(refused, made):
    cell, said = refused
    name, joints = made[1]["pose"], made[1]["joints_deg"]
    assert "still to be measured" in " ".join(said.split())
    assert "→" not in said  # nothing changed, so no change is told
    assert "expected (Hz)" not in said
    found = told("status", cell)
    assert (found["measurements"], found["used"]) == ([], 0)
    assert [p["pose"] for p in found["open"]] == [name]
    again = told("next", cell)["proposals"][0]
    assert (again["pose"], again["joints_deg"]) == (name, joints)
    assert call("withdraw", cell, name)[0] == 2
    report = told("report", cell)
    assert report["measurements"] == 0
    code, _, err = call("import", cell, made[2])
    assert code == 0, err
    (cell / "more.sh").write_text("no recording either")
    assert "SIMULATED" in call("import", cell, cell / "more.sh", "--pose", name)[1]
    poses = cell / "poses.csv"
    columns = Campaign(cell).cell.robot.joints.columns
    poses.write_text(",".join(["pose", *columns]) + "\n" + ",".join(["a", *map(str, joints)]))
    assert told("predict", cell, poses)["measurements"] == told("status", cell)["used"] == 1
    assert "1 pose measured" in " ".join(call("status", cell)[1].split())
    assert told("replay", cell)["reproduced"]


def test_undo_takes_the_refused_import_back(refused, made):
    cell, _ = refused
    told("next", cell)
    undone = told("undo", cell)
    assert undone["event"] == "imported"
    assert "refused all of 1 hit" in undone["what"]
    assert told("next", cell)["proposals"][0]["pose"] == made[1]["pose"]
    assert told("status", cell)["refused"] == []


def test_another_readback_is_taken_where_nothing_was_accepted(refused, made, tmp_path):
    """The first file's angles were those of the proposal; the robot stood a little beside it."""
    cell, _ = refused
    folder = shutil.copytree(made[2], tmp_path / "beside")
    table = folder / "recordings.csv"
    first = made[1]["joints_deg"][0]
    lines = [line.split(",") for line in table.read_text().splitlines()]
    column = next(k for k, name in enumerate(lines[0]) if name.startswith("joint"))
    for line in lines[1:]:
        line[column] = str(first + 0.5)
    table.write_text("\n".join(map(",".join, lines)) + "\n")
    assert call("import", cell, folder)[0] == 0
    assert Campaign(cell).state.used[0].joints_deg[0] == pytest.approx(first + 0.5)
