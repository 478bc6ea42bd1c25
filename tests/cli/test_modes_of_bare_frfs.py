"""`planner modes` of what states little: bare FRFs, text, bands without lines, responses alone.

Where FRFs as text were felt and hit: from recordings.csv, or, where asked, from file names.
"""

from pathlib import Path

import numpy as np
import pytest
import scipy.signal
from scipy.io import savemat

from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.proof.recordings import uff_channel, write_sets
from planner.recording.read import place_in_name
from planner.robot.robot import Robot
from tests.support.hit_files import write_table
from tests.support.hit_structures import agree
from tests.support.milling_cases import cut_toml, modes_toml
from tests.support.outside import modes, only_told, refused, told
from tests.support.rerun_columns import lines_of
from tests.support.structures import Structure, plate

BAND = (25.0, 120.0)
PLATE = plate(3, 3)
NODES = range(len(PLATE.nodes))


def exact_frfs(folder, names, axis=0, turned=False):
    """Exact FRFs of the plate's first points as named columns, one file each; none has a node."""
    hz, files = np.arange(1, 601) * 0.25, []
    for k, name in enumerate(names):
        h = PLATE.accelerance(hz, [k], [axis])[0, 0] * (-1 if turned else 1)
        table = {"frequency_hz": hz, f"{name}_re": h.real, f"{name}_im": h.imag}
        files.append(write_table(folder / f"{k}.csv", table))
    return files


def test_a_turned_channel_of_a_nameless_point(tmp_path):
    (path,) = exact_frfs(tmp_path, ["accelerance_xx"], turned=True)
    answer = told("modes", path, "--band-hz", *BAND)
    assert (answer["dofs"], len(answer["modes"])) == ([["", "x"]], 3)
    assert "The sign of the channel along x is turned" in " ".join(answer["remarks"])
    assert "node" not in " ".join(answer["remarks"])


def logged(path, rows, hz):
    """FRFs of rows as a logger saves them that knows no directions."""
    h = np.zeros((len(rows), hz.size), complex)
    h[:, 1:] = PLATE.accelerance(hz[1:], rows, [0])[:, 0]
    samples = 2 * (hz.size - 1)
    savemat(path, {"yspec": h.T, "npts": samples, "freq": hz[1] * samples, "tfun": 1})
    return path


def test_unlabelled_frfs_of_several_files_are_rows_of_one_analysis(tmp_path):
    hz = np.arange(513) * 0.25
    whole = logged(tmp_path / "whole.mat", list(NODES), hz)
    parts = [logged(tmp_path / f"{k}.mat", [2 * k, 2 * k + 1], hz) for k in range(4)]
    options = "--quantity", "accelerance", "--band-hz", *BAND
    answer = only_told("modes", *parts, logged(tmp_path / "last.mat", [8], hz), *options)
    assert len(answer["accepted"]) == 5
    assert [len(mode["shape"]) for mode in answer["modes"]] == 3 * [len(NODES)]
    assert answer["modes"] == told("modes", whole, *options)["modes"]
    other = logged(tmp_path / "other.mat", [0], hz * 1.5)
    code, _, err = modes(*parts, other, *options)
    assert code in (2, 3)
    assert "other.mat has other frequency lines" in err


@pytest.mark.parametrize(
    ("band", "told"),
    [((200, 400), "The FRFs end at 150 Hz, below the band of 200 to 400 Hz"),
     ((0.01, 0.2), "The FRFs begin at 0.25 Hz, above the band of 0.01 to 0.2 Hz")],
)  # fmt: skip
@pytest.mark.parametrize("kind", ["matrix", "pose", "folder", "unlabelled"])
def test_bands_that_frfs_do_not_hold_are_named(kind, band, told, tmp_path):
    if kind == "unlabelled":
        paths = [logged(tmp_path / "a.mat", [0, 1], np.arange(601) * 0.25)]
    else:
        names = [f"accelerance_{axis}x" for axis in ("xy" if kind == "matrix" else "xyz")]
        paths = exact_frfs(tmp_path, names)
    if kind == "folder":
        each = [np.loadtxt(p, delimiter=",", skiprows=1).T for p in paths]
        joined = {"frequency_hz": each[0][0]}
        for name, (_, real, imag) in zip(names, each, strict=True):
            joined |= {f"{name}_re": real, f"{name}_im": imag}
        for pose in ("P1", "P2"):
            write_table(tmp_path / f"{pose}.csv", joined)
        rows = "pose,hit,repeat,file\nP1,+x,1,P1.csv\nP2,+x,1,P2.csv\n"
        (tmp_path / "recordings.csv").write_text(rows)
        paths = [tmp_path]
    err = refused("modes", *paths, "--quantity", "accelerance", "--band-hz", *band, code=3)
    assert told in err
    assert "--band-hz" in err


