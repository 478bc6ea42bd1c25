"""Motions of points that no FRF tells of, from those around them."""

import numpy as np
import pytest

from planner.modal.motion_fields import expected
from planner.recording.geometry import Geometry
from tests.support.hit_structures import dof_of, unit_mass_shapes
from tests.support.structures import plate


@pytest.fixture(scope="module")
def sheet():
    """Points, shapes, places of a plate."""
    structure = plate(9, 6, (0.7, 0.4), 0.003)
    shapes = unit_mass_shapes(structure)[1][:, 3:9]
    names = tuple(str(n) for n in structure.position_m)
    place = Geometry(names, np.array(list(structure.position_m.values())))
    return [dof_of(structure, k) for k in range(len(shapes))], shapes, place


def test_an_unknown_point_moves_as_its_neighbours_let_expect(sheet):
    dofs, shapes, place = sheet
    rows = [10, 22, 31]
    known, sds = shapes.copy(), np.full(shapes.shape, 0.01 * np.max(np.abs(shapes)))
    known[rows], sds[rows] = 0.0, 100.0 * np.max(np.abs(shapes))
    mean, variance = expected(dofs, known, sds, place)
    off, power = np.abs(mean - shapes)[rows], np.mean(np.abs(shapes) ** 2, axis=0)
    assert np.mean(off**2 / power) < 0.03
    assert 0.1 < np.mean(off**2 / variance[rows]) < 3.0
