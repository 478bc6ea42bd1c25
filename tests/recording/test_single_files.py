"""Real files, and those that crashed or misled readers once: read right, or refused in words."""

import h5py
import numpy as np
import pytest
import scipy.io

from planner.cli.run import run
from planner.errors import InputError
from planner.recording.hits import hits_from
from planner.recording.mat5 import read_mat5
from planner.recording.read import READERS, hits_in, read, version
from planner.recording.records import FrfRecord
from planner.recording.screening import screen
from tests.support.hit_files import columns, write_h5, write_mat
from tests.support.odd_recordings import ODD
from tests.support.simulated_hits import RATE_HZ, make_hit

GOOD = columns(make_hit(np.random.default_rng(0)), RATE_HZ)


@pytest.mark.parametrize("content", [None, b"", bytes(300), b"no hit at all\n", b"1 2\n" * 20])
@pytest.mark.parametrize("suffix", READERS)
def test_every_reader_refuses_what_is_no_recording(tmp_path, suffix, content):
    path = tmp_path / f"hit{suffix}"
    if content is not None:
        path.write_bytes(content)
        assert version(path) == version(path)
    with pytest.raises(InputError, match="hit") as refused:
        read(path)
    assert str(refused.value).endswith(".")
    assert "\n" not in str(refused.value)
    assert hits_in(path) == ()


@pytest.mark.timeout(10)  # some of them hung: all take well below 1 s
@pytest.mark.parametrize("what", ODD)
def test_odd_recordings_are_refused_in_words(tmp_path, what):
    name, write = ODD[what]
    write(tmp_path / name, GOOD)
    with pytest.raises(InputError, match=name) as refused:
        hits_from(read(tmp_path / name))
    assert "Error)" not in str(refused.value), refused.value  # it says what, not how it crashed


def test_text_of_another_code_page_in_an_attribute_is_no_fault(tmp_path):
    path = tmp_path / "hit.h5"
    write_h5(path, GOOD)
    with h5py.File(path, "a") as file:
        file.attrs["note"] = np.bytes_(b"gr\xf6\xdfe")
        file["force_n"].attrs["unit"] = np.bytes_(b"N")
    (hit,) = hits_from(read(path))
    assert hit.axis == "+x"


@pytest.mark.parametrize(
    ("factor", "kind"), [({"time_s": 1e-6}, "too_short"), ({"force_n": 1e-200}, "dead")]
)
def test_units_that_cannot_be_are_refused(tmp_path, factor, kind):
    path = tmp_path / "hit.mat"
    write_mat(path, GOOD | {name: GOOD[name] * by for name, by in factor.items()})
    (hit,) = hits_from(read(path))
    assert kind in {fault.kind for fault in screen(hit, (4.0, 60.0)) if fault.refuse}


@pytest.mark.parametrize("compressed", [False, True])
def test_mat_files_are_read_as_by_scipy(tmp_path, compressed):
    path = tmp_path / "any.mat"
    made = {
        "a": np.arange(12.0).reshape(3, 4), "complex": np.arange(3) + 1j, "hit": "+x",
        "single": np.float32(2), "small": np.array([1, 2], dtype=np.int16),
    }  # fmt: skip
    scipy.io.savemat(path, made, do_compression=compressed)
    ours, theirs = read_mat5(path), scipy.io.loadmat(path)
    assert set(ours) == set(made)
    for name, value in ours.items():
        np.testing.assert_array_equal(np.squeeze(value), np.squeeze(theirs[name]))
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for cut in rng.integers(128, len(whole) - 1, size=50):
        path.write_bytes(whole[:cut])
        with pytest.raises(InputError, match=r"any\.mat"):
            read(path)


def test_ascii_and_binary_of_the_same_record_agree(shared_data):
    folder = shared_data / "pyuff_real"
    (ascii_,), (binary,) = (
        read(folder / name) for name in ("Sample_UFF58_ascii.uff", "Sample_UFF58b_bin.uff")
    )
    assert ascii_.sampling_rate_hz == pytest.approx(65536, rel=1e-5)
    assert binary.sampling_rate_hz == ascii_.sampling_rate_hz
    a, b = ascii_.channels[0], binary.channels[0]
    assert (a.quantity, a.unit, a.samples.size) == ("pressure", "Pa", 79292)
    assert (b.quantity, b.unit) == (a.quantity, a.unit)
    np.testing.assert_allclose(a.samples, b.samples, rtol=1e-5, atol=1e-8)


def test_every_universal_file_is_read_right_or_refused_in_words(shared_data):
    folder = shared_data / "pyuff_real"
    (mps,) = read(folder / "MPSTD#Set001_2024_10_08_10_27_07.uff")
    assert mps.sampling_rate_hz == pytest.approx(3200)
    assert [c.quantity for c in mps.channels] == ["acceleration"] * 4
    (sine,) = read(folder / "binary8byte.uff")
    values, t = sine.channels[0].samples, np.arange(250) / 100
    assert sine.channels[0].unit == "m/s^2"  # labelled g in the file
    basis = np.column_stack([np.sin(2 * np.pi * 5 * t), np.cos(2 * np.pi * 5 * t), np.ones(250)])
    _, rest, *_ = np.linalg.lstsq(basis, values, rcond=None)
    assert rest[0] < 1e-6 * np.sum(values**2)  # the sine of 5 Hz that its header promises
    (header,) = read(folder / "non_ascii_header.uff")
    assert isinstance(header, FrfRecord)
    assert header.values.shape == (1, 6)
    refused = {
        "sample_dataset58_psd.uff": "power spectral densities",
        **{f"meas_point_{i}.txt": "list of 1001 complex numbers" for i in (1, 2, 3)},
        "Sample_UFF58_ascii.uff": r"1 × pressure \(Pa\)",
        "MPSTD#Set001_2024_10_08_10_27_07.uff": r"4 × acceleration \(m/s\^2\)",
    }
    for name, words in refused.items():
        with pytest.raises(InputError, match=words):
            hits_from(read(folder / name))


def test_three_storey_frame_columns_and_units(shared_data):
    for path in sorted((shared_data / "imphammer_mit").glob("imp_ham_set*")):
        (record,) = read(path)
        assert record.sampling_rate_hz == pytest.approx(50, rel=1e-6)
        assert [c.name for c in record.channels] == ["CH2", "CH3", "CH5", "CH6", "CH8"]
        assert [c.unit for c in record.channels] == ["m/s^2"] * 4 + ["V"]
        assert record.channels[0].samples.size > 9000
    (first,) = read(shared_data / "imphammer_mit" / "imp_ham_set1_nomass.CSV")
    assert first.channels[0].samples[0] == pytest.approx(-0.01778343902)  # cm/s² in the file


def test_three_storey_frame_from_the_command_line(shared_data, capsys):
    path = shared_data / "imphammer_mit" / "imp_ham_set1_nomass.CSV"
    assert run(["modes", str(path), "--force", "CH8"]) == 0
    text = capsys.readouterr().out
    print(text)
    flat = " ".join(text.split())
    for words in ("2.1", "6.8", "13.2", "CH6", "samples"):
        assert words in flat


def test_roller_beam_columns(shared_data):
    (record,) = read(shared_data / "dropbear" / "slow10_test0.txt.gz")
    assert record.sampling_rate_hz == pytest.approx(5000, rel=1e-6)
    assert [c.name for c in record.channels] == ["Low G Accel", "Accel", "PinLoc"]
    assert {c.unit for c in record.channels} == {"V"}
    assert record.channels[0].samples.size == 70_000
