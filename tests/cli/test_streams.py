"""Files of several hits, by command: a recorder that runs on, in every format; hits in a row."""

import json
import shutil
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from planner.recording.hits import hits_from
from planner.recording.read import hits_in, read, read_hits
from tests.support import streams
from tests.support.outside import call, refused, said, told
from tests.support.streams import CLEAN, MIXED, MODES, WRITERS, joined, stream

made = lru_cache(stream)
AXES = "+x", "-y", "+z"


def is_right(modes: list[dict]) -> None:
    """Whether these are the modes of the streams' structure."""
    assert [m["frequency_hz"] for m in modes] == pytest.approx([m[0] for m in MODES], rel=1e-3)
    assert [m["damping_ratio"] for m in modes] == pytest.approx([m[1] for m in MODES], rel=0.02)


@pytest.mark.parametrize("suffix", WRITERS)
def test_a_stream_is_cut_into_its_hits_in_every_format(tmp_path, suffix):
    for seed, axis in enumerate(AXES):
        WRITERS[suffix](tmp_path / f"{axis[1]}{suffix}", made(*CLEAN, axis, seed), axis)
    WRITERS[suffix](tmp_path / f"more{suffix}", made(*MIXED, "+x", 3), "+x")
    code, out, err = call("modes", tmp_path, "--json")
    assert code == 3, err
    answer = json.loads(out)
    is_right(answer["modes"])
    assert answer["hits"] == [7, 3, 3]
    why = {Path(r["file"]).name: r["reason"] for r in answer["refused"]}
    assert list(why) == [f"more{suffix} (hit {k} s)" for k in ("3 at 10.00", "6 at 24.00")]
    assert ["second pulse" in text or "cut off" in text for text in why.values()] == [True, True]
    remarks = [r.replace(f"{tmp_path}/", "") for r in answer["remarks"] if " hits in " in r]
    assert f"6 hits in more{suffix}: 4 good." in remarks
    assert f"3 hits in y{suffix}: 3 good." in remarks


def test_a_record_of_a_single_hit_stays_as_it_was(tmp_path):
    samples = made(*CLEAN, "+x", 0)[:, : 4 * streams.RATE_HZ]
    WRITERS[".h5"](tmp_path / "one.h5", samples, "+x")
    assert hits_in(tmp_path / "one.h5") == ()
    (cut,) = hits_from(read_hits(tmp_path / "one.h5"))
    assert cut.faults == ()
    np.testing.assert_array_equal(cut.force_n, samples[0])
    np.testing.assert_array_equal(cut.acceleration_m_s2, samples[1:])


@pytest.fixture
def exports(first_pose, tmp_path):
    """Three streams of the campaign's first pose as WAV files."""
    folder = tmp_path / "exports"
    folder.mkdir()
    rate = hits_from(read(first_pose.files[0]))[0].sampling_rate_hz
    for axis in "xyz":
        samples = joined(first_pose.made, f"p{axis}")
        streams.write_wav(folder / f"{axis}.wav", samples, f"+{axis}", rate_hz=round(rate))
    return folder


def frequencies(answer: dict) -> list[float]:
    return [m["frequency_hz"] for m in answer["modes"]]


def test_streams_are_imported_replayed_and_taken_back(first_pose, exports):
    cell = first_pose.cell
    first = told("import", cell, exports)
    assert [Path(name).name.split(" at ")[0] for name in first["accepted"]] == [
        f"{axis}.wav (hit {k}" for axis in "xyz" for k in (1, 2, 3)
    ]
    assert f"3 hits in {exports / 'x.wav'}: 3 good." in first["remarks"]
    (exports / "channels.csv").unlink()  # what was imported stands by itself
    said("replay", cell)
    said("undo", cell)
    alone = frequencies(told("import", cell, first_pose.made / "data"))
    assert frequencies(first) == pytest.approx(alone, rel=2e-3)


def test_a_wav_says_what_its_table_lacks_and_follows_it(first_pose, exports):
    table = exports / "channels.csv"
    text = table.read_text()
    table.unlink()
    err = refused("modes", exports, code=3)
    assert "channels.csv" in err
    assert "channel,name,unit,full_scale" in err
    table.write_text(text)
    assert len(told("modes", exports)["modes"]) > 1
    (first,) = hits_from(read(exports / "x.wav"))
    table.write_text(text.replace("force,N,4000", "force,N,8000"))
    (twice,) = hits_from(read(exports / "x.wav"))
    np.testing.assert_allclose(twice.force_n, 2 * first.force_n)
    code, _, err = call("import", first_pose.cell, exports / "x.wav")
    assert code in (0, 3), err


def test_a_run_of_hits_in_one_universal_file_is_imported_hit_by_hit(first_pose, tmp_path):
    cell, files = first_pose.cell, first_pose.files
    run = tmp_path / "export" / "today" / "run.unv"  # a folder in a folder
    run.parent.mkdir(parents=True)
    run.write_bytes(b"".join(file.read_bytes() for file in files))
    assert hits_in(run) == (None,) * 9
    for hit, file in zip(hits_from(read(run)), files, strict=True):
        (alone,) = hits_from(read(file))
        assert hit.axis == alone.axis
        assert (hit.force_n == alone.force_n).all()
    together = told("import", cell, tmp_path / "export")
    assert [Path(name).name for name in together["accepted"]] == [
        f"run.unv (hit {k})" for k in range(1, 10)
    ]
    assert together["remarks"] == []
    said("import", cell, run, "--pose", first_pose.pose)  # known, hit by hit
    said("replay", cell)
    other = shutil.copytree(cell, tmp_path / "other")
    said("undo", other)
    assert frequencies(told("import", other, *files)) == frequencies(together)


def test_hits_along_one_axis_or_a_single_hit_are_remarked_upon(first_pose):
    alone = first_pose.made / "data" / f"{first_pose.pose}_px_1.uff"
    remarks = " ".join(told("import", first_pose.cell, alone)["remarks"])
    assert "no accepted hit along y and z" in remarks
    assert "only one accepted hit along x" in remarks
