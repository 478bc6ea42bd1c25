"""Recordings as one data set: poses, visits, levels; from a folder, from files, from hits."""

import csv
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from planner.dataset.dataset import LAID, Dataset, Recording, Visit
from planner.dataset.measure import OVER, MeasuredPose
from planner.dataset.screened_files import Source
from planner.dataset.store import Store
from planner.dataset.visits import recordings_in, unlisted_folders
from planner.dynamics.simulation import Simulation
from planner.errors import InputError, RefusedError
from planner.frf.estimator import estimate
from planner.proof.hits import AXES, simulate_hit
from planner.proof.load import load_truth
from planner.recording.joints import JointUnits
from planner.recording.points import PointNames
from planner.robot.robot import Robot
from planner.studies.hits import as_read
from tests.support.fitted_cases import drawn_arm, limits
from tests.support.hit_files import write_hit
from tests.support.simulated_hits import make_hit

BAND_HZ = (4.0, 60.0)
NOTHING_KEPT = Store(None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Pose A, then B, then A again; one hit of A disagrees, and one file of B is no recording."""
    root = tmp_path_factory.mktemp("recordings")
    rng = np.random.default_rng(5)
    rows = []
    for visit, pose in enumerate("ABA"):
        for axis in "xyz":
            for repeat in range(2):
                name = f"{visit}{pose}{axis}{repeat}.csv"
                hit = make_hit(rng, f"+{axis}", record_s=3.0, peak_n=(400, 1200)[repeat])
                if name == "2Ax1.csv":
                    hit = replace(hit, acceleration_m_s2=-hit.acceleration_m_s2)
                write_hit(root / name, hit, stated=False)
                angle = {"A": 10.0, "B": 50.0}[pose] + 0.1 * visit
                rows.append([pose, angle, f"+{axis}", 2 * visit + repeat + 1, name])
    (root / "none.csv").write_text("hello\n")
    rows.append(["C", 80.0, "+x", 1, "none.csv"])
    with open(root / "recordings.csv", "w", newline="") as file:
        csv.writer(file).writerows([["pose", "J1_deg", "hit", "repeat", "file"], *rows])
    return root


def joints(*names: str):
    """A robot as far as recordings are read with it."""
    return SimpleNamespace(joints=JointUnits.of(names), points=PointNames(), config=None)


@pytest.fixture(scope="module")
def read(folder):
    return Dataset.read(folder, joints("J1"), BAND_HZ, store=NOTHING_KEPT)


def test_poses_and_visits_in_the_order_of_recording(read):
    assert read.poses == ("A", "B")
    np.testing.assert_allclose(np.rad2deg(read.q[:, 0]), [10.1, 50.1])
    assert [visit.pose for visit in read.visits] == ["A", "B", "A"]
    told_deg = np.rad2deg([visit.q[0] for visit in read.visits])
    np.testing.assert_allclose(told_deg, [10.0, 50.1, 10.2])
    np.testing.assert_allclose([visit.order for visit in read.visits], [0, 1 / 3, 2 / 3])


def test_what_disagrees_is_left_out_of_frfs_and_kept_for_screens(read):
    assert [Path(file).name for file, _ in read.refused] == ["2Ax1.csv", "none.csv"]
    assert "opposite sign" in read.refused[0][1]
    assert read.frfs[0].hits == (3, 4, 4)
    assert [len(visit.hits) for visit in read.visits] == [6, 6, 6]
    assert read.remarks == ("Pose C is left out: No usable hit: nothing was estimated.",)


def test_frfs_of_a_pose_and_of_a_visit(read):
    a = read.entries[0].measured.hits
    np.testing.assert_array_equal(read.frfs[0].accelerance, estimate(a, BAND_HZ).accelerance)
    assert read.frfs[0].exponential_rate_1_s == 0
    ended = read.ended_frfs[0]
    assert ended.exponential_rate_1_s * read.frfs[0].tail_s == pytest.approx(OVER)
    rates = [read.frf(visit.hits).exponential_rate_1_s for visit in read.visits]
    assert rates == [LAID] * 3


def test_modes_of_each_pose(read):
    for modal in read.modes:
        assert modal is not None
        np.testing.assert_allclose([m.frequency_hz for m in modal.modes], [11.0, 27.0], rtol=0.01)


def test_levels_are_the_same_for_all_visits(read):
    assert len(read.level_n) == 2
    own = [(hit.axis_index, read.level(hit)) for hit in read.visits[1].hits]
    assert set(own) == {(axis, level) for axis in range(3) for level in range(2)}


def test_files_wherever_they_are_give_the_same(folder, read, tmp_path):
    recordings = []
    with open(folder / "recordings.csv", newline="") as file:
        for row in csv.DictReader(file):
            copy = tmp_path / f"kept-{row['file']}"
            copy.write_bytes((folder / row["file"]).read_bytes())
            source = Source(copy, f"stick/{row['file']}", row["hit"], int(row["repeat"]))
            q = np.deg2rad([float(row["J1_deg"])])
            recordings.append(Recording(row["pose"], q, source))
    same = Dataset.of(recordings, BAND_HZ, store=NOTHING_KEPT)
    assert same.poses == read.poses
    assert [v.q.tolist() for v in same.visits] == [v.q.tolist() for v in read.visits]
    for one, other in zip(same.frfs, read.frfs, strict=True):
        np.testing.assert_array_equal(one.accelerance, other.accelerance)
    assert [file for file, _ in same.refused] == ["stick/2Ax1.csv", "stick/none.csv"]
    assert str(tmp_path) not in str(same.refused)


def test_corrected_hits_make_entries_of_their_own(read):
    twice = [
        tuple(replace(hit, acceleration_m_s2=2 * hit.acceleration_m_s2) for hit in visit.hits)
        for visit in read.visits
    ]
    louder = [replace(visit, hits=hits) for visit, hits in zip(read.visits, twice, strict=True)]
    now = read.corrected(louder, 0.5)
    assert now.poses == ("A", "B", "A")
    assert now.frfs[0].hits == (2, 2, 2)
    assert now.frfs[0].exponential_rate_1_s == 0.5
    np.testing.assert_allclose([visit.q for visit in now.visits], now.q)
    assert (now.refused, now.remarks) == (read.refused, read.remarks)
    np.testing.assert_allclose(now.frfs[1].accelerance, 2 * read.frfs[1].accelerance)
    assert read.window_rate_1_s == 0
    assert read.poses == ("A", "B")


def test_hits_at_hand():
    rng = np.random.default_rng(1)
    hits = tuple(make_hit(rng, f"+{axis}") for axis in "xyz")
    made = Dataset.of_visits([Visit("P", np.zeros(1), 0.0, hits)], BAND_HZ)
    assert made.poses == ("P",)
    np.testing.assert_array_equal(made.frfs[0].accelerance, estimate(hits, BAND_HZ).accelerance)
    assert made.visits[0].hits == hits


def test_nothing_usable_is_said_with_its_reason(tmp_path):
    (tmp_path / "a.csv").write_text("hello\n")
    (tmp_path / "recordings.csv").write_text("pose,J1_deg,hit,file\nA,1,+x,a.csv\n")
    with pytest.raises(RefusedError, match=r"no pose has a hit that can be used.*a\.csv"):
        Dataset.read(tmp_path, joints("J1"), BAND_HZ, store=NOTHING_KEPT)
    with pytest.raises(InputError, match="no column J2_deg"):
        Dataset.read(tmp_path, joints("J2"), BAND_HZ, store=NOTHING_KEPT)


def listed(folder: Path, pose: str, angle: float) -> None:
    """A folder as an analyser writes it, with one pose; nothing here reads its file."""
    folder.mkdir(parents=True)
    (folder / "hit.csv").write_text("hello\n")
    (folder / "recordings.csv").write_text(f"pose,J1_deg,hit,file\n{pose},{angle},+x,hit.csv\n")


def test_a_table_its_folder_and_a_folder_of_folders_say_the_same(tmp_path):
    joints = JointUnits.of(["J1"])
    for number in (10, 9, 2):
        listed(tmp_path / f"export {number}", f"P{number}", 5.0 * number)
    listed(tmp_path / ".trash", "P2", 0.0)
    (tmp_path / "pictures").mkdir()
    every = recordings_in(tmp_path, joints)
    assert [one.pose for one in every] == ["P2", "P9", "P10"]
    np.testing.assert_allclose(np.rad2deg([one.q[0] for one in every]), [10.0, 45.0, 50.0])
    for own in (tmp_path / "export 9", tmp_path / "export 9" / "recordings.csv"):
        assert [one.source for one in recordings_in(own, joints)] == [every[1].source]


def test_tables_that_differ_on_a_pose_and_folders_without_one_are_told(tmp_path):
    joints = JointUnits.of(["J1"])
    (tmp_path / "none").mkdir()
    with pytest.raises(InputError, match=r"none has no recordings\.csv.*add one"):
        recordings_in(tmp_path / "none", joints)
    listed(tmp_path / "one", "P1", 10.0)
    listed(tmp_path / "two", "P1", 30.0)
    with pytest.raises(InputError, match=r"two/recordings\.csv, row 2: pose P1 .*20\.00° away"):
        recordings_in(tmp_path, joints)


def test_folders_whose_recordings_no_table_names_are_told_of(tmp_path):
    joints = JointUnits.of(["J1"])
    listed(tmp_path / "P1", "P1", 10.0)
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "weather.csv").write_text("sunny\n")
    found = recordings_in(tmp_path, joints)
    assert unlisted_folders(tmp_path, found) == ()
    (tmp_path / "P2").mkdir()
    write_hit(tmp_path / "P2" / "hit.csv", make_hit(np.random.default_rng(1)), stated=False)
    (said,) = unlisted_folders(tmp_path, found)
    assert "P2 is left out: no recordings.csv says" in said
    assert "name the campaign" in said


POSES = 2


@pytest.mark.parametrize("name", ["kr10", "irb6640", "kr210"])
def test_perfect_hits_give_the_true_frfs(name, tmp_path):
    rng, arm = drawn_arm(name, 31, tmp_path)
    truth = load_truth(arm.toml)
    low, high = limits(arm, Simulation(Robot.load(arm.toml)))
    hammer = replace(arm.hammer, noise=0.0, force_noise=0.0)
    for q in rng.uniform(low, high, (POSES, len(low))):
        hits = [simulate_hit(truth, q, f"+{axis}", hammer, rng) for axis in AXES]
        frf = MeasuredPose((), arm.band_hz, given=as_read(hits, hammer)).frf.within(arm.band_hz)
        s = 2j * np.pi * frf.frequency_hz + frf.exponential_rate_1_s
        poles, residues, _ = truth.poles(q)
        each = 1 / (s - poles[:, None])
        true = s**2 * np.einsum("kij,kf->ijf", residues, each)
        ringing = residues * poles[:, None, None] ** 2
        cut = each * np.exp((poles[:, None] - s) * frf.tail_s)
        off = frf.accelerance - (true - np.einsum("kij,kf->ijf", ringing, cut))
        assert np.linalg.norm(off) < 1e-3 * np.linalg.norm(true)
