"""Motions of points that no FRF tells of, from those around them."""

import numpy as np
import pytest

from planner.modal.motion_fields import expected
from planner.recording.dof import Dof
from planner.recording.geometry import Geometry
from tests.support.struck_structures import dof_of, unit_mass_shapes
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


def test_without_geometry_or_with_few_known_points_nothing_is_expected(sheet):
    dofs, shapes, place = sheet
    sds = np.full(shapes.shape, 0.01 * np.max(np.abs(shapes)))
    few = sds.copy()
    few[6:] = 100.0 * np.max(np.abs(shapes))
    for where, sd in ((None, sds), (place, few)):
        mean, variance = expected(dofs, shapes, sd, where)
        assert not mean.any()
        assert np.ptp(variance, axis=0) == pytest.approx(0.0)


def test_a_point_with_no_known_one_in_its_direction_is_expected_to_move_as_usual(sheet):
    dofs, shapes, place = sheet
    across = [Dof(dofs[k].node, "x") for k in (3, 20)]
    all_shapes = np.concatenate([shapes, np.zeros((2, shapes.shape[1]))])
    sds = np.full(all_shapes.shape, 0.01 * np.max(np.abs(shapes)))
    sds[-2:] = 100.0 * np.max(np.abs(shapes))
    mean, variance = expected([*dofs, *across], all_shapes, sds, place)
    power = np.mean(np.abs(shapes) ** 2, axis=0)
    assert not mean[-2:].any()
    assert np.all((variance[-2:] > 0.2 * power) & (variance[-2:] < 5 * power))
