"""Modes of matrices of FRFs against structures whose modes are known."""

import numpy as np
import pytest

from planner.modal.mac import mac
from planner.modal.matrix_modes import modes_of_matrix
from tests.support.struck_structures import struck, unit_mass_shapes
from tests.support.structures import aeroplane

LINES = np.arange(1, 801) * 0.2


def told(structure, modes, band):
    """Per true mode in the band: frequency, damping, MAC, scale, z scores, share covered."""
    poles, shapes = unit_mass_shapes(structure)
    hz = np.abs(poles) / (2 * np.pi)
    rows = []
    for k in np.flatnonzero((hz > band[0]) & (hz < band[1])):
        alike = [mac(mode.shape, shapes[:, k]) for mode in modes]
        mode = modes[int(np.argmax(alike))]
        true = shapes[:, k] * np.sign(np.vdot(mode.shape, shapes[:, k]).real)
        off = mode.shape - true
        inside = np.concatenate(
            [np.abs(part) < 1.96 * mode.shape_sd for part in (off.real, off.imag)]
        )
        rows.append(
            (
                max(alike),
                np.linalg.norm(mode.shape) / np.linalg.norm(true),
                (mode.frequency_hz - hz[k]) / mode.frequency_sd_hz,
                (mode.damping_ratio + poles[k].real / np.abs(poles[k])) / mode.damping_sd,
                np.mean(inside),
            )
        )
    return np.array(rows)


@pytest.fixture(scope="module")
def plane():
    return aeroplane()


def test_an_aeroplane_with_close_modes(plane):
    structure, references = plane
    matrix = struck(structure, references, LINES, np.random.default_rng(1))
    found = modes_of_matrix(matrix, (5.0, 155.0))
    rows = told(structure, found.modes, (5.0, 155.0))
    assert len(found.modes) == len(rows) == 15
    assert np.min(rows[:, 0]) > 0.995
    assert np.all(np.abs(rows[:, 1] - 1) < 0.03)
    assert np.mean(np.abs(rows[:, 2:4]) < 1.96) > 0.85
    assert 0.9 < np.mean(rows[:, 4]) < 0.98
    assert found.checks.faults == ()


def test_sets_that_differ_in_frequency_do_not_split_modes(plane):
    structure, references = plane
    rng = np.random.default_rng(2)
    matrix = struck(structure, references, LINES, rng, wander=0.0005, gain=0.01, tip_hz=150.0)
    found = modes_of_matrix(matrix, (5.0, 120.0))
    rows = told(structure, found.modes, (5.0, 120.0))
    assert len(found.modes) == len(rows) == 12
    assert np.min(rows[:, 0]) > 0.995
    scatter = [mode.scatter_hz / mode.frequency_hz for mode in found.modes]
    np.testing.assert_allclose(scatter, 0.0005, rtol=0.5)
    assert np.mean(np.abs(rows[:, 2:4]) < 2.5) > 0.85
