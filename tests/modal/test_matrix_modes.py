"""Modes of matrices of FRFs against an aeroplane whose modes are known."""

import numpy as np

from planner.modal.matrix_modes import modes_of_matrix
from tests.support.hit_structures import hit_frfs, unit_mass_shapes
from tests.support.rough_hammer_sets import RoughSet, told
from tests.support.structures import aeroplane

LINES = np.arange(1, 801) * 0.2


def modes_and_truth(top_hz, seed, within_sds, **nuisances):
    """What is found up to a frequency, and every true mode beside it; most within so many sds."""
    structure, references = aeroplane()
    matrix = hit_frfs(structure, references, LINES, np.random.default_rng(seed), **nuisances)
    band, (poles, shapes) = (5.0, top_hz), unit_mass_shapes(structure)
    hz = np.abs(poles) / (2 * np.pi)
    inside = (hz > band[0]) & (hz < band[1])
    true = poles[inside], shapes[:, inside], np.ones(np.count_nonzero(inside), bool)
    found = modes_of_matrix(matrix, band)
    case = RoughSet("plane", structure, references, matrix, band, *true, 0.0)
    seen = told(case, found.modes, found.dofs)
    assert None not in seen
    assert min(one.mac for one in seen) > 0.995
    z = np.abs([(one.frequency_z, one.damping_z) for one in seen])
    assert np.mean(z < within_sds) > 0.85
    return found, seen


def test_an_aeroplane_with_close_modes():
    found, seen = modes_and_truth(155.0, 1, 1.96)
    assert len(found.modes) == len(seen) == 15
    assert max(abs(one.scale) for one in seen) < 0.03
    assert 0.9 < np.mean([(one.real, one.imag) for one in seen]) < 0.98
    assert found.checks.faults == ()


def test_sets_that_differ_in_frequency_do_not_split_modes():
    found, seen = modes_and_truth(120.0, 2, 2.5, wander=0.0005, gain=0.01, tip_hz=150.0)
    assert len(found.modes) == len(seen) == 12
    scatter = [mode.scatter_hz / mode.frequency_hz for mode in found.modes]
    np.testing.assert_allclose(scatter, 0.0005, rtol=0.5)
