"""`planner modes` of FRFs between any points: files of any kind, no robot."""

import json

import numpy as np
import pytest

from planner.cli.run import run
from planner.modal.mac import mac
from tests.support.matrix_files import write_matrix
from tests.support.struck_structures import struck, unit_mass_shapes
from tests.support.structures import plate

LINES = np.arange(1, 601) * 0.5
REFERENCES = [0, 13, 37]
BAND = (40.0, 280.0)


@pytest.fixture(scope="module")
def structure():
    return plate()


@pytest.fixture(scope="module")
def matrix(structure):
    return struck(structure, REFERENCES, LINES, np.random.default_rng(3))


def modes(capsys, *arguments):
    code = run(["modes", *(str(a) for a in arguments), "--json"])
    captured = capsys.readouterr()
    return code, json.loads(captured.out) if captured.out else None, captured.err


def true_modes(structure):
    """Frequencies (m,) and shapes of unit modal mass (n, m) in the band."""
    poles, shapes = unit_mass_shapes(structure)
    hz = np.abs(poles) / (2 * np.pi)
    inside = (hz > BAND[0]) & (hz < BAND[1])
    return hz[inside], shapes[:, inside]


def agree(answer, structure, least=0.995, scale=0.03):
    """Every true mode is there, with its shape by node, and its scale where one is stated."""
    hz, shapes = true_modes(structure)
    found = np.array([m["frequency_hz"] for m in answer["modes"]])
    rows = [list(structure.nodes).index(node) for node, _ in answer["dofs"]]
    for f, true in zip(hz, shapes[rows].T, strict=True):
        mode = answer["modes"][int(np.argmin(np.abs(found - f)))]
        shape = np.array([complex(*value) for value in mode["shape"]])
        assert mode["frequency_hz"] == pytest.approx(f, rel=1e-3)
        assert mac(shape, true) > least
        if scale is not None:
            assert np.linalg.norm(shape) == pytest.approx(np.linalg.norm(true), rel=scale)


@pytest.mark.parametrize("kind", ["accelerance", "mobility", "receptance"])
def test_a_roving_hammer_set(structure, matrix, tmp_path, capsys, kind):
    path = write_matrix(tmp_path / "set.uff", matrix, kind, turned=[4, 9])
    code, answer, err = modes(capsys, path, "--band-hz", *BAND)
    assert (code, err) == (0, "")
    assert answer["dofs"] == [[node, "z"] for node in structure.nodes]
    assert answer["frfs"] == 150
    assert len(answer["modes"]) == len(true_modes(structure)[0])
    assert all(mode["scaled"] for mode in answer["modes"])
    agree(answer, structure)
