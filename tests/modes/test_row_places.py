"""Turned signs and exchanged points, told by how their neighbours move."""

import re
from itertools import product

import numpy as np
import pytest

from planner.modal.consistency import check
from planner.modal.exchanged import _exchanged, _gains, _nodes, exchanged_nodes
from planner.modal.matrix_modes import modes_of_matrix
from planner.modal.motion_fields import Foretold, motion_fields, turned_rows
from planner.recording.dof import Dof
from planner.recording.geometry import Geometry
from tests.support.rough_hammer_sets import geometry_of, rough_set, spoiled
from tests.support.struck_structures import dof_of, unit_mass_shapes
from tests.support.structures import plate


@pytest.fixture(scope="module")
def sheet():
    """Points, shapes with rows that err by 3 %, places."""
    structure = plate(9, 6, (0.7, 0.4), 0.003)
    rng = np.random.default_rng(8)
    shapes = unit_mass_shapes(structure)[1][:, 3:13].real
    shapes = shapes * (1 + 0.03 * rng.normal(size=(len(shapes), 1)))
    names = tuple(str(n) for n in structure.position_m)
    lines = tuple((str(a), str(b)) for a, b in structure.lines)
    place = Geometry(names, np.array(list(structure.position_m.values())), lines)
    return [dof_of(structure, k) for k in range(len(shapes))], shapes, place


def without_lines(place):
    return Geometry(place.nodes, place.position_m)


def test_nothing_is_told_where_nothing_is_wrong(sheet):
    for place in (sheet[2], without_lines(sheet[2])):
        assert turned_rows(*sheet[:2], place) == ()
        assert exchanged_nodes(*sheet[:2], place) is None


@pytest.mark.parametrize("row", [0, 8, 22, 31, 53])
def test_a_turned_row_is_told(sheet, row):
    dofs, shapes, place = sheet
    turned = shapes.copy()
    turned[row] *= -1
    for known in (place, without_lines(place)):
        assert turned_rows(dofs, turned, known) == (row,)


def test_several_turned_rows_are_told(sheet):
    dofs, shapes, place = sheet
    turned = shapes.copy()
    turned[[4, 20, 40]] *= -1
    assert set(turned_rows(dofs, turned, place)) == {4, 20, 40}


@pytest.mark.parametrize("pair", [(0, 53), (10, 30), (22, 23)])
def test_two_exchanged_points_are_told(sheet, pair):
    dofs, shapes, place = sheet
    exchanged = shapes.copy()
    exchanged[list(pair)] = shapes[list(pair[::-1])]
    assert set(exchanged_nodes(dofs, exchanged, place)) == {dofs[k].node for k in pair}


def test_one_of_two_exchanged_pairs_is_told(sheet):
    dofs, shapes, place = sheet
    mixed = shapes.copy()
    mixed[[10, 30, 4, 49]] = shapes[[30, 10, 49, 4]]
    told = exchanged_nodes(dofs, mixed, place)
    assert told is not None
    assert set(told) in ({dofs[10].node, dofs[30].node}, {dofs[4].node, dofs[49].node})


def test_three_mixed_up_points_are_not_told_as_two(sheet):
    """Nor are signs turned at a node, in one direction or in all."""
    dofs, shapes, place = sheet
    mixed, turned = shapes.copy(), shapes.copy()
    mixed[[10, 30, 41]] = shapes[[30, 41, 10]]
    turned[22] *= -1
    for wrong in (mixed, turned):
        assert exchanged_nodes(dofs, wrong, place) is None


@pytest.fixture(scope="module")
def frame():
    """Nodes measured along x, y and z; poles, and the modes that were established."""
    case = rough_set(3040, kind="frame")
    found = modes_of_matrix(case.matrix, case.band_hz, geometry_of(case)).found
    hz = np.abs(found.fit.poles) / (2 * np.pi)
    low, high = case.band_hz
    return case, found, np.flatnonzero((hz > low) & (hz < high) & (found.weak <= 1))


