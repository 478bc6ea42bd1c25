"""What `planner modes` of a matrix writes for other programs, read back by pyuff."""

import csv

import numpy as np
import pytest
import pyuff
from PIL import Image

from planner.recording.geometry import read_geometry
from tests.support.hit_structures import hit_frfs
from tests.support.matrix_files import write_matrix
from tests.support.outside import told
from tests.support.structures import plate

BAND = (40.0, 180.0)


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
    return structure, matrix, path, folder, told("modes", path, "--band-hz", *BAND, *options)


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
    modes = told("modes", exported[2], "--band-hz", *BAND, "--real")["modes"]
    assert all(imag == 0 for mode in modes for _, imag in mode["shape"])
