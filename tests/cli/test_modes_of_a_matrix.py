"""`planner modes` of FRFs between any points: files of any kind, no robot.

What it writes for other programs is read back by pyuff.
"""

import csv
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyuff
from PIL import Image

from planner.frf.matrix import FrfMatrix
from planner.frf.synthesis import pole
from planner.modal.mac import mac
from planner.recording.points import Dof
from planner.recording.uff import read_geometry
from tests.support.hit_structures import agree, hit_frfs
from tests.support.matrix_files import transposed, write_matrix
from tests.support.outside import modes, only_told, told
from tests.support.rerun_columns import entities_of
from tests.support.structures import plate

LINES = np.arange(1, 601) * 0.5
REFERENCES = [0, 13, 37]
BAND, LOWER = (40.0, 280.0), (40.0, 180.0)


@pytest.fixture(scope="module")
def structure():
    return plate()


@pytest.fixture(scope="module")
def matrix(structure):
    return hit_frfs(structure, REFERENCES, LINES, np.random.default_rng(3))


def analysed(*arguments):
    """The answer of a command that must succeed without a word."""
    return only_told("modes", *arguments, "--band-hz", *BAND)


def places(structure):
    """Datasets 15 and 82: where the nodes are and what joins them."""
    nodes = np.array(structure.nodes)
    x, y, z = np.array([structure.position_m[n] for n in structure.nodes]).T
    ends = np.array([number for pair in structure.lines for number in (*pair, 0)])
    lines = {"type": 82, "trace_num": 1, "n_nodes": len(ends), "color": 0, "id": "", "nodes": ends}
    return [{"type": 15, "node_nums": nodes, "x": x, "y": y, "z": z}, lines]


def test_a_roving_hammer_set(structure, matrix, tmp_path):
    answer = analysed(write_matrix(tmp_path / "set.uff", matrix, "mobility", turned=[4, 9]))
    assert answer["dofs"] == [[node, "z"] for node in structure.nodes]
    assert answer["frfs"] == 150
    agree(answer, structure, BAND)


def test_several_files_one_per_reference_and_geometry_beside(structure, matrix, tmp_path):
    geometry = write_matrix(tmp_path / "geo.uff", matrix, before=places(structure), entries=[])
    paths = [
        write_matrix(tmp_path / f"{i}.uff", matrix, entries=[(o, i) for o in range(50)])
        for i in range(3)
    ]
    answer = analysed(*paths, geometry)
    assert answer["refused"] == []
    agree(answer, structure, BAND)


@pytest.mark.parametrize("column", [True, False])
def test_one_column_or_one_row(structure, matrix, tmp_path, column):
    matrix = matrix if column else transposed(matrix)
    entries = [(o, 1) if column else (1, o) for o in range(50)]
    agree(analysed(write_matrix(tmp_path / "set.uff", matrix, entries=entries)), structure, BAND)


def test_without_a_driving_point_shapes_are_not_scaled(structure, matrix, tmp_path):
    entries = [(o, 0) for o in range(1, 50)]
    answer = analysed(write_matrix(tmp_path / "set.uff", matrix, entries=entries))
    assert len(answer["dofs"]) == 49
    assert "not scaled" in " ".join(answer["remarks"])
    agree(answer, structure, BAND, scale=None)
    for mode in answer["modes"]:
        assert np.linalg.norm(mode["shape"]) == pytest.approx(1.0)


def test_unstated_quantity_and_scalar_directions(structure, matrix, tmp_path):
    unknown = {"ordinate_spec_data_type": 0, "ordinate_axis_units_lab": "NONE", "rsp_dir": 0,
               "ref_dir": 0}  # fmt: skip
    answer = analysed(write_matrix(tmp_path / "set.uff", matrix, **unknown))
    assert answer["dofs"][0] == [1, "scalar"]
    assert "--quantity" in " ".join(answer["remarks"])
    agree(answer, structure, BAND, scale=None)


def turned_channel(h):
    h[:, 1] *= -1


def exchanged_channels(h):
    h[[13, 25]] = h[[25, 13]]


def turned_point(h):
    h[24] *= -1


def exchanged_points(h):
    h[[8, 30]] = h[[30, 8]]


