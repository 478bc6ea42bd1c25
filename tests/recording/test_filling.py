"""Records that were filled up where nothing was measured, and samples lost inside."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.errors import InputError
from planner.recording.channel_faults import channel_faults, lost_samples, without_filling
from planner.recording.records import Channel, Hit, TimeRecord
from planner.recording.stream import cut_into_hits
from planner.recording.wav import read_wav, self_contained
from tests.support.streams import RATE_HZ, SCALES, stream, write_wav

END = round(0.9 * RATE_HZ)  # where the analyser stopped, while it still rang
ONE = (((0.3, 700.0),), 2.0)


def record(samples: np.ndarray) -> TimeRecord:
    channels = [Channel("force", "force", "N", 1, samples[0])] + [
        Channel(f"acceleration {axis}", "acceleration", "m/s^2", k, values)
        for k, (axis, values) in enumerate(zip("xyz", samples[1:], strict=True), 1)
    ]
    return TimeRecord(Path("hit.csv"), float(RATE_HZ), tuple(channels))


def zeros(a, rng):
    a[:, END:] = 0.0


def held(a, rng):
    a[1:, END:] = a[1:, END - 1 : END]


def skewed(a, rng):
    for row, late in zip(a[1:], (0, 3, 7), strict=True):
        row[END + late :] = row[END + late - 1]


def beside_a_dead_one(a, rng):
    a[3] = 0.25
    held(a, rng)


def coarse(a, rng):
    a[1:] = np.round(a[1:] / 0.05) * 0.05
    held(a, rng)


@pytest.mark.parametrize("fill", [zeros, held, skewed, beside_a_dead_one, coarse])
def test_what_was_filled_in_is_left_out_and_said(fill):
    samples = stream(*ONE)
    fill(samples, np.random.default_rng(0))
    cut = without_filling(record(samples))
    kept = len(cut.channels[0].samples)
    assert END - 16 <= kept <= END
    np.testing.assert_array_equal(cut.channels[1].samples, samples[1, :kept])
    (fault,) = cut.faults
    assert not fault.refuse
    assert "The last 1.1" in fault.text


def test_what_was_filled_in_before_the_pulse_is_left_out():
    samples = stream(((1.0, 700.0),), 3.0)
    samples[:, : RATE_HZ // 2] = 0.0
    cut = without_filling(record(samples))
    assert len(cut.channels[0].samples) == pytest.approx(2.5 * RATE_HZ, abs=2)
    assert "The first 0.5 s repeat one value" in cut.faults[0].text


@pytest.mark.parametrize("step", [0.005, 0.02, 0.05, 0.2])
@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_coarse_records_that_have_decayed_are_not_filled(step, noise):
    samples = stream(((0.3, 700.0),), 8.0)
    exact = samples - (1 - noise) * (stream(((0.3, 0.0),), 8.0))  # without the noise
    coarse = np.round(exact / step) * step
    own = record(np.vstack([exact[:1], coarse[1:]]))
    assert without_filling(own) is own
    assert lost_samples(own) == ()


def test_force_windows_and_channels_that_end_alone_are_no_filling():
    samples = stream(*ONE)
    samples[0, round(0.35 * RATE_HZ) :] = 0.0
    own = record(samples)
    assert without_filling(own) is own
    samples[2, END:] = samples[2, END]  # a cable breaks: that channel cannot be used
    own = record(samples)
    assert without_filling(own) is own
    hit = Hit(Path("hit.csv"), "+x", float(RATE_HZ), samples[0], samples[1:])
    (fault,) = channel_faults(hit)
    assert fault.kind == "dead"
    assert "along y repeats one value for the last 1.1 s" in fault.text


@pytest.mark.parametrize("lost", [0.0, None])
def test_samples_lost_inside_are_told_with_their_time(lost):
    samples = stream(*ONE)
    samples[:, 600:664] = samples[:, 599:600] if lost is None else lost
    own = record(samples)
    assert without_filling(own) is own
    (fault,) = lost_samples(own)
    assert fault.refuse
    assert "0.58" in fault.text


def test_a_stream_that_ends_filled_up_loses_that_and_its_hits_say_so():
    samples = stream(((1.0, 700.0), (4.0, 800.0), (7.0, 700.0)), 12.0)
    samples[:, 8 * RATE_HZ :] = 0.0
    hits = cut_into_hits(without_filling(record(samples)))
    assert [round(hit.at_s, 1) for hit in hits] == [1.0, 4.0, 7.0]
    assert ["filled" in {f.kind for f in hit.faults} for hit in hits] == [False, False, True]


def test_hits_that_follow_too_soon_are_told():
    at = (1.0, 4.0, 4.8, 8.0, 11.0)
    hits = cut_into_hits(record(stream([(t, 700.0) for t in at], 14.0)))
    assert [round(hit.at_s, 1) for hit in hits] == list(at)
    kinds = [{f.kind: f.refuse for f in hit.faults} for hit in hits]
    assert [list(one) for one in kinds] == [[], ["cut_off"], ["not_at_rest"], [], []]
    assert "the next hit follows 0." in hits[1].faults[0].text
    assert len({len(hit.channels[0].samples) for k, hit in enumerate(hits) if k not in (1, 2)}) == 1


def test_what_the_last_hits_lack_costs_the_others_nothing():
    samples = stream([(t, 700.0) for t in (1.0, 5.0, 9.0)], 11.5)  # the last has died out
    whole = cut_into_hits(record(samples))
    assert [hit.faults for hit in whole] == [(), (), ()]
    for left in (1.0, 0.3, 0.02):
        hits = cut_into_hits(record(samples[:, : round((9.0 + left) * RATE_HZ)]))
        assert [[f.kind for f in hit.faults] for hit in hits] == [[], [], ["cut_off"]]
        assert len(hits[0].channels[0].samples) > 3.5 * RATE_HZ


def test_soft_hits_beside_hard_ones_are_hits_of_their_own():
    peaks = (900.0, 150.0, 25.0, 800.0)  # each at least 12 % of a harder one's
    hits = cut_into_hits(record(stream([(1.0 + 3 * k, p) for k, p in enumerate(peaks)], 13.0)))
    assert len(hits) == 4


@pytest.mark.parametrize("bits", [16, 24, 32, 0])
def test_wav_of_every_width_is_scaled_by_its_table(tmp_path, bits):
    samples = stream(*ONE)
    path = tmp_path / "hit.wav"
    write_wav(path, samples, "-y", bits)
    (found,) = read_wav(path)
    assert [c.direction for c in found.channels] == [-2, 1, 2, 3]
    assert [c.unit for c in found.channels] == ["N", *3 * ("m/s^2",)]
    step = np.array(SCALES) * (2.0**-24 if bits == 0 else 2.0 ** -(bits - 1))
    for channel, values, own in zip(found.channels, samples, step, strict=True):
        np.testing.assert_allclose(channel.samples, values, atol=0.51 * own)
    copy = tmp_path / "elsewhere" / "0123.wav"
    copy.parent.mkdir()
    copy.write_bytes(self_contained(path, path.read_bytes()))
    assert self_contained(copy, copy.read_bytes()) == copy.read_bytes()
    for one, other in zip(read_wav(copy)[0].channels, found.channels, strict=True):
        np.testing.assert_array_equal(one.samples, other.samples)
        assert replace(one, samples=other.samples).__dict__ == other.__dict__


WRONG = {
    "channel,name,unit\n1,force,N\n": "no column full_scale",
    "channel,name,unit,full_scale\n1,force,N,0\n": "row 2: channel 1 needs",
    "channel,name,unit,full_scale\n1,force,N,8\n1,a x,g,5\n": "channel 1 twice",
    "channel,name,unit,full_scale\n9,force,N,8\n": "has 4 channels",
    "file,channel,name,unit,full_scale\nb.wav,1,force,N,8\n": "no row for hit.wav",
    "channel,name,unit,full_scale,hit\n1,force,N,8,+x\n2,a x,g,5,+y\n": r"hit is \+x and \+y",
}


@pytest.mark.parametrize("table", WRONG)
def test_wrong_scales_and_files_are_refused_in_words(tmp_path, table):
    path = tmp_path / "hit.wav"
    write_wav(path, stream(*ONE), "+x")
    (tmp_path / "channels.csv").write_text(table)
    with pytest.raises(InputError, match=WRONG[table]):
        read_wav(path)


@pytest.mark.parametrize("cut", [0, 3, 30, 60, 5000, -3])
def test_wav_files_that_are_cut_off_are_refused_and_kept_as_they_are(tmp_path, cut):
    path = tmp_path / "hit.wav"
    write_wav(path, stream(*ONE), "+x")
    torn = path.read_bytes()[:cut]
    whole = torn[:4] + np.uint32(max(0, len(torn) - 8)).tobytes() + torn[8:]  # as it says
    for data in (torn, whole):
        path.write_bytes(data)
        assert self_contained(path, data) == data
        with pytest.raises(InputError, match=r"hit\.wav is"):
            read_wav(path)
