"""Simulated hits: the FRF that they hold is the true one; files say what they are."""

import csv

import numpy as np
import pytest
import pyuff

from planner.proof.arms import KR10, KR210
from planner.proof.deviation import Deviation
from planner.proof.hits import Hammer, simulate_hit
from planner.proof.load import load_truth
from planner.proof.recordings import record_poses, write_predict
from planner.recording.folder import read_recordings

QUIET = Hammer(noise=0.0, force_noise=0.0, record_s=10.0, readback_deg=0.0)
SMALL = Hammer(peak_n=80.0, duration_s=0.004, sampling_rate_hz=640.0, record_s=1.6)


@pytest.fixture(scope="module")
def kr210(tmp_path_factory):
    path = KR210.write(tmp_path_factory.mktemp("kr210"), 2)
    return load_truth(path, Deviation(4, 0.1, 0.1, 0.04, 0.004))


@pytest.fixture(scope="module")
def kr10(tmp_path_factory):
    return load_truth(KR10.write(tmp_path_factory.mktemp("kr10")), Deviation(9, 0.1))


def spectra(hit, rate_hz):
    force, response = np.fft.rfft(hit.force_n), np.fft.rfft(hit.acceleration_m_s2, axis=1)
    return np.fft.rfftfreq(hit.force_n.size, 1 / rate_hz), force, response


@pytest.mark.parametrize("axis", ["+x", "+y", "+z", "-x", "-y", "-z"])
def test_spectra_give_the_true_frf(kr210, axis):
    q = KR210.poses(1)[0]
    hit = simulate_hit(kr210, q, axis, QUIET, np.random.default_rng(0))
    f, force, response = spectra(hit, QUIET.sampling_rate_hz)
    band = (f >= 4) & (f <= 60)
    sign = 1 if axis[0] == "+" else -1
    column = kr210.accelerance(q, f[band])[:, "xyz".index(axis[1])]
    error = sign * (response / force)[:, band] - column
    # What remains is aliasing: the filter lets through little of what lies above 200 Hz.
    assert np.max(np.abs(error)) < 2e-3 * np.max(np.abs(column))
    # The pulse scatters by a quarter, and the filter rounds it off.
    assert 0.5 * QUIET.peak_n < np.max(hit.force_n) < 1.25 * QUIET.peak_n


def test_noise_is_what_it_is_said_to_be(kr210):
    q, hammer = KR210.poses(1)[0], Hammer(noise=0.03, force_noise=1e-3, record_s=10.0)
    rng = np.random.default_rng
    clean = simulate_hit(kr210, q, "+y", QUIET, rng(2))
    noisy = simulate_hit(kr210, q, "+y", hammer, rng(2))
    added = noisy.acceleration_m_s2 - clean.acceleration_m_s2
    largest = np.max(np.sqrt(np.mean(clean.acceleration_m_s2**2, axis=1)))
    assert np.std(added, axis=1) == pytest.approx(0.03 * largest, rel=0.05)
    assert np.std(noisy.force_n - clean.force_n) == pytest.approx(
        1e-3 * np.max(clean.force_n), rel=0.05
    )
    f, force, response = spectra(noisy, hammer.sampling_rate_hz)
    band = (f >= 4) & (f <= 60)
    column = kr210.accelerance(q, f[band])[:, 1]
    error = (response / force)[:, band] - column
    # White noise of sd s has spectral lines of variance s² n; that of the force enters by H.
    through = np.abs(column) * 1e-3 * np.max(clean.force_n)
    lines = noisy.force_n.size * ((0.03 * largest) ** 2 + through**2)
    expected = np.sqrt(lines) / np.abs(force[band])
    assert np.sqrt(np.mean(np.abs(error / expected) ** 2)) == pytest.approx(1, abs=0.1)


def test_no_two_hits_are_alike_and_all_start_after_the_trigger(kr10):
    rng = np.random.default_rng(3)
    hits = [simulate_hit(kr10, KR10.poses(1)[0], "+x", SMALL, rng) for _ in range(4)]
    peaks = [np.max(h.force_n) for h in hits]
    assert np.ptp(peaks) > 0.02 * SMALL.peak_n
    before = int(0.9 * SMALL.pretrigger_s * SMALL.sampling_rate_hz)
    for hit in hits:
        assert np.max(np.abs(hit.force_n[:before])) < 0.01 * np.max(hit.force_n)


