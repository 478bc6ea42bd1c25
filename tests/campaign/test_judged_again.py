"""Files that come again: in use, refused, held, shown at another pose; acts that are redone."""

import hashlib
import json
import shutil
from pathlib import Path

import pytest

from planner.campaign.campaign import Campaign
from planner.dataset.screened_files import Source
from planner.recording.folder import TABLE
from planner.replay import replay
from tests.support.hit_files import write_hit
from tests.support.outside import FirstPose, call


@pytest.fixture
def first(first_pose_once, tmp_path) -> FirstPose:
    """A campaign whose folder has a blank, a proposed pose, and what was recorded there."""
    return first_pose_once.copied(tmp_path, "cell 7")


def reproduced(folder) -> bool:
    return all(step.check in ("identical", "kept") for step in replay(Campaign(folder)))


def without_axes(first: FirstPose) -> str:
    """The recordings as files that do not say their axis, and no table: its text."""
    for path in first.files:
        (hit,), _ = Source(path, path.name).read()
        write_hit(first.made / f"{path.stem}.csv", hit, stated=False)
        path.unlink()
    table = (first.made / TABLE).read_text().replace("data/", "").replace(".uff", ".csv")
    (first.made / TABLE).unlink()
    return table


def test_refused_files_are_judged_again_once_a_table_lists_them(first):
    folder, made = first.cell, first.made
    table = without_axes(first)
    for _ in range(2):  # nothing changed: nothing more is in the log, and it is told again
        code, out, said = call("import", folder, made)
        assert (code, "Refused 9 files" in said) == (3, True), said
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
        assert f"9 files imported before as {first.pose}; nothing changed." in out
        call("next", folder)
    assert reproduced(folder)


def test_the_same_files_without_a_table_are_of_the_pose_they_were_imported_at(first):
    folder, pose, made = first.cell, first.pose, first.made
    assert call("import", folder, made / "data")[0] == 0
    call("next", folder)
    code, out, _ = call("import", folder, made / "data")
    assert (code, f"imported before as {pose}" in out) == (0, True)
    copied = shutil.copytree(made / "data", made.parent / "copied")
    code, out, _ = call("import", folder, copied)
    one, *others = first.files
    told = f"{copied / one.name} has the same data as {one}, imported as {pose} "
    told += f"({len(others)} more files are copies, too); nothing changed."
    assert (code, "".join(told.split()) in "".join(out.split())) == (0, True)
    code, _, said = call("import", folder, made / "data", "--pose", "P002")
    assert (code, f" of pose {pose}; put" in said) == (2, True)


def test_held_files_are_judged_again_once_their_row_is_corrected(first):
    folder, made = first.cell, first.made
    table = (made / TABLE).read_text()
    (made / TABLE).write_text(table.replace(",+z,1,", ",+y,9,"))
    code, _, said = call("import", folder, made)
    entries = len(Campaign(folder).entries)
    assert code == 3, said
    (made / TABLE).write_text(table)
    code, _, said = call("import", folder, made)
    assert code == 0, said
    after = Campaign(folder)
    assert len(after.state.used[0].accepted) == 9
    assert not after.state.held
    assert len(after.entries) > entries
    assert first.pose in after.state.measurements


def test_a_newer_file_takes_the_place_of_the_one_in_use(first, tmp_path):
    folder, made = first.cell, first.made
    assert call("import", folder, made)[0] == 0
    newer = first.at(tmp_path / "newer", first.pose, first.joints_deg, seed=5)
    (one,) = (newer / "data").glob("*y_2.uff")
    before = (made / "data" / one.name).read_bytes()
    shutil.copy(one, made / "data" / one.name)
    code, out, said = call("import", folder, made)
    assert (code, f"replaced by a newer {one.name}" in " ".join(out.split())) == (0, True), said

    def used():
        (measured,) = Campaign(folder).state.used
        contents = {hit.sha256 for hit in measured.accepted}
        return len(measured.accepted), *(
            hashlib.sha256(b).hexdigest() in contents for b in (before, one.read_bytes())
        )

    assert used() == (9, False, True)
    # The old one comes again, and the new one is taken back.
    (made / "data" / one.name).write_bytes(before)
    assert (call("import", folder, made)[0], used()) == (3, (9, False, True))
    assert (call("undo", folder)[0], used()) == (0, (9, True, False))
    assert (call("redo", folder)[0], used()) == (0, (9, False, True))
    # A bad one does not.
    (made / "data" / one.name).write_text("time_s,force_n\n0,1\n")
    assert (call("import", folder, made)[0], used()) == (3, (9, False, True))
    assert reproduced(folder)


