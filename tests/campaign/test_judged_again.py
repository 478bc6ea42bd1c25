"""Files that come again: in use, refused, held, shown at another pose; acts that are redone."""

import json

import pytest

from planner.campaign.campaign import Campaign
from planner.campaign.store import sha256
from planner.dataset.screened_files import Source
from planner.recording.folder import TABLE
from planner.replay import replay
from tests.support.hit_csv import write_csv
from tests.support.outside import call, make_cell, record


@pytest.fixture
def cell(tmp_path):
    """A campaign whose folder has a blank, a proposed pose, and what was recorded there."""
    robot, plan, truth = make_cell(tmp_path)
    campaign = Campaign.new(tmp_path / "cell 7", robot, plan)
    pose = campaign.next()[0]
    made = record(truth, tmp_path / "made", pose.pose, pose.joints_deg)
    return campaign.directory, truth, pose, made


def without_axes(made):
    """The recordings as files that do not say their axis, and no table: its text."""
    for path in sorted((made / "data").iterdir()):
        (hit,), _ = Source(path, path.name).read()
        write_csv(made / f"{path.stem}.csv", hit, stated=False)
        path.unlink()
    table = (made / TABLE).read_text().replace("data/", "").replace(".uff", ".csv")
    (made / TABLE).unlink()
    return table


def test_refused_files_are_judged_again_once_a_table_lists_them(cell):
    folder, _, pose, made = cell
    table = without_axes(made)
    for _ in range(2):  # nothing changed: nothing more is in the log, and it is told again
        code, out, said = call("import", folder, made)
        assert (code, said.count("axis")) == (3, 9), said
        assert "known before" not in out
        assert len(Campaign(folder).entries) == 3
    (made / TABLE).write_text(table)
    code, out, _ = call("import", folder, made, "--json")
    assert (code, len(json.loads(out)["accepted"])) == (0, 9)
    (measured,) = Campaign(folder).state.used
    assert all(hit.accepted for hit in measured.hits)
    # The same again, with and without a proposal that it could be taken for.
    for _ in range(2):
        code, out, _ = call("import", folder, made)
        assert code == 0
        assert f"9 files imported before as {pose.pose}; nothing changed." in out
        call("next", folder)
    assert all(step.check in ("identical", "kept") for step in replay(Campaign(folder)))


def test_the_same_files_without_a_table_are_of_the_pose_they_were_imported_at(cell):
    folder, _, pose, made = cell
    assert call("import", folder, made / "data")[0] == 0
    call("next", folder)
    code, out, _ = call("import", folder, made / "data")
    assert (code, f"imported before as {pose.pose}" in out) == (0, True)
    code, _, said = call("import", folder, made / "data", "--pose", "P002")
    assert (code, f"a recording of pose {pose.pose}" in said) == (2, True)


def test_held_files_are_judged_again_once_their_row_is_corrected(cell):
    folder, _, pose, made = cell
    table = (made / TABLE).read_text()
    (made / TABLE).write_text(table.replace(",+z,1,", ",+y,9,"))
    code, _, said = call("import", folder, made)
    first = len(Campaign(folder).entries)
    assert code == 3, said
    (made / TABLE).write_text(table)
    code, _, said = call("import", folder, made)
    assert code == 0, said
    assert len(Campaign(folder).state.used[0].accepted) == 9
    assert not Campaign(folder).state.held
    assert len(Campaign(folder).entries) > first
    assert pose.pose in Campaign(folder).state.measurements


def test_what_was_shown_at_a_pose_is_not_imported_at_another_by_its_folder(cell):
    folder, _, pose, made = cell
    files = sorted((made / "data").iterdir())
    campaign = Campaign(folder)
    campaign.show(pose.pose, [sha256(path.read_bytes()) for path in files])
    campaign.skip(pose.pose)
    other = campaign.next()[0].pose
    for more in ((), ("--pose", other)):
        code, _, said = call("import", folder, made / "data", *more)
        assert code == 3
        assert said.count(f"it came at {pose.pose}, and nobody said that it is of {other}") == 9
    assert not Campaign(folder).state.recorded
    assert call("import", folder, *files, "--pose", other)[0] == 0
    assert Campaign(folder).state.used[0].pose == other


def test_what_was_taken_back_last_can_be_done_again(cell):
    folder, _, pose, made = cell
    code, _, said = call("redo", folder)
    assert (code, "no act that was taken back last" in said) == (2, True)
    call("import", folder, made)
    call("next", folder)
    before = Campaign(folder).state
    for by in ({}, {"decisions_only": True}):
        Campaign(folder).undo(**by)
        Campaign(folder).next()  # as a session does of itself
        code, out, _ = call("redo", folder)
        assert (code, "holds again" in out) == (0, True)
        after = Campaign(folder).state
        assert (after.measurements, after.open) == (before.measurements, before.open)
        assert call("redo", folder)[0] == 2
    # One after the other, in the order in which they were.
    Campaign(folder).star(pose.pose)
    Campaign(folder).undo()
    Campaign(folder).undo(decisions_only=True)
    assert not Campaign(folder).state.used
    for starred in (False, True):
        Campaign(folder).redo()
        state = Campaign(folder).state
        assert (bool(state.used), bool(state.starred)) == (True, starred)
    Campaign(folder).undo()
    Campaign(folder).skip(state.open[0])
    assert call("redo", folder)[0] == 2
    assert all(step.check in ("identical", "kept") for step in replay(Campaign(folder)))


def test_commands_to_be_copied_are_quoted_and_on_one_line(cell, tmp_path):
    folder, _, _, _ = cell
    long = tmp_path / ("a long name " * 6)
    code, out, _ = call("new", long, "--robot", tmp_path / "robot" / "robot.toml")
    assert code == 0
    assert f"Next: planner next '{long}'" in out
    code, out, _ = call("next", folder)
    said = " ".join(out.split())
    assert "The target is not reached yet; what lacks: " in said
    assert "3 more poses, as 3 are the least (measurements_min)" in said
