"""Hits that contradict others or are far too weak, files that are no recordings: told and held."""

import os
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from planner.dataset.screened_files import Source, read_files, read_one
from planner.frf.estimator import estimate
from planner.proof.hits import SimulatedHit, noisy, pulse, sampled, simulate_hit
from planner.proof.recordings import write_uff
from planner.recording.joints import JointUnits
from planner.recording.points import PointNames
from planner.session.hit_verdicts import Before, Verdicts
from planner.session.inbox import FolderTable, Inbox
from tests.support.hit_files import write_hit
from tests.support.outside import HAMMER, make_cell
from tests.support.robots import BAND_HZ

Q = np.deg2rad([10.0, -80.0, 90.0, 5.0, 40.0, -10.0])


def none_known(path, digest):
    """No file is known."""
    return False


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    return make_cell(tmp_path_factory.mktemp("truth"))[2]


class Bench:
    """Hits written one after the other, and the verdicts on all of them."""

    def __init__(self, truth, folder: Path):
        self.truth, self.folder, self.rng = truth, folder, np.random.default_rng(2)
        self.files: list[Path] = []
        joints, points = JointUnits.of(truth.joint_names), PointNames()
        table = FolderTable(folder, joints, points, lambda joints_deg, where: None)
        self.verdicts, self.numbers = Verdicts(BAND_HZ, points, table), {}

    def hit(self, name: str, axis: str, said: str = "", size: float = 1.0) -> Path:
        made = simulate_hit(self.truth, Q, axis, HAMMER, self.rng)
        kind = type(made)
        made = kind(said or axis, size * made.force_n, size * made.acceleration_m_s2)
        path = self.folder / f"{name}.uff"
        write_uff(path, made, HAMMER)
        self.files.append(path)
        return path

    def struck(self, direction: tuple[float, float, float], q: np.ndarray) -> SimulatedHit:
        """A hit that is said to be +z, at another pose and in another direction."""
        force = pulse(HAMMER, self.rng)
        parts = (
            share * self.truth.respond(q, force, i, HAMMER.step_s)
            for i, share in enumerate(direction)
        )
        made = sampled("+z", force, np.sum(list(parts), axis=0), HAMMER)
        return noisy(made, HAMMER, self.rng)

    def of(self, before: Before | None = None, here: frozenset[Path] = frozenset()):
        self.numbers = self.verdicts.numbered(self.files, self.numbers)
        found = self.verdicts.of(self.files, before or {}, here, self.numbers, {}, "P1")
        return {verdict.path.stem: verdict for verdict in found}


@pytest.fixture
def bench(truth, tmp_path):
    return Bench(truth, tmp_path)


def kinds(found) -> dict[str, str]:
    return {name: verdict.kind for name, verdict in found.items()}


def test_a_hit_along_another_axis_than_said_is_held(bench):
    for name, axis in (("x1", "+x"), ("x2", "+x"), ("y1", "+y"), ("y2", "+y"), ("z1", "+z")):
        bench.hit(name, axis)
    assert set(kinds(bench.of()).values()) == {"good"}
    wrong = bench.hit("z2", "+y", said="+z")
    found = bench.of()
    assert kinds(found) == {**dict.fromkeys(["x1", "x2", "y1", "y2", "z1"], "good"), "z2": "unsure"}
    assert "hit 5 (z1.uff)" in found["z2"].text
    assert "hit along z once more" in found["z2"].text
    # The engineer says that it is right, or a third hit tells.
    assert bench.of(here=frozenset({wrong}))["z2"].kind == "good"
    bench.hit("z3", "+z")
    found = bench.of()
    assert found["z2"].kind == "repeat"
    assert found["z1"].kind == found["z3"].kind == "good"


def test_the_first_hit_along_an_axis_may_be_one_of_another(bench):
    bench.hit("y1", "+y")
    bench.hit("y2", "+y")
    bench.hit("z1", "+y", said="+z")
    assert kinds(bench.of()) == {"y1": "good", "y2": "good", "z1": "unsure"}


def test_right_hits_are_never_doubted(truth, tmp_path):
    for seed in range(6):
        folder = tmp_path / str(seed)
        folder.mkdir()
        bench = Bench(truth, folder)
        bench.rng = np.random.default_rng(seed)
        for axis in ("+x", "+y", "+z", "+z", "-y", "+x"):
            bench.hit(f"h{len(bench.files)}", axis)
            assert set(kinds(bench.of()).values()) == {"good"}


def test_a_hit_far_below_the_others_is_to_be_repeated(bench):
    bench.hit("x1", "+x")
    bench.hit("x2", "+x")
    bench.hit("soft", "+x", size=0.04)
    verdict = bench.of()["soft"]
    assert (verdict.kind, verdict.weak) == ("repeat", True)
    assert verdict.text.startswith("2.")
    assert " N (median) along x; hit harder" in verdict.text
    # As the pose before tells too; and twice as soft is a level of its own.
    before = tuple(h for v in bench.of().values() for h in v.hits[:1])
    alone = Bench(bench.truth, bench.folder)
    alone.hit("first", "+x", size=0.04)
    assert alone.of()["first"].kind == "good"
    assert alone.of({"P001": before[:2]})["first"].kind != "good"
    bench.hit("soft2", "+x", size=0.045)
    assert set(kinds(bench.of()).values()) == {"good"}