def test_file_names_say_where_frfs_are_where_asked(tmp_path):
    hz = np.arange(1, 601) * 0.25
    paths = []
    for k in range(3):
        h = PLATE.accelerance(hz, [k], [0])[0, 0]
        names = "Frequency (Hz)", "Real ((m/s^2)/N)", "Imaginary ((m/s^2)/N)"
        table = dict(zip(names, (hz, h.real, h.imag), strict=True))
        paths.append(write_table(tmp_path / f"H{k + 1}_1.csv", table))
    options = "--band-hz", *BAND
    answer = only_told("modes", *paths, "--from-names", *options)
    assert answer["dofs"] == [[1, "scalar"], [2, "scalar"], [3, "scalar"]]
    assert all(mode["scaled"] for mode in answer["modes"])
    assert "dofs" not in only_told("modes", *paths, *options)


RATE_HZ, TONE_HZ = 640.0, 180.0
POINTS = [0, 5, 8, 15, 18, 23]
OPERATING_HZ = (30.0, 250.0)


def response(
    structure: Structure, points: list[int], seconds: float, rate_hz: float,
    rng: np.random.Generator,
) -> np.ndarray:  # fmt: skip
    """Accelerations (points, n) of modes below 0.45 of the rate, 2 % sensor noise on top."""
    poles, shapes = structure.poles()
    n = int(seconds * rate_hz)
    force = rng.normal(size=(len(structure.nodes), n))
    values = np.zeros((len(points), n))
    for pole, shape in zip(poles, shapes.T, strict=True):
        if np.abs(pole) / (2 * np.pi) > 0.45 * rate_hz:
            continue
        state = scipy.signal.lfilter([1], [1, -np.exp(pole / rate_hz)], shape @ force / rate_hz)
        values += 2 * np.real((shape[points] * pole**2)[:, None] * state)
    noise = 0.02 * np.std(values, axis=1, keepdims=True)
    return values + noise * rng.normal(size=values.shape)


@pytest.fixture(scope="module")
def structure():
    return plate(6, 4, ratio=(0.01, 0.01))


@pytest.fixture(scope="module")
def record(structure, tmp_path_factory):
    values = response(structure, POINTS, 100.0, RATE_HZ, np.random.default_rng(0))
    t = np.arange(values.shape[1]) / RATE_HZ
    values += np.std(values, axis=1, keepdims=True) * np.sin(2 * np.pi * TONE_HZ * t)
    sets = []
    for number, (point, samples) in enumerate(zip(POINTS, values, strict=True)):
        turned = -1 if number == 2 else 1
        felt = structure.nodes[point], 3 * turned
        sets.append(uff_channel(turned * samples, RATE_HZ, felt, (0, 0)))
    return write_sets(tmp_path_factory.mktemp("operating") / "running.uff", sets)


def test_modes_without_a_scale_and_the_tone_named(structure, record, tmp_path):
    drawn = "--plot", tmp_path, "--rrd", tmp_path / "modes.rrd"
    answer = only_told("modes", record, "--operating", "--band-hz", *OPERATING_HZ, *drawn)
    agree(answer, structure, OPERATING_HZ, 3e-3, 0.25, least=0.98, scale=None)
    assert answer["dofs"] == [[structure.nodes[p], "z"] for p in POINTS]
    assert answer["scaled"] is False
    assert answer["tones_hz"] == [pytest.approx(TONE_HZ, rel=1e-3)]
    assert "UNSCALED" in " ".join(answer["remarks"])
    assert [path.rsplit("/", 1)[1] for path in answer["plots"]] == ["stabilisation.png", "mac.png"]
    lines = {f"/figures/stabilisation/0/singular_value_{k}" for k in (1, 2, 3)}
    assert lines <= set(lines_of(tmp_path / "modes.rrd"))


