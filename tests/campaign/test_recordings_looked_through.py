"""Kept recordings: a damaged one is told before the next fit, and whole ones are read once."""

import os
import shutil

import pytest

from planner.campaign import store as kept_files
from planner.campaign.campaign import Campaign
from planner.campaign.kept_recordings import FoundWhole, KeptRecordings
from planner.dataset.store import Store
from planner.demo import NAME, shipped
from planner.errors import InputError
from planner.recording.points import PointNames


@pytest.fixture(scope="module")
def one(tmp_path_factory):
    """A campaign of one pose, its configuration and its measurements."""
    source, folder = shipped(NAME), tmp_path_factory.mktemp("one") / "campaign"
    campaign = Campaign.new(folder, source / "robot" / "robot.toml", source / "campaign.toml")
    campaign.import_paths((source / "recordings",), "A11")
    return folder, campaign.state.used


@pytest.fixture
def folder(one, tmp_path):
    return shutil.copytree(one[0], tmp_path / "campaign")


@pytest.fixture
def found(tmp_path):
    return Store(tmp_path / "found")


@pytest.fixture
def read(monkeypatch):
    """The files that are read, in order."""
    names, read_kept = [], kept_files.read_kept

    def told(path, digest, what):
        names.append(path)
        return read_kept(path, digest, what)

    monkeypatch.setattr(kept_files, "read_kept", told)
    return names


def look(folder, one, found):
    KeptRecordings(folder, PointNames()).look_through(one[1], found)


def test_whole_ones_are_read_once(folder, one, found, read):
    look(folder, one, found)
    files = {hit.sha256 for hit in one[1][0].accepted}
    assert {path.name[:64] for path in read} == files
    first = len(read)
    look(folder, one, found)
    assert len(read) == first
    os.utime(read[0])  # somebody has touched one
    look(folder, one, found)
    assert read[first:] == read[:1]
    (entry,) = found.folder.iterdir()
    entry.write_bytes(entry.read_bytes()[:-1])  # what is kept of them is damaged
    look(folder, one, found)
    assert len(read) == 2 * first + 1


@pytest.mark.parametrize("damage", ["cut", "flipped", "gone"])
def test_a_damaged_one_is_told(folder, one, found, read, damage):
    kept = KeptRecordings(folder, PointNames())
    kept.look_through(one[1], found)
    path, times = read[-1], read[-1].stat()
    data = path.read_bytes()
    if damage == "gone":
        path.unlink()
    else:
        flipped = data[:-1] + bytes([data[-1] ^ 1])
        path.write_bytes(data[:-1] if damage == "cut" else flipped)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    for again in (kept, KeptRecordings(folder, PointNames())):  # the same process, and the next
        with pytest.raises(InputError, match=path.name):
            again.look_through(one[1], found)
    if damage != "gone":
        path.write_bytes(data)
        look(folder, one, found)


def test_one_that_is_read_is_compared_whatever_was_found(folder, one, found, read):
    look(folder, one, found)
    path = read[-1]
    path.write_bytes(path.read_bytes()[:-1])
    status = path.stat()
    mark = status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino
    (entry,) = found.folder.iterdir()
    marks = found.get(entry.name, FoundWhole).marks | {path.name: mark}
    found.put(entry.name, FoundWhole(marks))
    look(folder, one, found)  # it is believed to be whole
    with pytest.raises(InputError, match=path.name):
        KeptRecordings(folder, PointNames()).sources(one[1][0])
