"""What is kept on disk is found again whole, or made anew: never stale, never damaged."""

import multiprocessing
import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from planner import content_hash
from planner.dataset import measure as measuring
from planner.dataset.measure import MeasuredPose
from planner.dataset.screened_files import Source
from planner.dataset.store import Store
from tests.support.hit_files import write_hit
from tests.support.simulated_hits import make_hit

BAND_HZ = (4.0, 60.0)


@dataclass(frozen=True, eq=False)
class Result:
    """Something with all that the store has to carry."""

    values: np.ndarray
    number: float
    words: tuple[str, ...]
    path: Path
    nothing: np.ndarray | None = None


def result(seed=0):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(2, 3)) + 1j * rng.normal(size=(2, 3))
    return Result(values, float("inf"), ("°", "m/s²"), Path("/a/b.csv"))


def same(a: Result, b: Result) -> bool:
    told = [(one.number, one.words, one.path) for one in (a, b)]
    return np.array_equal(a.values, b.values) and told[0] == told[1]


def must_not_be_made() -> Result:
    raise AssertionError("made again")


def test_what_is_kept_comes_back_equal(tmp_path):
    store = Store(tmp_path / "new" / "folder")
    first = store.result("k", Result, result)
    again = Store(store.folder).result("k", Result, must_not_be_made)
    assert same(first, again)
    assert again.nothing is None
    again.values[0, 0] = 0  # arrays are the reader's own


def flipped(at: int):
    return lambda data: data[: at % len(data)] + bytes([data[at] ^ 1]) + data[at % len(data) + 1 :]


DAMAGED = [flipped(at) for at in (0, 5, 31, 32, 40, -1)]
DAMAGED += [lambda data, end=end: data[:end] for end in (0, 10, 32, 60, -1)]


@pytest.mark.parametrize("damage", DAMAGED)
def test_a_damaged_entry_is_noticed_wherever_it_is_and_made_anew(tmp_path, damage):
    store = Store(tmp_path)
    store.put("k", result())
    whole = (tmp_path / "k").read_bytes()
    (tmp_path / "k").write_bytes(damage(whole))
    assert store.get("k", Result) is None
    assert same(store.result("k", Result, result), result())
    assert (tmp_path / "k").read_bytes() == whole
    os.replace(tmp_path / "k", tmp_path / "other")  # nor is one under another key taken
    assert store.get("other", Result) is None


def test_a_folder_that_cannot_be_written_costs_time_only(tmp_path):
    (tmp_path / "file").write_text("in the way")
    for store in (Store(tmp_path / "file" / "poses"), Store(None)):
        assert same(store.result("k", Result, result), result())
        assert store.get("k", Result) is None
    store = Store(tmp_path / "empty")  # what fails keeps nothing
    with pytest.raises(AssertionError):
        store.result("k", Result, must_not_be_made)
    assert not store.folder.exists()


def test_it_does_not_grow_without_end(tmp_path):
    store = Store(tmp_path)
    store.put("old", result())
    size = (tmp_path / "old").stat().st_size
    for number, name in enumerate(["unused", "b", "used", "c"]):
        store.put(name, result())
        os.utime(tmp_path / name, (1e9 + number, 1e9 + number))
    small = Store(tmp_path, most_bytes=3 * size)
    assert small.get("used", Result) is not None  # and is young again by that
    small.put("last", result())
    left = {path.name for path in tmp_path.iterdir()}
    assert {"last", "used"} <= left
    assert "unused" not in left
    assert len(left) <= 3


def test_a_part_left_by_a_stopped_process_goes_and_one_being_written_stays(tmp_path):
    (tmp_path / "left.part").write_bytes(b"x")
    os.utime(tmp_path / "left.part", (1e9, 1e9))
    (tmp_path / "now.part").write_bytes(b"x")
    Store(tmp_path).put("k", result())
    assert {path.name for path in tmp_path.iterdir()} == {"now.part", "k"}


def write_and_read(folder: Path, rounds: int) -> int:
    store, whole = Store(folder), 0
    for _ in range(rounds):
        store.put("k", result(1))
        found = store.get("k", Result)
        whole += found is not None and same(found, result(1))
    return whole


def test_processes_that_write_the_same_entry_never_see_half_of_it(tmp_path):
    context = multiprocessing.get_context("spawn")
    with context.Pool(2) as pool:
        assert pool.starmap(write_and_read, [(tmp_path, 50)] * 2) == [50, 50]