def single_ones(h):
    h[20, 0] *= -1
    h[[5, 33], 2] = h[[33, 5], 2]


def dead_channels(h):
    h[10], h[20, 1] = 0.0, 0.0


def nothing(h):
    pass


# What is wrong, whether places are known and the hammer moved, and what is said of it.
ODD = [
    (nothing, True, False, ()),
    (turned_channel, False, False, ("sign of the channel at node 14, z is turned",)),
    (exchanged_channels, False, False, ("Nodes 14 and 26 (z) are probably swapped",)),
    (turned_point, True, False, ("The sign at node 25, z is turned where it was felt",)),
    (turned_point, True, True, ("The sign at node 25, z is turned where it was hit",)),
    (exchanged_points, True, False, ("Nodes 9 and 31 are probably swapped",)),
    (exchanged_points, True, True, ("Nodes 9 and 31 are probably swapped",)),
    (single_ones, False, False, (
        "The FRF felt at node 21, z and hit at node 1, z has a turned sign",
        "felt at node 6, z and hit at node 38, z and felt at node 34, z and hit at")),
    (dead_channels, False, False, ("4 FRFs are zero throughout",)),
]  # fmt: skip


@pytest.mark.parametrize(("change", "placed", "hammer", "words"), ODD)
def test_what_is_wrong_is_named_and_nothing_else(
    structure, matrix, tmp_path, change, placed, hammer, words
):
    values = matrix.accelerance.copy()
    change(values)
    one = replace(matrix, accelerance=values)
    before = places(structure) if placed else ()
    path = write_matrix(tmp_path / "a.uff", transposed(one) if hammer else one, before=before)
    answer = analysed(path)
    assert len(answer["remarks"]) == len(words)
    assert all(text in " ".join(answer["remarks"]) for text in words)
    if change not in (exchanged_channels, exchanged_points):  # whose shapes are, too
        agree(answer, structure, BAND)
    if change is dead_channels:
        assert answer["frfs"] == 146
        assert [11, "z"] not in answer["dofs"]


def test_lines_that_differ_are_refused(matrix, tmp_path):
    first = write_matrix(tmp_path / "a.uff", matrix, entries=[(0, 0)])
    other = replace(matrix, frequency_hz=matrix.frequency_hz * 1.1)
    second = write_matrix(tmp_path / "b.uff", other, entries=[(1, 0)])
    code, _, err = modes(first, second)
    assert code in (2, 3)
    assert "b.uff has other frequency lines" in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize("placed", [True, False])
def test_the_recording_has_charts_shapes_and_mac_in_place_of_pictures(
    structure, matrix, tmp_path, placed
):
    path = write_matrix(tmp_path / "a.uff", matrix, before=places(structure) if placed else ())
    answer = only_told("modes", path, "--band-hz", 40, 130, "--rrd", tmp_path / "modes.rrd")
    wanted = {f"/figures/{name}/frame" for name in ("stabilisation", "driving_points", "mac")}
    shapes = {f"/modes/shape/{k + 1}/points" for k in range(len(answer["modes"]))}
    wanted |= shapes | {"/modes/shape/1/rest"} if placed else {"/figures/shapes/frame"}
    assert wanted <= entities_of(answer["rrd"])


def vectors_of(mode):
    """Right and left vector, and 2iω_d."""
    right, left = (np.array([complex(*v) for v in mode[side]]) for side in ("right", "left"))
    damped = mode["frequency_hz"] * np.sqrt(1 - mode["damping_ratio"] ** 2)
    return right, left, 4j * np.pi * damped


def test_right_and_left_vectors_of_a_reciprocal_structure_are_its_shape(
    structure, matrix, tmp_path
):
    answer = analysed(write_matrix(tmp_path / "set.uff", matrix))
    hit = [answer["dofs"].index(dof) for dof in answer["references"]]
    for mode in answer["modes"]:
        (right, left, _), shape = vectors_of(mode), np.array([complex(*v) for v in mode["shape"]])
        assert mac(right, shape) > 0.995
        assert max(mode["participation_percent"]) == pytest.approx(100)
        np.testing.assert_allclose(left, shape[hit], atol=0.05 * np.abs(shape).max())
        stiffness = (2 * np.pi * mode["frequency_hz"]) ** 2 * mode["modal_mass_kg"]
        assert min(mode["modal_stiffness_n_m"]) == pytest.approx(stiffness)


