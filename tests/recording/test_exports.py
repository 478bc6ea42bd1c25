"""Files as analysers, spreadsheets and machinists write them: read as meant, or refused."""

import re
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planner.dataset.screened_files import Source
from planner.errors import InputError
from planner.recording.column_names import lookup, lookup_ratio
from planner.recording.folder import read_poses, read_recordings
from planner.recording.named_columns import Named, to_records
from planner.recording.read import read
from planner.recording.sampling import sampling_rate
from planner.recording.uff import read_geometry
from tests.support.uff_files import NONE, dataset_58, dataset_58b_mixed, units_164, write

RATE = 512.0
TIME = np.arange(600) / RATE
FORCE = 300 * np.exp(-(((TIME - 0.1) / 0.004) ** 2))
ANSWER = np.where(TIME > 0.1, np.exp(-2 * (TIME - 0.1)) * np.sin(80 * (TIME - 0.1)), 0.0)
LINES = np.arange(1, 200) * 0.25
FRF = 0.02 * -((2 * np.pi * LINES) ** 2) / (90**2 - (2 * np.pi * LINES) ** 2 + 9j * LINES)

HEADS = {
    "planner's": "time_s,force_n,acceleration_x_m_s2",
    "brackets": "Time [s],Force [N],Acc X [m/s²]",
    "parentheses": "Time (s),Force (N),Acc. X (m/s^2)",
    "slash": "t/s,F/N,aX/(m/s^2)",
    "German": "Zeit [s],Kraft [N],Beschl. +X [m/s²]",
    "units below": "Time,Force,Acc X\ns,N,m/s2",
    "milliseconds and g": "Time (ms),Force (kN),Acc X (g)",
}


def table(head: str, delimiter: str = ",", decimal: str = ".") -> str:
    """A hit as text."""
    scaled = "milli" in head or "(ms)" in head
    scale = (1e3, 1e-3, 1 / 9.80665) if scaled else (1.0, 1.0, 1.0)
    rows = np.column_stack([TIME, FORCE, ANSWER]) * scale
    lines = [",".join(f"{v:.9f}" for v in row) for row in rows]
    body = "\n".join(lines).replace(",", "|").replace(".", decimal)
    return "# hit: +x\n" + "\n".join([head.replace(",", "|"), body]).replace("|", delimiter)


def check_hit(path: Path) -> None:
    """A file holds the hit above."""
    (record,) = read(path)
    assert record.sampling_rate_hz == pytest.approx(RATE, rel=1e-5)
    quantities = [(c.quantity, c.direction) for c in record.channels]
    assert quantities == [("force", 1), ("acceleration", 1)]
    np.testing.assert_allclose(record.channels[0].samples, FORCE, atol=1e-5)
    np.testing.assert_allclose(record.channels[1].samples, ANSWER, atol=1e-7)


@pytest.mark.parametrize("head", HEADS.values(), ids=HEADS)
@pytest.mark.parametrize("form", [",.", ";.", ";,", "\t.", "\t,"])
def test_headers_delimiters_and_decimals(tmp_path, head, form):
    path = tmp_path / "hit.csv"
    path.write_text(table(head, *form), encoding="utf-8")
    check_hit(path)


BLANKS = table("Time (s)   Force (N)   Acc X (m/s^2)", "   ").replace("   ", "  ")
TABBED = table(HEADS["brackets"], "\t")


@pytest.mark.parametrize(
    ("text", "code"),
    [(BLANKS, "ascii"), *((TABBED, code) for code in ("utf-8-sig", "utf-16", "utf-32", "cp1252"))],
)
def test_code_pages_and_blanks(tmp_path, text, code):
    path = tmp_path / "hit.txt"
    path.write_text(text, encoding=code)
    check_hit(path)


@pytest.mark.parametrize("written", ["%.4f", "%.6g", "%.5f", "%.7e"])
@given(start=st.floats(0, 30), rate=st.floats(200, 4000), count=st.integers(100, 3000))
def test_times_are_even_however_they_were_rounded(written, start, rate, count):
    exact = start + np.arange(count) / rate
    times = np.array([float(written % t) for t in exact])
    if times[-1] > times[0]:
        tolerance = 2e-4 / (times[-1] - times[0])
        assert sampling_rate(Path("t.csv"), times) == pytest.approx(rate, rel=tolerance)


@pytest.mark.parametrize("written", ["%.4f", "%.6g", "%.9f"])
@given(start=st.floats(0, 30), lost=st.integers(10, 190))
def test_a_lost_sample_is_more_than_rounding(written, start, lost):
    exact = np.delete(start + np.arange(200) / 300, lost)
    with pytest.raises(InputError, match="differs from the others"):
        sampling_rate(Path("t.csv"), np.array([float(written % t) for t in exact]))