def test_a_withdrawn_pose_says_how_its_hits_are_used_again(first):
    folder, pose, made = first.cell, first.pose, first.made
    assert call("import", folder, made)[0] == 0
    assert call("withdraw", folder, pose)[0] == 0
    code, _, said = call("import", folder, made)
    assert (code, said.count("Refused"), "9 files" in said) == (3, 1, True)
    assert f"planner confirm '{folder}' {pose}" in said
    assert call("confirm", folder, pose)[0] == 0
    assert len(Campaign(folder).state.used[0].accepted) == 9
    # Under another name they are hits as any other.
    assert call("withdraw", folder, pose)[0] == 0
    table = (made / TABLE).read_text()
    (made / TABLE).write_text(table.replace(f"{pose},", "X1,"))
    assert call("import", folder, made)[0] == 0
    assert [m.pose for m in Campaign(folder).state.used] == ["X1"]


def test_a_file_of_another_pose_does_not_keep_the_others_out(first, tmp_path):
    folder, pose = first.cell, first.pose
    assert call("import", folder, first.made)[0] == 0
    second = Campaign(folder).next()[0]
    there = first.at(tmp_path / "there", second.pose, second.joints_deg)
    (left,) = (there / "data").glob("*z_3.uff")
    shutil.copy(next((first.made / "data").glob("*z_1.uff")), left)
    code, _, said = call("import", folder, there)
    assert (code, said.count("Refused"), left.name in said) == (3, 1, True)
    assert f"of pose {pose}; put what was recorded at {second.pose}" in said
    assert f"(planner withdraw '{folder}' {pose})" in " ".join(said.split())
    assert [len(m.accepted) for m in Campaign(folder).state.used] == [9, 8]


def test_corrected_angles_of_held_hits_are_taken(first):
    folder, pose, made = first.cell, first.pose, first.made
    names, *rows = (line.split(",") for line in (made / TABLE).read_text().splitlines())
    joint, sign = (names.index(name) for name in ("joint_a1_deg", "hit"))
    few = [row for row in rows if row[names.index("repeat")] != "3"]
    few[-1][sign] = "-" + few[-1][sign][1:]  # it contradicts the other one: they are held
    typed = [[*row[:joint], f"{float(row[joint]) + 9:.3f}", *row[joint + 1 :]] for row in few]

    def imported(rows):
        (made / TABLE).write_text("\n".join(map(",".join, [names, *rows])))
        code, _, said = call("import", folder, made)
        return code, said, Campaign(folder).state

    for given in (typed, few):
        code, said, state = imported(given)
        assert (code, state.held[pose].joints_deg[0]) == (3, float(given[0][joint])), said
    assert call("confirm", folder, pose)[0] == 0
    code, said, _ = imported(typed)  # in use, they stay
    assert (code, "9.00° away" in said, "planner undo" in said) == (2, True, True)


def test_what_was_shown_at_a_pose_is_not_imported_at_another_by_its_folder(first):
    folder, pose, files = first.cell, first.pose, first.files
    campaign = Campaign(folder)
    campaign.show(pose, [hashlib.sha256(path.read_bytes()).hexdigest() for path in files])
    campaign.skip(pose)
    other = campaign.next()[0].pose
    for more in ((), ("--pose", other)):
        code, _, said = call("import", folder, first.made / "data", *more)
        assert code == 3
        assert f"it came at {pose}, and nobody said that it is of {other}" in said
    assert not Campaign(folder).state.recorded
    assert call("import", folder, *files, "--pose", other)[0] == 0
    assert Campaign(folder).state.used[0].pose == other


def test_what_was_taken_back_last_can_be_done_again(first):
    folder = first.cell
    code, _, said = call("redo", folder)
    assert (code, "the last act was no undo" in said) == (2, True)
    call("import", folder, first.made)
    call("next", folder)
    before = Campaign(folder).state
    for by in ({}, {"decisions_only": True}):
        Campaign(folder).undo(**by)
        Campaign(folder).next()  # as a session does of itself
        code, out, _ = call("redo", folder)
        assert (code, "Redone: " in out) == (0, True)
        after = Campaign(folder).state
        assert (after.measurements, after.open) == (before.measurements, before.open)
        assert call("redo", folder)[0] == 2
    # One after the other, in the order in which they were.
    Campaign(folder).star(first.pose)
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
    assert reproduced(folder)


def test_commands_to_be_copied_are_quoted(first, tmp_path):
    long = tmp_path / ("a long name " * 6)
    code, out, _ = call("new", long, "--robot", first.robot)
    assert code == 0
    assert f"Next: planner next '{long}'" in out
    code, out, _ = call("next", first.cell)
    said = " ".join(out.split())
    assert "The target is not reached yet; what lacks: " in said
    assert "3 more poses, as 3 are the least (measurements_min)" in said


def test_a_file_that_is_named_is_what_the_table_beside_it_says(first):
    (first.made / TABLE).write_text(without_axes(first))
    files = sorted(first.made.glob("*.csv"))
    wanted = [file for file in files if file.name != TABLE][:4]
    code, out, said = call("import", first.cell, *wanted, "--json")
    assert (code, len(json.loads(out)["accepted"])) == (0, 4), said
    (measured,) = Campaign(first.cell).state.used
    assert {Path(hit.file).name for hit in measured.hits} == {file.name for file in wanted}
