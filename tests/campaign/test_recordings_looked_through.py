"""Kept recordings: a damaged one is told before the next fit, and whole ones are read once."""

import os
import shutil

import pytest

from planner import file_content
from planner.campaign.campaign import Campaign
from planner.dataset.store import Store
from planner.errors import InputError
from tests.support.outside import FROZEN
from tests.support.shipped_campaign import RECORDINGS, shipped_campaign


@pytest.fixture(scope="module")
def one(tmp_path_factory):
    """A campaign of one pose."""
    campaign = shipped_campaign(tmp_path_factory.mktemp("one"), FROZEN)
    campaign.import_paths((RECORDINGS,), "A11")
    return campaign.directory


@pytest.fixture
def folder(one, tmp_path):
    return shutil.copytree(one, tmp_path / "campaign")


@pytest.fixture
def look(folder, tmp_path, monkeypatch):
    """Looks through a campaign's recordings as the next command does; the files that it reads."""
    read = file_content.read

    def looked():
        names = []
        with monkeypatch.context() as patched:
            patched.setattr(file_content, "_hashes", {})
            patched.setattr(file_content, "_contents", type(file_content._contents)())
            patched.setattr(file_content, "read", lambda path: names.append(path) or read(path))
            campaign = Campaign(folder, Store(tmp_path / "found"))
            campaign.recordings.look_through(campaign.state.used, Store(tmp_path / "found"))
        return [path for path in names if path.parent.name == "recordings"]

    return looked


def test_whole_ones_are_read_once(look, tmp_path):
    first = look()
    assert len(first) == 12
    assert look() == []
    os.utime(first[0])  # somebody has touched one
    assert look() == first[:1]
    (entry,) = (tmp_path / "found").iterdir()
    entry.write_bytes(entry.read_bytes()[:-1])  # what is kept of them is damaged
    assert look() == first


@pytest.mark.parametrize("damage", ["cut", "flipped", "gone"])
def test_a_damaged_one_is_told(look, damage):
    path = look()[-1]
    data, times = path.read_bytes(), path.stat()
    if damage == "gone":
        path.unlink()
    else:
        flipped = data[:-1] + bytes([data[-1] ^ 1])
        path.write_bytes(data[:-1] if damage == "cut" else flipped)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    for _ in range(2):
        with pytest.raises(InputError, match=path.name):
            look()
    path.write_bytes(data)
    look()
