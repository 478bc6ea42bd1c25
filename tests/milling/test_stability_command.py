"""`planner stability` as a user gives it: the answer's JSON, and one sentence for what is wrong."""

from pathlib import Path

import numpy as np
import pytest

from tests.support.milling_cases import (
    HERTZ,
    KILOGRAM,
    ZETA,
    cut_toml,
    modes_toml,
    two_each_way,
)
from tests.support.outside import refused, said, told
from tests.support.rerun_columns import lines_of

MODES = modes_toml([HERTZ], [ZETA], [KILOGRAM], [[1.0, 0.0, 0.0]])
CUT = cut_toml(spindle_rpm=(10000, 20000, 2))


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    modes, cut = tmp_path / "modes.toml", tmp_path / "cut.toml"
    modes.write_text(MODES)
    cut.write_text(CUT)
    return modes, cut


def test_answer_is_one_json_document(files):
    modes, cut = files
    answer = told("stability", modes, "--cut", cut, "--point", "5000,0.001")
    assert answer["spindle_rpm"] == [10000, 20000]
    assert answer["depth_limit_m"] == pytest.approx([3.224e-4, 1.4175e-3], rel=1e-3)
    assert answer["kind"] == ["hopf", "flip"]
    assert answer["depth_limit_m_at_95"] == answer["depth_limit_m"]
    assert answer["chatter_hz"] == pytest.approx([930.3, 1000.0], abs=0.1)
    assert answer["multiplier"] == pytest.approx(1.406474, abs=1e-6)
    cut.write_text(CUT.replace("[0.0, 0.01, 400]", "[0.0, 1e-4, 10]"))  # stable to the deepest
    answer = told("stability", modes, "--cut", cut)
    assert answer["depth_limit_m"] == answer["kind"] == [None, None]


def test_frfs_of_predict_and_the_picture(files, tmp_path):
    _, cut = files
    lines = np.arange(200.0, 2400.0, 2.0)
    h = np.zeros((2, 3, 3, len(lines)), complex)
    h[:, :2, :2] = two_each_way().receptance(lines).transpose(1, 2, 0)
    h *= (2j * np.pi * lines) ** 2
    npz = tmp_path / "frfs.npz"
    np.savez(npz, frequency_hz=lines, frf_mean=h, frf_sd=0.02 * abs(h), pose=np.array(["A", "B"]))
    command = "stability", npz, "--cut", cut
    assert "--pose" in refused(*command, "--json")
    files = "--plot", tmp_path / "pictures", "--rrd", tmp_path / "lobes.rrd"
    answer = told(*command, "--pose", "B", "--samples", 20, *files)
    assert np.all(np.less(answer["depth_limit_m_at_95"], answer["depth_limit_m"]))
    assert (tmp_path / "pictures" / "stability.png").stat().st_size > 10_000
    drawn = lines_of(tmp_path / "lobes.rrd")
    low, high = (
        np.concatenate(drawn[f"/figures/stability/0/{name}"])[:, 1]
        for name in ("stable_with_95___probability", "limit")
    )
    assert np.mean(low) > np.mean(high)  # the image's second axis points down