FORMS = {
    "real and imaginary": ("Frequency (Hz)\tReal (m/s²/N)\tImag (m/s²/N)", FRF.real, FRF.imag),
    "units in a line": ("Frequency\tReal\tImaginary\nHz\t(m/s²)/(N)\t", FRF.real, FRF.imag),
    "g": ("Freq [Hz]\tRe [g/N]\tIm [g/N]", FRF.real / 9.80665, FRF.imag / 9.80665),
    "magnitude and phase": (
        "Frequency (Hz)\tMagnitude (m/s²/N)\tPhase (deg)", abs(FRF), np.angle(FRF, deg=True)),
    "radians": ("Frequenz [Hz]\tBetrag [m/s²/N]\tPhase [rad]", abs(FRF), np.angle(FRF)),
    "dB": ("Frequency (Hz)\tMagnitude (dB re 1 m/s²/N)\tPhase (°)",
           20 * np.log10(abs(FRF)), np.angle(FRF, deg=True)),
    "kHz": ("Frequency (kHz)\tReal (m/s²/N)\tImag (m/s²/N)", FRF.real, FRF.imag),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("decimal", [".", ","])
def test_frfs_as_text(tmp_path, form, decimal):
    head, first, second = FORMS[form]
    lines = LINES / 1e3 if form == "kHz" else LINES
    columns = np.column_stack([lines, first, second, np.full(len(LINES), 0.99)])
    rows = "\n".join("\t".join(f"{v:.9e}" for v in row) for row in columns)
    path = tmp_path / "frf.txt"
    head = head.replace("\n", "\tCoherence\n") + ("\t" if "\n" in head else "\tCoherence")
    path.write_text(f"# hit: +x\n# response: -y\n{head}\n{rows.replace('.', decimal)}")
    (record,) = read(path)
    assert (record.quantity, record.unit) == ("accelerance", "m/s^2/N")
    assert record.places == ((("", -2), ("", 1)),)
    np.testing.assert_allclose(record.frequency_hz, LINES)
    np.testing.assert_allclose(record.values[0], FRF, rtol=1e-6)
    np.testing.assert_allclose(record.coherence[0], 0.99)


BAD = {
    "phase of no unit": ("Frequency (Hz),Magnitude (m/N),Phase", "degrees or radians"),
    "no phase": ("Frequency (Hz),Magnitude (m/N),other", "without the other part"),
    "receptance in m/s/N": ("Frequency (Hz),Receptance real (m/s/N),Receptance imag", "which is"),
}


@pytest.mark.parametrize("what", BAD)
def test_frfs_that_cannot_be_read_right_are_refused(tmp_path, what):
    head, why = BAD[what]
    path = tmp_path / "frf.csv"
    rows = "\n".join(f"{f},{a},{b}" for f, a, b in zip(LINES, FRF.real, FRF.imag, strict=True))
    path.write_text(f"{head}\n{rows}")
    with pytest.raises(InputError, match=why):
        read(path)


@pytest.mark.parametrize(
    ("text", "quantity", "factor"),
    [("m/s²", "acceleration", 1), ("M/S^2", "acceleration", 1), ("m s-2", "acceleration", 1),
     ("in/s²", "acceleration", 0.0254), ("lbf", "force", 4.4482216), ("kgf", "force", 9.80665),
     ("(m/s)/N", "mobility", 1), ("g/lbf", "accelerance", 9.80665 / 4.4482216),
     ("[µm/N]", "receptance", 1e-6), ("m/s^2/N", "accelerance", 1),
     ("mm/s/s/kN", "accelerance", 1e-6),
     ("MN", None, 0), ("Nm", None, 0), ("furlong", None, 0)],
)  # fmt: skip
def test_units(text, quantity, factor):
    unit = lookup(text) or lookup_ratio(text)
    assert (unit and unit.quantity) == quantity
    assert unit is None or unit.factor == pytest.approx(factor)


SYSTEMS = {
    "inch, pound-force": (7, 39.37007874, 0.2248089431, 0.0254, 4.4482216),
    "mm, N": (10, 1000.0, 1.0, 1e-3, 1.0),
    "mm, kgf": (8, 1000.0, 0.1019716213, 1e-3, 9.80665),
    "the user's": (9, 100.0, 0.5, 1e-2, 2.0),
}


@pytest.mark.parametrize("system", SYSTEMS)
def test_units_of_dataset_164(tmp_path, system):
    code, per_m, per_n, length_m, force_n = SYSTEMS[system]
    plain = [(13, "Force", "NONE"), (12, "Acceleration", ""), (12, "labelled", "m/s2")]
    sets = [dataset_58(1, ANSWER, quantity) for quantity in plain]
    frf = dataset_58(4, FRF, (12, "Acceleration", "NONE"), (13, "Force", "NONE"), step=0.25)
    path = write(tmp_path / "a.uff", units_164(code, per_m, per_n), *sets, frf)
    hit, frfs = read(path)
    factors = [c.samples[200] / ANSWER[200] for c in hit.channels]
    assert factors == pytest.approx([force_n, length_m, 1.0], rel=1e-4)
    np.testing.assert_allclose(frfs.values[0], FRF * length_m / force_n, rtol=1e-4)
    wrong = write(tmp_path / "b.uff", units_164(7, 0.0254, 4.448), *sets)
    with pytest.raises(InputError, match="dataset 164"):
        read(wrong)


def test_universal_files_padded_uneven_and_labelled_by_a_ratio(tmp_path):
    force, padded = (13, "Force", "N"), 6 - len(ANSWER[:-2]) % 6
    (record,) = read(write(tmp_path / "p.uff", dataset_58(1, ANSWER[:-2], force, padded=padded)))
    np.testing.assert_allclose(record.channels[0].samples, ANSWER[:-2], atol=1e-5)
    (record,) = read(write(tmp_path / "n.uff", dataset_58(1, ANSWER, NONE)))
    assert record.channels[0].quantity == "unknown"
    (record,) = read(write(tmp_path / "u.uff", dataset_58b_mixed(TIME, ANSWER, force)))
    np.testing.assert_array_equal(record.channels[0].samples, ANSWER)
    assert record.sampling_rate_hz == pytest.approx(RATE)
    ratio = dataset_58(4, FRF, (0, "FRF", "(mm/s)/N"), step=0.25)
    (record,) = read(write(tmp_path / "r.uff", ratio))
    assert record.quantity == "mobility"
    np.testing.assert_allclose(record.values[0], 1e-3 * FRF, rtol=1e-4)
    contradicted = dataset_58(4, FRF, (12, "FRF", "(mm/s)/N"), (13, "F", "N"), step=0.25)
    with pytest.raises(InputError, match="which is mobility"):
        read(write(tmp_path / "c.uff", contradicted))


def test_channels_that_begin_apart_are_aligned(tmp_path):
    late, force, answer = 26, (13, "Force", "N"), (12, "Acceleration", "m/s^2")
    sets = [dataset_58(1, FORCE, force), dataset_58(1, ANSWER[late:], answer, start=late / RATE)]
    (record,) = read(write(tmp_path / "a.uff", *sets))
    samples = [c.samples for c in record.channels]
    np.testing.assert_allclose(samples, [FORCE[late:], ANSWER[late:]], atol=1e-3)
    assert "begin 0.0508 s apart" in record.remarks[0]
    away = dataset_58(1, ANSWER, answer, start=3.0)
    with pytest.raises(InputError, match="begin 3 s apart and have no time in common"):
        read(write(tmp_path / "b.uff", sets[0], away))


def test_a_file_that_is_too_large_is_not_searched_for_points(tmp_path):
    path = tmp_path / "large.uff"
    with open(path, "wb") as file:
        file.truncate((512 << 20) + 1)
    with pytest.raises(InputError, match="larger than 512 MiB"):
        read(path)
    with mock.patch("pyuff.UFF", side_effect=AssertionError):
        assert read_geometry((path,)) is None


def test_a_column_of_times_for_each_channel(tmp_path):
    first, second = TIME[: len(TIME) - 40], TIME[40:]
    columns = np.column_stack([first, FORCE[: len(first)], second, ANSWER[40:]])
    rows = "\n".join(";".join(f"{v:.9f}" for v in row) for row in columns)
    path = tmp_path / "a.csv"
    path.write_text(f"Time (s);Force (N);Time (s);Acc X (m/s²)\n{rows}".replace(".", ","))
    (record,) = read(path)
    both = slice(40, len(TIME) - 40)
    samples = [c.samples for c in record.channels]
    np.testing.assert_allclose(samples, [FORCE[both], ANSWER[both]], atol=1e-6)


@pytest.mark.parametrize(
    ("key", "value"),
    [("Fs", "512"), ("sample_rate", "0.512 kHz"), ("dt", "0.001953125"),
     ("Time step (ms)", "1.953125")],
)  # fmt: skip
def test_names_of_rates_and_steps(key, value):
    named = Named({"force_n": FORCE, "acceleration_x_m_s2": ANSWER}, {}, {key: value})
    (record,) = to_records(Path("a.mat"), named)
    assert record.sampling_rate_hz == pytest.approx(RATE)


def test_complex_time_histories_are_refused():
    named = Named({"time_s": TIME, "force_n": FORCE, "acceleration_x_m_s2": ANSWER + 1j * ANSWER})
    with pytest.raises(InputError, match="complex numbers, which no time history does"):
        to_records(Path("a.mat"), named)
    real = Named({"time_s": TIME, "force_n": FORCE + 0j})
    assert to_records(Path("a.mat"), real)


def test_poses_of_a_german_spreadsheet(tmp_path):
    path = tmp_path / "poses.csv"
    path.write_text("pose;joint_1_deg;Bemerkung\nP1;-12,5;größer\n", encoding="cp1252")
    assert read_poses(path, ["joint_1"])[0].joints_deg == (-12.5,)


@pytest.mark.parametrize("force_first", [True, False])
def test_a_sensor_that_roves_through_one_universal_file(tmp_path, force_first):
    force, answer = (13, "Force", "N"), (12, "Acceleration", "m/s^2")
    sets = []
    for node in (3, 4, 5):
        pair = [dataset_58(1, FORCE, force, hit=(1, 3)),
                dataset_58(1, node * ANSWER, answer, felt=(node, 3))]  # fmt: skip
        sets += pair if force_first else pair[::-1]
    records = read(write(tmp_path / "rove.uff", *sets))
    felt = [[c for c in r.channels if c.quantity == "acceleration"] for r in records]
    assert [[c.node for c in one] for one in felt] == [["3"], ["4"], ["5"]]
    (odd,) = read(write(tmp_path / "odd.uff", *sets[:5]))
    assert len(odd.channels) == 5


@pytest.mark.parametrize(
    ("felt", "hit", "said"),
    [((1, 2, 3), -6, r"its hit is about z, the table says \+z"),
     ((1, 2, 6), 3, "a response about z at")],
)  # fmt: skip
def test_what_turns_is_along_no_axis(tmp_path, felt, hit, said):
    sets = [dataset_58(4, FRF, (12, "A", "m/s^2"), (13, "F", "N"), (1, k), (1, hit), step=0.25)
            for k in felt]  # fmt: skip
    write(tmp_path / "m.uff", *sets)
    (tmp_path / "recordings.csv").write_text("pose,joint_1_deg,hit,file\nP1,5,+z,m.uff\n")
    (row,) = read_recordings(tmp_path, ["joint_1"])
    with pytest.raises(InputError, match=said):
        Source.of(row).read()


def test_rows_of_one_file_with_several_hits(tmp_path):
    frfs = [dataset_58(4, FRF, (12, "A", "m/s^2"), (13, "F", "N"), (1, felt), (1, hit), step=0.25)
            for hit in (1, 2) for felt in (1, 2, 3)]  # fmt: skip
    write(tmp_path / "all.uff", *frfs)
    head = "pose,joint_1_deg,hit,file\n"
    table = tmp_path / "recordings.csv"
    table.write_text(f"{head}P1,5,+x,all.uff\nP1,5,+y,all.uff\n")
    (row,) = read_recordings(tmp_path, ["joint_1"])
    ((), (record,)) = Source.of(row).read()
    assert len(record.values) == 6
    table.write_text(f"{head}P1,5,+x,all.uff\nP1,5,+z,all.uff\n")
    (row,) = read_recordings(tmp_path, ["joint_1"])
    with pytest.raises(InputError, match="was hit along x, y, the table lists"):
        Source.of(row).read()
    table.write_text(f"{head}P1,5,+x,all.uff\nP2,6,+y,all.uff\n")
    with pytest.raises(InputError, match="listed in row 2 already"):
        read_recordings(tmp_path, ["joint_1"])


@pytest.mark.parametrize("column", ["joint_1_rad", "J1", "joint 1 [°]", "A1"])
def test_joints_under_another_name_are_never_passed_over(tmp_path, column):
    """Of a proposed pose, too, whose joints would be known without the table."""
    (tmp_path / "a.uff").write_bytes(b"")
    (tmp_path / "recordings.csv").write_text(f"pose,{column},hit,file\nP1,0.5,+x,a.uff\n")
    with pytest.raises(InputError, match=f"joint_1_deg.*has.*{re.escape(column)}"):
        read_recordings(tmp_path, ["joint_1"], bare=True)