def test_right_and_left_vectors_of_a_robot_without_reciprocity(tmp_path):
    """Modes 1 to 5 of Lei et al. 2023, Table B1: both vectors come back, one shape would not do."""
    campaigns = Path(__file__).parents[2] / "campaigns"
    file = campaigns / "irb6660_lei2023" / "modes.toml"
    table = [m for m in tomllib.loads(file.read_text())["mode"] if m["frequency_hz"] < 100]
    hz, rng = np.arange(4.0, 40.0, 0.05), np.random.default_rng(31)
    s, h, residues = 2j * np.pi * hz, np.zeros((4, 4, 720), complex), []
    for mode in table:
        right, left = (np.array([complex(*v) for v in mode[side]]) for side in ("right", "left"))
        p = pole(np.array(mode["frequency_hz"]), np.array(mode["damping_ratio"]))
        r = np.outer(right, left)[..., None]
        residues.append((mode["frequency_hz"], right, left, r[..., 0]))
        h += s**2 * (r / (s - p) + r.conj() / (s - p.conj()))
    h *= 1 + 0.02 * (rng.standard_normal(h.shape) + 1j * rng.standard_normal(h.shape))
    points = tuple(Dof.of_uff(node, direction) for node in "12" for direction in (1, 2))
    matrix = FrfMatrix(hz, points, points, h, True)
    path = write_matrix(tmp_path / "set.uff", matrix, "receptance")
    answer = told("modes", path, "--export", tmp_path / "files")
    assert "right and left vectors" in " ".join(answer["remarks"])
    found = np.array([m["frequency_hz"] for m in answer["modes"]])
    for f, right, left, residue in residues:
        mode = answer["modes"][int(np.argmin(np.abs(found - f)))]
        own_right, own_left, scale = vectors_of(mode)
        assert min(mac(own_right, right), mac(own_left, left)) > 0.999
        off = np.outer(own_right, own_left) / scale - residue
        assert np.linalg.norm(off) < 0.05 * np.linalg.norm(residue)


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """A small plate with its geometry: its FRFs, their file, the folder, and the answer."""
    folder = tmp_path_factory.mktemp("exported")
    structure = plate(6, 4)
    matrix = hit_frfs(structure, [0, 9], np.arange(1, 401) * 0.5, np.random.default_rng(1))
    nodes = np.array(structure.nodes)
    place = 1e3 * np.array([structure.position_m[n] for n in structure.nodes])
    trace = np.array([k for line in structure.lines for k in (*line, 0)])
    plain = np.zeros(nodes.size, int)
    before = [
        {"type": 164, "units_code": 5, "units_description": "mm", "temp_mode": 1,
         "length": 1000.0, "force": 1.0, "temp": 1.0, "temp_offset": 273.15},
        {"type": 2411, "node_nums": nodes, "def_cs": plain, "disp_cs": plain, "color": plain,
         **dict(zip("xyz", place.T, strict=True))},
        {"type": 82, "trace_num": 1, "nodes": trace, "id": "plate"},
    ]  # fmt: skip
    path = write_matrix(folder / "set.uff", matrix, before=before)
    options = "--plot", folder / "pictures", "--export", folder / "files"
    return structure, matrix, path, folder, told("modes", path, "--band-hz", *LOWER, *options)


def sets(path):
    file = pyuff.UFF(str(path))
    return [file.read_sets(i) for i in range(len(file.get_set_types()))]


def test_the_geometry_is_read_in_metres_and_written_again(exported):
    structure, _, path, folder, _ = exported
    for source in (path, folder / "files" / "modes.uff"):
        geometry = read_geometry((source,))
        assert geometry is not None
        assert {(int(a), int(b)) for a, b in geometry.lines} == set(structure.lines)
        for node, place in structure.position_m.items():
            np.testing.assert_allclose(geometry.at(str(node)), place, atol=1e-5)
    kinds = [s["type"] for s in sets(folder / "files" / "modes.uff")]
    assert kinds[:5] == [151, 164, 15, 2411, 82]
    assert set(kinds[5:]) == {55}