def write_hits(folder: Path) -> tuple[Source, ...]:
    """Three hits along each axis, as CSV files."""
    rng, sources = np.random.default_rng(3), []
    for axis in "xyz":
        for repeat in (1, 2, 3):
            hit = make_hit(rng, f"+{axis}", record_s=2.0)
            path = write_hit(folder / f"{axis}{repeat}.csv", hit, stated=False)
            sources.append(Source(path, path.name, hit.axis, repeat))
    return tuple(sources)


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    return write_hits(tmp_path_factory.mktemp("hits"))


def looked_at(pose: MeasuredPose) -> list:
    """All that a pose gives, as numbers and texts."""
    frf, ended, modal = pose.frf, pose.ended_frf, pose.modal
    assert frf is not None
    assert ended is not None
    modes = [(m.frequency_hz, m.damping_ratio, m.frequency_sd_hz) for m in modal.modes]
    arrays = [frf.accelerance, frf.variance, frf.coherence, ended.accelerance, frf.tail_s]
    return [*arrays, modes, pose.remarks, pose.verdicts]


def agree(a: MeasuredPose, b: MeasuredPose) -> None:
    for one, other in zip(looked_at(a), looked_at(b), strict=True):
        assert np.array_equal(one, other, True) if isinstance(one, np.ndarray) else one == other


def no_reading(*_):
    raise AssertionError("files were read again")


def test_a_pose_is_computed_once(sources, tmp_path, monkeypatch):
    first = MeasuredPose(sources, BAND_HZ, store=Store(tmp_path))
    plain = MeasuredPose(sources, BAND_HZ, store=Store(None))
    agree(first, plain)
    monkeypatch.setattr(measuring, "read_files", no_reading)
    again = MeasuredPose(sources, BAND_HZ, store=Store(tmp_path))
    assert again.is_kept
    agree(again, plain)


@pytest.fixture
def kept(tmp_path):
    """A pose that was worked out and is kept."""
    pose = MeasuredPose(write_hits(tmp_path), BAND_HZ, store=Store(tmp_path / "store"))
    _ = pose.decomposed
    assert replace(pose).is_kept
    return pose


@pytest.mark.parametrize(
    "change",
    [
        lambda pose: {"band_hz": (4.0, 50.0)},
        lambda pose: {"estimator": "h2"},
        lambda pose: {"window_rate_1_s": 0.5},
        lambda pose: {"sources": (replace(pose.sources[0], hit="-x"), *pose.sources[1:])},
        None,  # another program
    ],
)
def test_another_program_parameter_or_axis_is_another_result(kept, change, monkeypatch):
    if change is None:
        monkeypatch.setattr(content_hash, "program", lambda *packages: "another")
    other = replace(kept, **(change(kept) if change else {}))
    assert not other.is_kept
    agree(other, replace(other, store=Store(None)))


def test_a_byte_more_in_a_file_is_another_result(kept):
    path = kept.sources[0].path
    path.write_text(path.read_text() + "\n")
    assert not replace(kept).is_kept


def test_the_programs_hash_follows_its_packages():
    """One that results do not depend on does not make them stale."""
    whole, some = content_hash.program(), content_hash.program(*measuring.PACKAGES)
    assert len({whole, some, content_hash.program("modal")}) == 3


def test_a_file_that_changes_while_it_is_read_is_not_kept(tmp_path, monkeypatch):
    hits = write_hits(tmp_path)
    read = measuring.read_files

    def read_and_change(*args):
        found = read(*args)
        hits[0].path.write_text(hits[0].path.read_text() + "\n")
        return found

    monkeypatch.setattr(measuring, "read_files", read_and_change)
    pose = MeasuredPose(hits, BAND_HZ, store=Store(tmp_path / "store"))
    assert pose.frf is not None
    assert not (tmp_path / "store").exists()


def test_a_copy_elsewhere_is_known_by_its_content(kept, tmp_path):
    copies = []
    for source in kept.sources:
        path = tmp_path / f"copy-{source.path.name}"
        path.write_bytes(source.path.read_bytes())
        copies.append(replace(source, path=path))
    copied = replace(kept, sources=tuple(copies))
    assert copied.is_kept
    assert [v.source.path for v in copied.verdicts] == [source.path for source in copies]