def test_two_files_are_refused(record):
    assert "one record at a time" in refused("modes", record, record, "--operating")


MODES = {"xx": (22.0, 0.03, 200.0), "yy": (27.0, 0.025, 250.0)}
CUT = cut_toml(spindle_rpm=(600, 1400, 5), depth_m=(0.0, 0.02, 200))


def write_frf(path: Path, hertz: np.ndarray, values: np.ndarray, unit: str) -> None:
    """One FRF as a machinist's program writes it."""
    rows = [f"{f:.6g}\t{v.real:.9e}\t{v.imag:.9e}" for f, v in zip(hertz, values, strict=True)]
    path.write_text(f"Freq [Hz]\tReal [{unit}]\tImag [{unit}]\n" + "\n".join(rows) + "\n")


@pytest.mark.parametrize(
    ("name", "place"),
    [("tap_yx.txt", ("", "y", "", "x")), ("P1 +y-x.csv", ("", "+y", "", "-x")),
     ("H3_1.txt", ("3", "", "1", "")), ("frf_H31.csv.gz", ("3", "", "1", "")),
     ("plate-12z_3z.txt", ("12", "z", "3", "z"))],
)  # fmt: skip
def test_places_in_names(name, place):
    assert place_in_name(Path(name)) == place


@pytest.mark.parametrize("name", ["rec7.txt", "matrix.csv", "proxy.txt"])
def test_names_that_say_nothing(name):
    with pytest.raises(InputError, match="says neither axes nor nodes"):
        place_in_name(Path(name))


def test_a_tap_test_in_files_of_one_frf_each(tmp_path):
    taps, cut = tmp_path / "taps", tmp_path / "cut.toml"
    taps.mkdir()
    cut.write_text(CUT)
    hertz = np.arange(1, 400) * 0.25
    w = 2 * np.pi * hertz
    for name, (f, z, m) in MODES.items():
        wn = 2 * np.pi * f
        h = 1e6 / m / (wn**2 - w**2 + 2j * z * wn * w)
        write_frf(taps / f"tap_{name}.txt", hertz, h, "µm/N")
    own = zip(*MODES.values(), strict=True)
    (tmp_path / "modes.toml").write_text(modes_toml(*own, np.eye(3)[:2].tolist()))
    assert "does not state its directions" in refused("stability", taps, "--cut", cut)
    found = told("stability", taps, "--cut", cut, "--from-names")
    right = told("stability", tmp_path / "modes.toml", "--cut", cut)
    np.testing.assert_allclose(found["depth_limit_m"], right["depth_limit_m"], rtol=1e-3)


@pytest.mark.parametrize("how", ["table", "names"])
def test_frfs_as_text_into_a_campaign(first_pose, tmp_path, how):
    cell, taps = first_pose.cell, tmp_path / "taps"
    taps.mkdir()
    loaded = Robot.load(first_pose.robot)
    hertz, q = np.arange(4.0, 60.0, 0.1), loaded.joints.internal(first_pose.joints_deg)
    simulation = Simulation(loaded)
    (h,) = simulation.accelerance(q, hertz)
    columns = [f"{name}_deg" for name in loaded.joint_names]
    rows = [f"pose,{','.join(columns)},hit,response,file"]
    for i, felt in enumerate("xyz"):
        for j, hit in enumerate("xyz"):
            write_frf(taps / f"tap_{felt}{hit}.txt", hertz, h[i, j], "m/s²/N")
            angles = ",".join(f"{a:.6f}" for a in first_pose.joints_deg)
            rows.append(f"{first_pose.pose},{angles},+{hit},+{felt},tap_{felt}{hit}.txt")
    if how == "table":
        (taps / "recordings.csv").write_text("\n".join(rows) + "\n")
    imported = told("import", cell, taps, *(["--from-names"] if how == "names" else []))
    assert len(imported["accepted"]) == 9
    (expected,) = simulation.modes(q, 1).frequency_hz
    assert imported["modes"][0]["frequency_hz"] == pytest.approx(expected[0], rel=1e-3)
    assert told("replay", cell)["reproduced"]