WRONG_CUTS = {
    "no teeth": ("teeth = 2", "teeth = 0"),
    "half a tooth": ("teeth = 2", "teeth = 1.5"),
    "negative depth": ("[0.0, 0.01, 400]", "[-0.001, 0.01, 400]"),
    "depths that fall": ("[0.0, 0.01, 400]", "[0.02, 0.01, 400]"),
    "depth in mm": ("[0.0, 0.01, 400]", "[0.0, 10.0, 400]"),
    "no depth": ("[0.0, 0.01, 400]", "[0.0, 0.0, 400]"),
    "a misspelt key": ("kt_n_m2", "kt_n_mm2"),
    "a missing unit": ("diameter_m =", "diameter ="),
    "coefficient in N/mm2": ("kt_n_m2 = 600000000.0", "kt_n_m2 = 600"),
    "no speed": ("[10000, 20000, 2]", "[0, 20000, 2]"),
    "one speed of two": ("[10000, 20000, 2]", "[10000, 20000, 1]"),
    "feed along the axis": ("feed = [1.0, 0.0, 0.0]", "feed = [0.0, 0.0, 1.0]"),
    "feed of no length": ("feed = [1.0, 0.0, 0.0]", "feed = [0.0, 0.0, 0.0]"),
    "another sort of milling": ('"slot"', '"sideways"'),
    "a narrow slot": ("radial_immersion = 1.0", "radial_immersion = 0.5"),
    "not a number": ("kr_n_m2 = 200000000.0", "kr_n_m2 = nan"),
    "another method": ('"full_discretisation"', '"fast"'),
    "pitches that do not close": ("teeth = 2", "teeth = 2\npitch_deg = [100.0, 200.0]"),
    "no TOML": ("teeth = 2", "teeth 2"),
}
WRONG_MODES = {
    "no mode": (MODES, ""),
    "zero damping": ("0.011", "0.0"),
    "damping in percent": ("0.011", "1.1"),
    "negative mass": ("0.03993", "-1.0"),
    "direction too long": ("[1.0, 0.0, 0.0]", "[1.0, 1.0, 0.0]"),
    "across the cut": ("[1.0, 0.0, 0.0]", "[0.0, 0.0, 1.0]"),
    "a mass without unit": ("mass_kg", "mass"),
}


@pytest.mark.parametrize("what", [*WRONG_CUTS, *WRONG_MODES])
def test_wrong_cuts_and_modes_are_refused_in_a_sentence(files, what: str):
    (modes, cut), of_cut = files, what in WRONG_CUTS
    file, text = (cut, CUT) if of_cut else (modes, MODES)
    old, new = (WRONG_CUTS if of_cut else WRONG_MODES)[what]
    assert old in text
    file.write_text(text.replace(old, new))
    assert "failed inside" not in refused("stability", modes, "--cut", cut, "--json")


POINTS = ("5000", "5000,-0.001", "0,0.001", "a,b", "5000,0.001,1", "nan,nan")


@pytest.mark.parametrize(
    ("source", "more"),
    [
        *(("modes.toml", ("--point", point)) for point in POINTS),
        *((name, ()) for name in ("missing.npz", "missing.toml", "junk.npz", "junk.uff")),
    ],
)
def test_wrong_points_and_sources_are_refused_in_a_sentence(files, source: str, more):
    _, cut = files
    if source.startswith("junk"):
        (cut.parent / source).write_bytes(bytes(range(256)) * 8)
    found = refused("stability", cut.parent / source, "--cut", cut, *more)
    assert "failed inside" not in found


def test_one_wrong_line_of_exact_frfs_is_no_crash(files, tmp_path):
    """A pole of which nothing but noise-free lines tell has no variance."""
    hz, table = np.arange(0.5, 60.0, 0.5), {"frequency_hz": np.arange(0.5, 60.0, 0.5)}
    modes = (17.0, 0.022, 0.8, 0.5), (31.0, 0.017, -0.4, 0.85), (52.0, 0.031, 0.2, -0.3)
    for i, j in ("xx", "xy", "yx", "yy"):
        h = sum(
            dict(x=x, y=y)[i] * dict(x=x, y=y)[j] / 80 * hz**2 / (hz**2 - 2j * z * f * hz - f**2)
            for f, z, x, y in modes
        )
        table |= {f"accelerance_{i}{j}_re": h.real, f"accelerance_{i}{j}_im": h.imag}
    for part in ("re", "im"):
        table[f"accelerance_yy_{part}"][83] *= 1000
    frfs, cut = tmp_path / "frfs.csv", files[1]
    rows = np.column_stack(list(table.values()))
    np.savetxt(frfs, rows, fmt="%.12g", delimiter=",", header=",".join(table), comments="")
    cut.write_text(CUT.replace("[10000, 20000, 2]", "[1200, 2400, 4]"))
    said("stability", frfs, "--cut", cut)