def test_a_late_hit_is_told_beside_a_poor_one(bench, tmp_path):
    """The pose before was hit askew, so that the late hit is not quite like its repeats there, and
    the one good repeat here is missing: a poor one alone stands for it."""
    other = Q + np.deg2rad([25.0, 12.0, -20.0, 0.0, 15.0, 0.0])
    late = bench.struck((0.0, 0.0, 1.0), other)
    askew = tuple(bench.struck((0.1, -0.1, 0.99), other) for _ in range(2))
    poor = bench.struck((0.2, 0.1, 0.95), Q)
    for name, made in (("late", late), ("poor", poor), ("a", askew[0]), ("b", askew[1])):
        write_uff(tmp_path / f"{name}.uff", made, HAMMER)
    before = {
        "P0": tuple(
            hit
            for name in "ab"
            for hit in read_one(Source(tmp_path / f"{name}.uff", name), BAND_HZ)[1]
        )
    }
    bench.files += [tmp_path / "late.uff", tmp_path / "poor.uff"]
    assert kinds(bench.of(before)) == {"late": "late", "poor": "good"}


def test_hits_keep_their_number_whatever_becomes_readable_before_them(bench):
    second = bench.hit("b", "+x")
    assert bench.of()["b"].number == 1
    first = bench.hit("a", "+y")
    bench.files = [first, second]  # older, but whole only now
    found = bench.of()
    assert {name: v.number for name, v in found.items()} == {"b": 1, "a": 2}
    bench.files = [first]
    assert bench.of()["a"].number == 2


def test_what_is_no_recording_is_ignored_once_and_half_a_file_is_waited_for(bench, monkeypatch):
    now = [0.0]
    clock = SimpleNamespace(monotonic=lambda: now[0], time=time.time)
    monkeypatch.setattr("planner.session.inbox.time", clock)
    whole = bench.hit("whole", "+x")
    data, inbox = whole.read_bytes(), bench.folder / "inbox"
    inbox.mkdir()
    (inbox / "notes.txt").write_text("remember the cable\n")
    (inbox / "half.uff").write_bytes(data[: len(data) // 2 - 100])
    marks = [m for m in range(len(data)) if data[m : m + 6] == b"    -1"]
    (inbox / "force.uff").write_bytes(data[: marks[1] + 6] + b"\n")  # ends with a whole dataset
    box = Inbox(inbox, 0.02, bench.verdicts.unfit)
    box.scan(none_known)
    now[0] += 0.08  # text is given three times as long
    found, waiting = box.scan(none_known)
    assert found == []
    assert {path.name: why for path, why in waiting} == dict.fromkeys(
        ["notes.txt", "half.uff", "force.uff"], "is still being written"
    )
    assert box.ignored() == []
    now[0] += 0.2
    found, waiting = box.scan(none_known)
    assert [path.name for path in found] == ["force.uff"]  # read, and to be refused
    assert [path.name for path, _ in waiting] == ["half.uff"]
    assert "export it again" in waiting[0][1]
    assert [path.name for path in box.ignored()] == ["notes.txt"]
    assert box.ignored() == []
    (inbox / "half.uff").write_bytes(data)
    os.utime(inbox / "half.uff")
    box.scan(none_known)
    now[0] += 0.05
    assert "half.uff" in [path.name for path in box.scan(none_known)[0]]


def test_a_hit_sampled_at_another_rate_alone_is_not_taken(bench):
    for name, axis in (("x1", "+x"), ("x2", "+x"), ("y1", "+y")):
        bench.hit(name, axis)
    bench.files.append(at_rate(bench.files[1], "slow", HAMMER.sampling_rate_hz / 2))
    found = bench.of()
    assert kinds(found) == {"x1": "good", "x2": "good", "y1": "good", "slow": "repeat"}
    assert "sampled at 320 Hz, the others at 640 Hz; export all alike" in found["slow"].text
    # What a rounded time column cannot tell apart is one rate, though lines of the band shift.
    bench.files[-1] = at_rate(bench.files[1], "rounded", HAMMER.sampling_rate_hz * (1 - 5e-6))
    assert set(kinds(bench.of()).values()) == {"good"}
    told = read_files(tuple(Source(path, path.name) for path in bench.files), BAND_HZ)
    assert all(verdict.accepted for verdict in told.verdicts)
    assert estimate(told.agreeing, BAND_HZ).hits == (3, 1, 0)


def at_rate(path: Path, name: str, rate_hz: float) -> Path:
    """The same hit as a file of another sampling rate."""
    (hit,), _ = Source(path, path.name).read()
    return write_hit(path.with_name(f"{name}.csv"), hit, rate_hz)


def test_a_foreign_file_of_long_ago_is_not_said_to_be_written(tmp_path):
    old = tmp_path / "temperature.csv"
    old.write_text("time,°C\n" + "12:00,21\n" * 20)
    os.utime(old, (time.time() - 600,) * 2)
    box = Inbox(tmp_path, 0.02)
    assert box.scan(none_known) == ([], [])
    time.sleep(0.1)  # the size stood still, though not for as long as a new file has to
    assert box.scan(none_known) == ([], [])
    assert box.ignored() == [old]


def test_a_record_that_was_cut_off_is_not_taken(bench):
    for name, axis in (("x1", "+x"), ("x2", "+x"), ("y1", "+y")):
        bench.hit(name, axis)
    (read,), _ = Source(bench.files[1], "x2").read()
    for name, share in (("short", 0.4), ("shorter", 0.8)):
        count = round(share * len(read.force_n))
        cut = replace(
            read, force_n=read.force_n[:count], acceleration_m_s2=read.acceleration_m_s2[:, :count]
        )
        bench.files.append(write_hit(bench.folder / f"{name}.csv", cut))
    found = bench.of()
    assert kinds(found)["short"] == "repeat"
    assert "its record ends after 0.8 s, the others after 2 s" in found["short"].text
    assert {"x1": "good", "x2": "good", "y1": "good", "shorter": "good"}.items() <= (
        kinds(found).items()
    )
