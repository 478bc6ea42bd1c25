"""`planner modes` of FRFs that state little, and of bands in which they have no lines."""

import numpy as np
import pytest
from scipy.io import savemat

from tests.support.hit_files import write_table
from tests.support.outside import modes, only_told, refused, told
from tests.support.structures import plate

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
