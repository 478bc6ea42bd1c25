"""Recordings that crashed or misled readers once: each is refused in one sentence, soon."""

import h5py
import numpy as np
import pytest
import scipy.io

from planner.errors import InputError
from planner.recording.hits import hits_from
from planner.recording.mat5 import read_mat5
from planner.recording.read import READERS, hits_in, read, version
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