@pytest.mark.parametrize("pair", [(3, 15), (21, 24), (2, 19), "reference"])
def test_exchanged_nodes_of_a_frame_are_told(frame, pair):
    """One of them alone, under the other's name, explains most: both explain clearly more."""
    case, found, modes = frame
    if pair == "reference":
        pair = case.structure.nodes[case.references[0]], 19
    owner = np.array(case.structure.nodes)
    order = np.arange(owner.size)
    one, two = (np.flatnonzero(owner == node) for node in pair)
    order[one], order[two] = two, one
    matrix, poles = spoiled(case, found, order, np.ones((owner.size, 3)))
    checks = check(matrix, poles, modes, geometry_of(case))
    (fault,) = checks.faults
    assert re.match(rf"Nodes ({pair[0]} and {pair[1]}|{pair[1]} and {pair[0]}) are", fault)
    touched = [dof for dof in case.matrix.references if dof.node in {str(node) for node in pair}]
    assert list(checks.untied) == touched
    assert check(case.matrix, found, modes, geometry_of(case)).faults == ()


def test_gains_are_those_of_the_likelihood():
    rng = np.random.default_rng(4)
    root = rng.normal(size=(13, 13))
    found = Foretold(np.arange(13), rng.normal(size=(13, 5)), root @ root.T)
    dofs = [Dof(node, axis) for node in "abcd" for axis in "xyz"] + [Dof("e", "z")]
    nodes = _nodes(dofs)
    gains = _gains(found, nodes)

    def unlikely(f):
        return np.sum(f.values * (f.precision @ f.values))

    for (i, one), (j, two) in product(enumerate(nodes), repeat=2):
        if i == j or "e" in (one.name, two.name):
            assert gains[i, j] == -np.inf
        else:
            fall = unlikely(found) - unlikely(_exchanged(found, one, two))
            assert gains[i, j] == pytest.approx(fall)


def test_points_of_unknown_place_and_few_modes_say_nothing(sheet):
    dofs, shapes, place = sheet
    turned = shapes.copy()
    turned[22] *= -1
    elsewhere = Geometry(tuple(f"9{n}" for n in place.nodes), place.position_m)
    assert turned_rows(dofs, turned, elsewhere) == ()
    assert turned_rows(dofs, turned[:, :2], place) == ()
    unknown = turned.copy()
    unknown[22] = np.nan
    assert turned_rows(dofs, unknown, place) == ()


def test_directions_are_told_apart(sheet):
    dofs, shapes, place = sheet
    both = [*dofs, *(Dof(dof.node, "x") for dof in dofs)]
    moved = np.concatenate([shapes, shapes[:, ::-1]])
    moved[60] *= -1
    assert turned_rows(both, moved, place) == (60,)


def test_beams_tell_what_a_field_without_directions_cannot():
    """Points on a straight line move alike along it, however far apart they are."""
    place = Geometry(
        tuple("abcde"),
        np.array([[0, 0, 0], [0.3, 0, 0], [0.6, 0, 0], [0.6, 0, 0.3], [0.6, 0, 0.6]], float),
        (("a", "b"), ("b", "c"), ("c", "d"), ("d", "e")),
    )
    dofs = [Dof(node, direction) for node in "abcde" for direction in "xyz"]
    beams = motion_fields(dofs, place)[-2]
    sd = np.sqrt(np.diag(beams))
    alike = {
        (str(one), str(two)): beams[i, j] / sd[i] / sd[j]
        for i, one in enumerate(dofs)
        for j, two in enumerate(dofs)
    }
    assert alike["a:x", "c:x"] > 0.99
    assert alike["c:z", "e:z"] > 0.99
    assert alike["a:z", "c:z"] < 0.9
    assert len(motion_fields(dofs, Geometry(place.nodes, place.position_m))) == 6