def test_shapes_and_poles_come_back(exported):
    *_, folder, answer = exported
    shapes = [s for s in sets(folder / "files" / "modes.uff") if s["type"] == 55]
    assert len(shapes) == len(answer["modes"]) > 2
    for one, mode in zip(shapes, answer["modes"], strict=True):
        size = np.abs(one["eig"])
        assert size / (2 * np.pi) == pytest.approx(mode["frequency_hz"], rel=1e-5)
        assert -one["eig"].real / size == pytest.approx(mode["damping_ratio"], rel=1e-4)
        # With modal a = 2iω_d the residue is φφᵀ/a.
        assert one["modal_a"] == pytest.approx(2j * one["eig"].imag, rel=1e-5)
        values = dict(zip(one["node_nums"].tolist(), one["r3"], strict=True))
        for (node, direction), value in zip(answer["dofs"], mode["shape"], strict=True):
            assert direction == "z"
            assert values[node] == pytest.approx(complex(*value), rel=1e-4, abs=1e-5)


def test_frfs_come_back(exported):
    _, matrix, _, folder, _ = exported
    frfs = [s for s in sets(folder / "files" / "frfs.uff") if s["type"] == 58]
    assert len(frfs) == matrix.count
    names = [dof.node for dof in matrix.responses], [dof.node for dof in matrix.references]
    for one in frfs:
        at = names[0].index(str(one["rsp_node"])), names[1].index(str(one["ref_node"]))
        np.testing.assert_allclose(one["data"], matrix.accelerance[at], rtol=1e-9)
        np.testing.assert_allclose(one["x"], matrix.frequency_hz, rtol=1e-5)


def test_tables_hold_the_same_numbers(exported):
    folder, answer = exported[3] / "files", exported[4]
    with open(folder / "modes.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    hz = [mode["frequency_hz"] for mode in answer["modes"]]
    assert [float(row["frequency_hz"]) for row in rows] == hz
    with open(folder / "shapes.csv", newline="") as file:
        points = list(csv.DictReader(file))
    assert len(points) == len(hz) * len(answer["dofs"])
    assert answer["exports"] == [
        str(folder / name)
        for name in ("modes.uff", "frfs.uff", "modes.csv", "shapes.csv", "vectors.uff",
                     "vectors.csv")
    ]  # fmt: skip


def test_right_and_left_vectors_come_back(exported):
    *_, folder, answer = exported
    vectors = [s for s in sets(folder / "files" / "vectors.uff") if s["type"] == 55]
    assert len(vectors) == 2 * len(answer["modes"])
    for k, one in enumerate(vectors):
        mode, side = answer["modes"][k // 2], ("right", "left")[k % 2]
        assert one["id2"].startswith(f"{side} vector")
        values = dict(zip(one["node_nums"].tolist(), one["r3"], strict=True))
        dofs = answer["responses" if side == "right" else "references"]
        for (node, _), value in zip(dofs, mode[side], strict=True):
            assert values[node] == pytest.approx(complex(*value), rel=1e-4, abs=1e-5)


def test_pictures_and_moving_shapes(exported):
    answer = exported[4]
    names = [path.rsplit("/", 1)[1] for path in answer["plots"]]
    assert {"stabilisation.png", "mac.png", "complexity.png", "driving_points.png",
            "geometry.png", "shapes.png", "mode_01.gif"} <= set(names)  # fmt: skip
    moving = next(path for path in answer["plots"] if path.endswith("mode_02.gif"))
    with Image.open(moving) as image:
        frames = []
        for k in range(image.n_frames):
            image.seek(k)
            frames.append(np.asarray(image.convert("RGB"), float))
    assert len(frames) > 8
    assert np.mean(np.abs(frames[0] - frames[len(frames) // 2])) > 0.5
    assert np.ptp(frames[0]) > 100


def test_real_normal_modes(exported):
    modes = told("modes", exported[2], "--band-hz", *LOWER, "--real")["modes"]
    assert all(imag == 0 for mode in modes for _, imag in mode["shape"])
