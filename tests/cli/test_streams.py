"""A recorder that runs on: records of several hits, in every format, by command."""

import json
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from planner.recording.hits import hits_from
from planner.recording.read import hits_in, read, read_hits
from tests.support import streams
from tests.support.outside import call, make_cell, record
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
    said = {Path(r["file"]).name: r["reason"] for r in answer["refused"]}
    assert list(said) == [f"more{suffix} (hit {k} s)" for k in ("3 at 10.00", "6 at 24.00")]
    assert ["second pulse" in why or "cut off" in why for why in said.values()] == [True, True]
    told = [r.replace(f"{tmp_path}/", "") for r in answer["remarks"] if " hits in " in r]
    assert f"6 hits in more{suffix}: 4 good." in told
    assert f"3 hits in y{suffix}: 3 good." in told


def test_a_record_of_a_single_hit_stays_as_it_was(tmp_path):
    samples = made(*CLEAN, "+x", 0)[:, : 4 * streams.RATE_HZ]
    streams.write_h5(tmp_path / "one.h5", samples, "+x")
    assert hits_in(tmp_path / "one.h5") == ()
    (cut,) = hits_from(read_hits(tmp_path / "one.h5"))
    assert cut.faults == ()
    np.testing.assert_array_equal(cut.force_n, samples[0])
    np.testing.assert_array_equal(cut.acceleration_m_s2, samples[1:])


@pytest.fixture
def at_first_pose(tmp_path):
    """A campaign, and three streams of its first pose as WAV files."""
    robot, campaign_toml, truth = make_cell(tmp_path, learns=False)
    cell = tmp_path / "cell"
    assert call("new", cell, "--robot", robot, "--campaign", campaign_toml)[0] == 0
    pose = json.loads(call("next", cell, "--json")[1])["proposals"][0]
    folder = record(truth, tmp_path / "made", pose["pose"], pose["joints_deg"])
    exports = tmp_path / "exports"
    exports.mkdir()
    rate = hits_from(read(next((folder / "data").iterdir())))[0].sampling_rate_hz
    for axis in "xyz":
        samples = joined(folder, f"p{axis}")
        streams.write_wav(exports / f"{axis}.wav", samples, f"+{axis}", rate_hz=round(rate))
    return cell, exports, folder


def test_streams_are_imported_replayed_and_taken_back(at_first_pose, tmp_path):
    cell, exports, folder = at_first_pose
    code, out, err = call("import", cell, exports, "--json")
    assert code == 0, err
    first = json.loads(out)
    assert [Path(name).name.split(" at ")[0] for name in first["accepted"]] == [
        f"{axis}.wav (hit {k}" for axis in "xyz" for k in (1, 2, 3)
    ]
    assert f"3 hits in {exports / 'x.wav'}: 3 good." in first["remarks"]
    (exports / "channels.csv").unlink()  # what was imported stands by itself
    assert call("replay", cell)[0] == 0
    assert call("undo", cell)[0] == 0
    code, out, err = call("import", cell, folder / "data", "--json")
    assert code == 0, err
    alone = [m["frequency_hz"] for m in json.loads(out)["modes"]]
    assert [m["frequency_hz"] for m in first["modes"]] == pytest.approx(alone, rel=2e-3)


def test_a_wav_says_what_its_table_lacks_and_follows_it(at_first_pose):
    cell, exports, _ = at_first_pose
    table = exports / "channels.csv"
    text = table.read_text()
    table.unlink()
    code, _, err = call("modes", exports)
    assert code == 3
    assert "channels.csv" in err
    assert "channel,name,unit,full_scale" in err
    table.write_text(text)
    assert len(json.loads(call("modes", exports, "--json")[1])["modes"]) > 1
    (first,) = hits_from(read(exports / "x.wav"))
    table.write_text(text.replace("force,N,4000", "force,N,8000"))
    (twice,) = hits_from(read(exports / "x.wav"))
    np.testing.assert_allclose(twice.force_n, 2 * first.force_n)
    code, _, err = call("import", cell, exports / "x.wav")
    assert code in (0, 3), err
