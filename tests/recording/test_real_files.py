"""Real recordings: read right, or refused with a sentence that says what they are."""

import numpy as np
import pytest

from planner.cli.run import run
from planner.errors import InputError
from planner.recording.hits import hits_from
from planner.recording.read import read
from planner.recording.records import FrfRecord, TimeRecord


def test_ascii_and_binary_of_the_same_record_agree(shared_data):
    folder = shared_data / "pyuff_real"
    (ascii_,), (binary,) = (
        read(folder / name) for name in ("Sample_UFF58_ascii.uff", "Sample_UFF58b_bin.uff")
    )
    assert isinstance(ascii_, TimeRecord)
    assert isinstance(binary, TimeRecord)
    assert ascii_.sampling_rate_hz == pytest.approx(65536, rel=1e-5)
    assert binary.sampling_rate_hz == ascii_.sampling_rate_hz
    a, b = ascii_.channels[0], binary.channels[0]
    assert (a.quantity, a.unit, a.samples.size) == ("pressure", "Pa", 79292)
    assert (b.quantity, b.unit) == (a.quantity, a.unit)
    np.testing.assert_allclose(a.samples, b.samples, rtol=1e-5, atol=1e-8)


def test_every_universal_file_is_read_right_or_refused_in_words(shared_data):
    folder = shared_data / "pyuff_real"
    (mps,) = read(folder / "MPSTD#Set001_2024_10_08_10_27_07.uff")
    assert isinstance(mps, TimeRecord)
    assert mps.sampling_rate_hz == pytest.approx(3200)
    assert [c.quantity for c in mps.channels] == ["acceleration"] * 4
    (sine,) = read(folder / "binary8byte.uff")
    assert isinstance(sine, TimeRecord)
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
    }
    for name, words in refused.items():
        with pytest.raises(InputError, match=words):
            read(folder / name)


def test_what_is_no_hit_is_said(shared_data):
    folder = shared_data / "pyuff_real"
    for name, words in {
        "Sample_UFF58_ascii.uff": r"1 × pressure \(Pa\)",
        "MPSTD#Set001_2024_10_08_10_27_07.uff": r"4 × acceleration \(m/s\^2\)",
    }.items():
        with pytest.raises(InputError, match=words):
            hits_from(read(folder / name))


def test_three_storey_frame_columns_and_units(shared_data):
    for path in sorted((shared_data / "imphammer_mit").glob("imp_ham_set*")):
        (record,) = read(path)
        assert isinstance(record, TimeRecord)
        assert record.sampling_rate_hz == pytest.approx(50, rel=1e-6)
        assert [c.name for c in record.channels] == ["CH2", "CH3", "CH5", "CH6", "CH8"]
        assert [c.unit for c in record.channels] == ["m/s^2"] * 4 + ["V"]
        assert record.channels[0].samples.size > 9000
    (first,) = read(shared_data / "imphammer_mit" / "imp_ham_set1_nomass.CSV")
    assert isinstance(first, TimeRecord)
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
    assert isinstance(record, TimeRecord)
    assert record.sampling_rate_hz == pytest.approx(5000, rel=1e-6)
    assert [c.name for c in record.channels] == ["Low G Accel", "Accel", "PinLoc"]
    assert {c.unit for c in record.channels} == {"V"}
    assert record.channels[0].samples.size == 70_000
