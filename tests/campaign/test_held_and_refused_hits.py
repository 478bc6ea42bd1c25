"""Hits that contradict each other are held; a pose of refused hits alone is not measured yet."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.campaign.campaign import Campaign
from planner.design.stopping import Forecast
from planner.proof.hits import simulate_hit
from planner.proof.recordings import write_uff
from planner.recording.folder import TABLE
from tests.support.outside import HAMMER, call, said, told


@pytest.fixture
def struck(first_pose):
    """A campaign, and hits at its pose: two an axis, of z the second was along y.

    Aside: a third along z, and a fourth that was along y, too.
    """
    rng, q = np.random.default_rng(1), np.deg2rad(first_pose.joints_deg)
    hits = first_pose.made / "data"
    for path in hits.glob("*_3.uff"):
        path.unlink()
    wrong = next(hits.glob("*pz_2.uff"))
    third, fourth = (first_pose.made / name for name in ("third.uff", "fourth.uff"))
    for path, axis in ((wrong, "+y"), (third, "+z"), (fourth, "+y")):
        hit = simulate_hit(first_pose.truth, q, axis, HAMMER, rng)
        write_uff(path, replace(hit, axis="+z"), HAMMER)
    return first_pose, hits, wrong, third, fourth


def names(paths) -> set[str]:
    return {Path(path).name for path in paths}


def test_the_import_is_held_and_names_the_files(struck):
    first, hits, wrong, *_ = struck
    cell = first.cell
    code, _, err = call("import", cell, hits)
    said = " ".join(err.split())
    two = [wrong.name, wrong.name.replace("_2", "_1")]
    wanted = (*two, f"planner undo {cell}", f"planner confirm {cell} {first.pose}")
    assert (code, [words for words in wanted if words not in said]) == (3, [])
    found = told("status", cell)
    assert found["used"] == 0
    question = found["held"][0]["question"]
    assert [Path(name).name for name in question["disagree"]] == two
    # Confirmed, all are used; the log is reproduced.
    told("confirm", cell, first.pose)
    assert told("status", cell)["used"] == 1
    assert told("replay", cell)["reproduced"]
    page = Path(told("report", cell)["report"]).read_text()
    assert "Joints as proposed: nothing was read back" in page  # files alone say no angles
    code, _, err = call("report", cell, "--out", cell / "none" / "x.html")
    assert (code, "make that folder" in err, (cell / "none").exists()) == (2, True, False)


def test_two_and_two_are_held_too(struck):
    first, hits, wrong, third, fourth = struck
    code, _, err = call("import", first.cell, hits, third, fourth, "--pose", first.pose)
    assert code == 3
    assert all(name in " ".join(err.split()) for name in (wrong.name, fourth.name))
    question = told("status", first.cell)["held"][0]["question"]
    every = {wrong.name, wrong.name.replace("_2", "_1"), third.name, fourth.name}
    assert names(question["disagree"]) == every


def test_a_third_hit_tells_which_was_right(struck):
    first, hits, wrong, third, _ = struck
    assert call("import", first.cell, hits)[0] == 3
    told("undo", first.cell)
    code, _, err = call("import", first.cell, hits, third, "--pose", first.pose)
    assert code == 3
    assert "held" not in err
    (used,) = Campaign(first.cell).state.used
    assert names(h.file for h in used.hits if not h.accepted) == {wrong.name}
    assert len(used.accepted) == 6


def test_where_the_simulation_misses_no_limit_is_told():
    known = Forecast(0.4, 1.3, 0.95, 1.0, 0.97, 1.0, 0.06, 2)
    doubted = known.doubted(4.2)
    assert "0.4" not in doubted.text.replace("4.2 times", "")
    assert "not known" in doubted.text
    assert "4.2 times their noise" in doubted.text
    assert doubted.rmse_percent == pytest.approx(4.2 * 0.4)
    assert doubted.reached == 0
    assert "bring the RMSE to about 0.34 %" in replace(known, gain_percent=0.06).text


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
