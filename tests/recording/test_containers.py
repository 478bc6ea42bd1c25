"""Hits in containers as other programs write them: structs, cells, groups, waveforms, segments."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.io

from planner.errors import InputError
from planner.recording.hits import hits_from
from planner.recording.read import hits_in, read
from planner.recording.records import FrfRecord
from tests.support.containers import MANY_HITS, ONE_HIT, SPECIAL, late_h5, lvm, lvm_file, tdms
from tests.support.simulated_hits import make_hit


def part(hit, at):
    return replace(hit, force_n=hit.force_n[at], acceleration_m_s2=hit.acceleration_m_s2[:, at])


HITS = [make_hit(np.random.default_rng(k), axis="+x", record_s=1.0) for k in range(3)]
NAN = replace(HITS[1], force_n=np.where(np.arange(512) == 10, np.nan, HITS[1].force_n))


def same(found, made, skip=0, digits=1e-6, rate=1e-4):
    """Whether a hit was read as it was made, from a sample on."""
    scale = np.max(np.abs(made.acceleration_m_s2))
    assert found.sampling_rate_hz == pytest.approx(made.sampling_rate_hz, rel=rate)
    np.testing.assert_allclose(found.force_n, made.force_n[skip:], rtol=0, atol=digits * 1e3)
    np.testing.assert_allclose(
        found.acceleration_m_s2, made.acceleration_m_s2[:, skip:], rtol=0, atol=digits * scale
    )


@pytest.mark.parametrize("what", ONE_HIT)
def test_a_hit_is_read_from_any_container(tmp_path, what):
    name, write = ONE_HIT[what]
    write(tmp_path / name, HITS)
    (hit,) = hits_from(read(tmp_path / name))
    same(hit, HITS[0])
    assert hit.axis == HITS[0].axis
    assert max(1, len(hits_in(tmp_path / name))) == 1
    assert not hit.faults


@pytest.mark.parametrize("what", MANY_HITS)
def test_each_group_that_is_a_hit_is_one(tmp_path, what):
    name, write = MANY_HITS[what]
    write(tmp_path / name, HITS)
    found = hits_from(read(tmp_path / name))
    assert len(found) == max(1, len(hits_in(tmp_path / name))) == len(HITS)
    for hit, made in zip(found, HITS, strict=True):
        same(hit, made)


LONG = make_hit(np.random.default_rng(5), record_s=4.0)
LATE = {
    "TDMS, wf_start_time": (".tdms", lambda p, by: tdms(p, [LONG], by=by)),
    "TDMS, wf_start_offset": (".tdms", lambda p, by: tdms(p, [LONG], by=by, key="wf_start_offset")),
    "LVM, one x column": (".lvm", lambda p, by: lvm_file(late=by)(p, [LONG])),
    "LVM, many x columns": (".lvm", lambda p, by: lvm_file(late=by, x="Multi")(p, [LONG])),
    "HDF5, t0": (".h5", lambda p, by: late_h5(p, LONG, by, lambda s: s)),
    "HDF5, dates": (".h5", lambda p, by: late_h5(p, LONG, by, "2026-03-01T08:00:{:09.6f}Z".format)),
}  # fmt: skip


@pytest.mark.parametrize("by", [26, 1536], ids=["51 ms", "3 s"])
@pytest.mark.parametrize("what", LATE)
def test_channels_that_begin_apart_are_laid_over_each_other(tmp_path, what, by):
    suffix, write = LATE[what]
    path = tmp_path / f"late{suffix}"
    write(path, by)
    (hit,) = hits_from(read(path), "+x")
    same(hit, LONG, skip=by)
    assert "begin" in hit.faults[0].text


def test_what_is_no_part_of_a_hit_is_left_out_and_said(tmp_path):
    from nptdms import ChannelObject

    extra = [
        ChannelObject("slow", "Temperature", np.arange(60.0), {"wf_increment": 1.0}),
        ChannelObject("settings", "Sensitivity", np.arange(4.0)),
        ChannelObject("settings", "Operator", ["us", "them"]),
    ]
    tdms(tmp_path / "more.tdms", HITS[:1], extra)
    (hit,) = hits_from(read(tmp_path / "more.tdms"))
    same(hit, HITS[0])
    assert [f.text for f in hit.faults] == ["Left out, as no part of a hit: slow/Temperature (60)."]


def test_frfs_of_a_measuring_program_are_read(tmp_path):
    lines = np.linspace(0.0, 100.0, 201)
    values = (1 + 1j * lines) / 100
    x = {"start_value": 0.0, "increment": 0.5, "quantity": {"label": "Hz"}}
    made = {}
    for k, axis in enumerate("XYZ", 1):
        y = {"values": values * k, "quantity": {"label": "(mm/s^2)/N"}}
        own = {"x_values": x, "y_values": y, "function_record": {"name": f"acc {axis}"}}
        made[f"FRF_{k}"] = own
    scipy.io.savemat(tmp_path / "frfs.mat", made)
    (record,) = read(tmp_path / "frfs.mat")
    assert isinstance(record, FrfRecord)
    assert (record.quantity, record.unit) == ("accelerance", "m/s^2/N")
    assert [felt.direction for felt, _ in record.places] == [1, 2, 3]
    at = np.searchsorted(lines, record.frequency_hz)
    np.testing.assert_allclose(record.frequency_hz, lines[at])
    np.testing.assert_allclose(record.values, np.outer([1e-3, 2e-3, 3e-3], values[at]))


def changed(old, new, **options):
    """A LabVIEW file with words replaced."""
    text = lvm(HITS[:1], **options)
    assert old in text
    return lambda path: path.write_text(text.replace(old, new, 1))


def mat_of(**entries):
    return lambda path: scipy.io.savemat(path, entries)


def cut_after(word, count):
    """A file of three hits that ends after a word's occurrence."""
    parts = lvm(HITS).split(word)
    return lambda path: path.write_text(word.join(parts[:count]) + word)


