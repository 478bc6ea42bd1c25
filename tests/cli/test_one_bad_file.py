"""One bad file, name, byte or disk does not keep the rest of a campaign from going on."""

import errno
import hashlib
import json
import os
import shutil
from pathlib import Path

import pytest

from planner.campaign import journal
from planner.campaign.campaign import Campaign
from planner.campaign.journal import Journal
from planner.errors import InputError
from planner.recording.hits import hits_from
from planner.recording.read import read
from planner.robot.mesh_files import copy_meshes
from planner.words import by_reason
from tests.support.hit_files import columns
from tests.support.odd_recordings import ODD
from tests.support.outside import call, refused, told

TRIED = ["an external link", "a flipped byte in gzip", "an acceleration of 1e200",
         "FRFs of unequal length", "spectra that are a word", "rates that differ"]  # fmt: skip


@pytest.fixture
def cell(first_pose) -> Path:
    return first_pose.cell


def test_bad_files_are_refused_and_the_others_imported(first_pose, tmp_path):
    cell, folder = first_pose.cell, first_pose.made
    good = next((folder / "data").glob("*px_1.uff"))
    (hit,) = hits_from(read(good))
    table = (folder / "recordings.csv").read_text().splitlines()
    for number, what in enumerate(TRIED, 11):
        name, write = ODD[what]
        write(folder / "data" / name, columns(hit, hit.sampling_rate_hz))
        row = table[1].split(",")
        table.append(",".join([*row[:-2], str(number), f"data/{name}"]))
    (folder / "recordings.csv").write_text("\n".join(table) + "\n")
    code, out, err = call("import", cell, folder, "--json")
    answer = json.loads(out)
    assert code == 3, err
    assert len(answer["accepted"]) == 9
    assert len(answer["refused"]) == len(TRIED)
    assert len([line for line in err.splitlines() if line.startswith("Refused")]) == len(TRIED)
    assert "inside" not in err
    # A kept recording that is no longer what was imported is named by whoever reads it next.
    kept = next(p for p in (cell / "recordings").glob("*.uff"))
    kept.write_bytes(kept.read_bytes()[:-100])
    more = tmp_path / "more" / "again_px_1.uff"
    more.parent.mkdir()
    more.write_bytes(good.read_bytes() + b"\n")
    err = refused("import", cell, more, "--pose", first_pose.pose)
    assert (kept.name in err, "restore it" in err) == (True, True), err


def test_files_refused_alike_are_one_sentence():
    files = [(f"d/P3_{i}.csv", f"d/P3_{i}.csv has no force; export it.") for i in (2, 3, 1)]
    files.append(("d/other.csv", "other.csv is empty; export it."))
    assert by_reason(files) == [
        "3 files (d/P3_1.csv, P3_2.csv and P3_3.csv): the file has no force; export it.",
        "d/other.csv: other.csv is empty; export it.",
    ]


def test_a_pose_whose_name_looks_like_markup(first_pose, cell):
    table = first_pose.made / "recordings.csv"
    table.write_text(table.read_text().replace(f"{first_pose.pose},", "[/red],"))
    for command in (("import", cell, table), ("status", cell), ("withdraw", cell, "[/red]")):
        code, out, err = call(*command)
        assert (code, "[/red]" in out) == (0, True), err


def rewritten(cell: Path, name: str, digest: str) -> None:
    """Let the log's first entry name another file of the robot folder, with a right check."""
    log = cell / "log.jsonl"
    entry = json.loads(log.read_bytes().splitlines()[0])["entry"]
    entry["event"]["robot"][name] = digest
    body = json.dumps(entry, separators=(",", ":")).encode()
    check = hashlib.sha256(body).hexdigest()[:16].encode()
    log.write_bytes(b'{"check":"%s","entry":%s}\n' % (check, body))


@pytest.mark.parametrize("name", ["../../evil.txt", "ABSOLUTE", "a/../../../evil.txt"])
def test_a_crafted_campaign_writes_nothing_outside(cell, tmp_path, name):
    target = tmp_path / "evil.txt"
    data = b"evil"
    digest = hashlib.sha256(data).hexdigest()
    (cell / "recordings" / f"{digest}.robot").write_bytes(data)
    rewritten(cell, str(target) if name == "ABSOLUTE" else name, digest)
    assert "not one that planner wrote" in refused("replay", cell)
    assert not list(tmp_path.rglob("evil.txt"))


def test_a_changed_copy_of_the_robot_is_named(cell):
    kept = next((cell / "recordings").glob("*.robot"))
    kept.write_bytes(kept.read_bytes() + b" ")
    assert kept.name in refused("replay", cell)


def test_meshes_are_copied_into_the_new_folder_only(tmp_path):
    source, target = tmp_path / "deep" / "in" / "arm.urdf", tmp_path / "out" / "arm.urdf"
    source.parent.mkdir(parents=True)
    target.parent.mkdir()
    for path in (source.parent / "near.stl", source.parents[2] / "far.stl"):
        path.write_bytes(b"solid")
    meshes = "".join(f'<mesh filename="{name}"/>' for name in ("near.stl", "../../far.stl"))
    copy_meshes(f"<robot>{meshes}</robot>", source, target)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["far.stl", "near.stl"]
    assert sorted(p.name for p in tmp_path.glob("*.stl")) == ["far.stl"]


def test_a_byte_order_mark_is_no_fault(first_pose_once, tmp_path):
    for folder in (first_pose_once.robot.parent, first_pose_once.plan.parent):
        shutil.copytree(folder, tmp_path / folder.name)
    robot, plan = tmp_path / "robot" / "robot.toml", tmp_path / "plan" / "campaign.toml"
    for path in (robot, plan):
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    told("new", tmp_path / "cell", "--robot", robot, "--campaign", plan)
    assert told("status", tmp_path / "cell")["measurements"] == []


def test_halves_of_killed_writers_are_removed(first_pose_once, tmp_path):
    (tmp_path / f".cell.{2**22 + 1}.part").mkdir()  # no process has that number
    robot, plan = first_pose_once.robot, first_pose_once.plan
    told("new", tmp_path / "cell", "--robot", robot, "--campaign", plan)
    (tmp_path / "cell" / "recordings" / ".abc.uff.123.part").write_bytes(b"half")
    told("next", tmp_path / "cell")
    assert not list(tmp_path.rglob("*.part"))


def test_a_full_disk_is_said_in_a_sentence_and_loses_nothing(cell, monkeypatch):
    before = (cell / "log.jsonl").read_bytes()

    def full(handle):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(journal.os, "fsync", full)
        code, out, err = call("next", cell, "--count", 2)
    assert (code, out) == (2, "")
    assert "No space left" in err
    assert "inside" not in err
    assert (cell / "log.jsonl").read_bytes() == before
    assert not list(cell.rglob("*.part"))
    assert told("next", cell)["proposals"]


def test_who_holds_a_campaign_is_named(cell):
    campaign = Campaign(cell)
    with campaign.holding():
        campaign.next()  # the holder itself need not wait
        with (
            pytest.raises(InputError, match=rf"process {os.getpid()} of"),
            Journal(cell / "log.jsonl").writing(wait_s=0.05),
        ):
            pass
    assert not (cell / "log.holder").exists()
    assert Campaign(cell).next()