def test_files_say_what_they_hold(kr10, tmp_path):
    q = KR10.poses(2)
    record_poses(kr10, [("P1", q[0]), ("P2", q[1])], tmp_path, ("+x", "-z"), 2, SMALL, seed=5)
    with open(tmp_path / "recordings.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 8
    for row in rows:
        sets = pyuff.UFF(str(tmp_path / row["file"])).read_sets()
        axis = {"+x": 1, "-z": -3}[row["hit"]]
        assert [s["ordinate_spec_data_type"] for s in sets] == [13, 12, 12, 12]
        assert [s["ordinate_axis_units_lab"].strip() for s in sets] == ["N"] + ["m/s^2"] * 3
        assert [s["rsp_dir"] for s in sets[1:]] == [1, 2, 3]
        for s in sets:
            assert s["type"] == 58
            assert s["func_type"] == 1
            assert s["ref_dir"] == axis
            assert "SIMULATED" in s["id1"]
            assert "MuJoCo" in s["id2"]
            assert "seed 9" in s["id2"]
            assert f"pose {row['pose']}, hit {row['hit']}" in s["id3"]
            assert s["x"][1] - s["x"][0] == pytest.approx(1 / 640)
            assert s["data"].size == round(1.6 * 640)
    for row in rows[:1]:  # the first channel is the force: one pulse of the stated size
        force = pyuff.UFF(str(tmp_path / row["file"])).read_sets(0)["data"]
        assert 0.5 * SMALL.peak_n < np.max(force) < 1.4 * SMALL.peak_n


def test_readback_is_near_the_setpoint_and_is_where_the_truth_stands(kr10, tmp_path):
    q = KR10.poses(1)[0]
    hammer = Hammer(80.0, 0.004, 640.0, 6.0, noise=0.0, force_noise=0.0, readback_deg=1.0)
    record_poses(kr10, [("P1", q)], tmp_path, ("+y",), 1, hammer, seed=1)
    row = read_recordings(tmp_path, kr10.joint_names)[0]
    readback = np.array(row.joints_deg)
    off = np.abs(readback - np.rad2deg(q))
    assert np.all(off <= 1.0)
    assert np.max(off) > 0.3
    sets = pyuff.UFF(str(row.file)).read_sets()
    F, A = np.fft.rfft(sets[0]["data"]), np.fft.rfft(sets[2]["data"])
    f = np.fft.rfftfreq(sets[0]["data"].size, 1 / 640)
    band = (f > 5) & (f < 60)

    def error(where):
        column = kr10.accelerance(where, f[band])[1, 1]
        return np.max(np.abs((A / F)[band] - column)) / np.max(np.abs(column))

    assert error(np.deg2rad(readback)) < 5e-3
    assert error(q) > 10 * error(np.deg2rad(readback))


def test_the_same_seed_gives_the_same_folder(kr10, tmp_path):
    poses = [("P1", KR10.poses(1)[0])]
    a, b, c = (
        record_poses(kr10, poses, tmp_path / name, ("+x",), 2, SMALL, seed)
        for name, seed in (("a", 1), ("b", 1), ("c", 2))
    )
    names = sorted(p.relative_to(a) for p in a.rglob("*") if p.is_file())
    assert len(names) == 3
    assert all((a / n).read_bytes() == (b / n).read_bytes() for n in names)
    assert all((a / n).read_bytes() != (c / n).read_bytes() for n in names)


def test_wanted_poses_are_written_as_predict_csv(tmp_path):
    q = KR10.poses(2)
    names = [f"joint_{i}" for i in range(1, 7)]
    path = write_predict(tmp_path, names, [("H1", q[0]), ("H2", q[1])], peak_force_n=500)
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["pose", *(f"{n}_deg" for n in names), "peak_force_n"]
    assert [r["pose"] for r in rows] == ["H1", "H2"]
    assert float(rows[1]["joint_3_deg"]) == pytest.approx(np.rad2deg(q[1, 2]), abs=1e-4)
    assert float(rows[0]["peak_force_n"]) == 500