def damaged_heap(path):
    """HDF5 whose free space among its texts has no size."""
    ONE_HIT["HDF5: channels in rows"][1](path, HITS)
    data = bytearray(path.read_bytes())
    at = data.index(b"GCOL") + 16
    while any(data[at : at + 2]):
        at += 16 + -(-int.from_bytes(data[at + 8 : at + 16], "little") // 8) * 8
    data[at + 8 : at + 16] = bytes(8)
    path.write_bytes(data)


UNIT_TWICE = {
    "values": np.ones(99),
    "quantity": {"label": "g", "unit_transformation": {"factor": 9.8}},
}
MATRIX = np.ones((300, 3))
WORD = "\n0.009766\t", "\n0.009766\tx"
WORD_ROW = lvm(HITS).split(WORD[0])[0].count("\n") + 2
REFUSED = {
    "a matrix without names": (".mat", mat_of(Freq=np.arange(300.0), Recep=MATRIX * 1j),
        r"Freq \(300\), Recep \(300 × 3, lacks 3 names beside it\).*frequency_hz and receptance"),
    "a struct without names": (".mat", mat_of(S={"y": {"values": MATRIX, "unit": "N"}, "dt": 1.0}),
        r"S/y/values \(300 × 3, lacks 3 names"),
    "a vector without a name": (".mat", mat_of(S={"p": np.ones(9), "q": np.ones(9)}),
        r"S/p \(9, lacks a known name or unit\)"),
    "no numbers": (".mat", mat_of(a=1.0, b="text"), "no arrays of numbers"),
    "a factor beside a unit": (".mat", mat_of(S={"x": {"increment": 1e-3}, "y": UNIT_TWICE}),
        "in g and has a factor 9.8"),
    "two steps of one channel": (".mat", mat_of(force_n=np.ones(99), dt=1e-3, fs=2000.0),
        r"steps of 0.0005 and 0.001 s"),
    "a hit among others with what is no number": (
        ".mat", lambda path: MANY_HITS["MAT: an array of structs"][1](path, [HITS[0], NAN]),
        "sample 11 is not a finite"),
    "HDF5: a damaged heap of texts": (".h5", damaged_heap, "damaged where its texts lie"),
    "LVM: spectra": (".lvm", changed("X_Dimension\tTime", "X_Dimension\tFrequency"), "over Hz"),
    "LVM: a step of a word": (
        ".lvm", changed("Delta_X\t0.001953", "Delta_X\tabout"), "Delta_X about is no number"),
    "LVM: a word": (".lvm", changed(*WORD), f"row {WORD_ROW}: Hammer is x"),
    "LVM: fewer rows than stated": (".lvm", changed("Samples\t512", "Samples\t513"), "cut off"),
    "LVM: two rates": (".lvm", changed("\t0.001953\t", "\t0.000977\t", x="No"), "different rates"),
    "LVM: cut within a later header": (
        ".lvm", cut_after("Y_Unit_Label", 2), "within a header"),
    "LVM: cut before the rows": (
        ".lvm", cut_after("Comment", 2), "within a header"),
    "LVM: cut within a special block": (
        ".lvm", lambda path: path.write_text(f"{lvm(HITS[:1])}\n{SPECIAL[:40]}"),
        "within a header"),
    "LVM: a header alone": (
        ".lvm", lambda path: path.write_text(lvm(HITS)[:300]), "within a header"),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_what_is_not_understood_is_said(tmp_path, what):
    suffix, write, words = REFUSED[what]
    path = tmp_path / f"odd{suffix}"
    write(path)
    with pytest.raises(InputError, match=words):
        read(path)


@pytest.mark.parametrize("clock", ["08:00:30-25", "88:00:30.25"])
def test_a_date_that_is_none_is_no_date(tmp_path, clock):
    (tmp_path / "zone.lvm").write_text(lvm(HITS[:1]).replace("08:00:30.25", clock))
    (hit,) = hits_from(read(tmp_path / "zone.lvm"))
    same(hit, HITS[0])


def test_segments_that_go_on_are_one_record(tmp_path):
    parts = [part(HITS[0], slice(256)), part(HITS[0], slice(256, None))]
    text = lvm(parts).replace("08:01:30.25", "08:00:30.75").replace("hit\t+x", "hit\t-y")
    (tmp_path / "on.lvm").write_text(text)
    (hit,) = hits_from(read(tmp_path / "on.lvm"))
    same(hit, HITS[0])
    assert hit.axis == "-y"
    (tmp_path / "on.lvm").write_text(text.replace("08:00:30.75", "08:00:31.75"))
    assert len(hits_in(tmp_path / "on.lvm")) == 2


CUT = [w for w in (ONE_HIT | MANY_HITS) if w.startswith(("MAT: ", "MAT 7", "LVM"))]


@pytest.mark.parametrize("what", CUT)
def test_every_cut_of_mat_and_lvm_is_found(tmp_path, what):
    """What else may be damaged: test_fuzz.py."""
    name, write = (ONE_HIT | MANY_HITS)[what]
    path = tmp_path / name
    write(path, [part(hit, slice(40)) for hit in HITS])
    whole = path.read_bytes()
    for end in np.random.default_rng(0).integers(140, len(whole) - 20, 4):
        path.write_bytes(whole[:end])
        with pytest.raises(InputError, match=r"\.$"):
            read(path)
