"""Roving-hammer sets with hits that miss and drift: modes, turned signs, exchanged points."""

import re

import numpy as np
import pytest

from planner.modal.consistency import check
from planner.modal.matrix_modes import modes_of_matrix
from planner.modal.motion_fields import expected, turned_rows
from planner.modal.node_exchange import exchanged_nodes
from planner.recording.uff import Geometry
from tests.support.hit_structures import dof_of, unit_mass_shapes
from tests.support.rough_hammer_sets import geometry_of, rough_set, spoiled, tellable, told
from tests.support.structures import plate


@pytest.fixture(scope="module")
def sheet():
    """Points, shapes with rows that err by 3 %, places."""
    structure = plate(9, 6, (0.7, 0.4), 0.003)
    rng = np.random.default_rng(8)
    shapes = unit_mass_shapes(structure)[1][:, 3:13].real
    shapes = shapes * (1 + 0.03 * rng.normal(size=(len(shapes), 1)))
    return [dof_of(structure, k) for k in range(len(shapes))], shapes, geometry_of(structure)


def test_an_unknown_point_moves_as_its_neighbours_let_expect(sheet):
    dofs, shapes, place = sheet
    rows = [10, 22, 31]
    known, sds = shapes.copy(), np.full(shapes.shape, 0.01 * np.max(np.abs(shapes)))
    known[rows], sds[rows] = 0.0, 100.0 * np.max(np.abs(shapes))
    mean, variance = expected(dofs, known, sds, place)
    off, power = np.abs(mean - shapes)[rows], np.mean(np.abs(shapes) ** 2, axis=0)
    assert np.mean(off**2 / power) < 0.03
    assert 0.1 < np.mean(off**2 / variance[rows]) < 3.0


@pytest.mark.parametrize("lines", [True, False])
@pytest.mark.parametrize("rows", [(), (0,), (22,), (53,), (4, 20, 40)])
def test_turned_rows_are_told(sheet, rows, lines):
    dofs, shapes, place = sheet
    turned = shapes.copy()
    turned[list(rows)] *= -1
    known = place if lines else Geometry(place.nodes, place.position_m)
    assert set(turned_rows(dofs, turned, known)) == set(rows)


@pytest.mark.parametrize("pair", [None, (0, 53), (10, 30), (22, 23)])
def test_two_exchanged_points_are_told(sheet, pair):
    dofs, shapes, place = sheet
    exchanged = shapes.copy()
    if pair is not None:
        exchanged[list(pair)] = shapes[list(pair[::-1])]
    named = exchanged_nodes(dofs, exchanged, place)
    assert set(named or ()) == {dofs[k].node for k in pair or ()}


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
    found = modes_of_matrix(case.matrix, case.band_hz, geometry_of(case.structure)).found
    hz = np.abs(found.fit.poles) / (2 * np.pi)
    low, high = case.band_hz
    modes = np.flatnonzero((hz > low) & (hz < high) & (found.weak <= 1))
    assert check(case.matrix, found, modes, geometry_of(case.structure)).faults == ()
    return case, found, modes


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
    checks = check(matrix, poles, modes, geometry_of(case.structure))
    (fault,) = checks.faults
    assert re.match(rf"Nodes ({pair[0]} and {pair[1]}|{pair[1]} and {pair[0]}) are", fault)
    touched = [dof for dof in case.matrix.references if dof.node in {str(node) for node in pair}]
    assert list(checks.untied) == touched


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


@pytest.mark.parametrize(
    ("seed", "scale", "nuisances", "least"),
    [
        *((seed, 0.03, {"gain": 0.0, "drift": 0.0}, 0.9) for seed in (30, 31, 32)),
        (33, 0.04, {"gain": 0.03, "drift": 0.0}, 0.85),
        (34, 0.03, {"gain": 0.01, "drift": 0.003}, 0.9),
    ],
    ids=["panel", "frame", "pieces", "rows err as a whole", "drift beyond the bandwidth"],
)
def test_modes_and_what_their_intervals_hold(seed, scale, nuisances, least):
    case = rough_set(seed, **nuisances)
    found = modes_of_matrix(case.matrix, case.band_hz, geometry_of(case.structure))
    seen = told(case, found.modes, found.dofs)
    assert None not in seen
    assert len(found.modes) <= case.poles.size  # none is split
    assert min(t.mac for t in seen) > 0.995
    assert max(abs(t.scale) for t in seen) < scale
    assert np.mean([abs(t.frequency_z) < 2.5 for t in seen]) > 0.8
    assert np.mean([abs(t.damping_z) < 2.5 for t in seen]) > 0.8
    assert np.mean([(t.real + t.imag) / 2 for t in seen]) > least
    assert found.checks.faults == ()
    if nuisances["drift"]:
        scatter = [mode.scatter_hz / mode.frequency_hz for mode in found.modes]
        np.testing.assert_allclose(np.median(scatter), nuisances["drift"], rtol=0.5)
    else:
        assert np.mean([m.scatter_hz < 10 * m.frequency_sd_hz for m in found.modes]) > 0.8


def test_a_fifth_of_the_matrix_is_missing():
    case = rough_set(37, missing=0.2, drift=0.0005)
    found = modes_of_matrix(case.matrix, case.band_hz)
    seen = told(case, found.modes, found.dofs)
    assert None not in seen
    # A point felt only by references that a mode leaves at rest is not known in that mode.
    known = [t for t, sure in zip(seen, tellable(case), strict=True) if sure]
    assert len(known) >= 3
    assert min(t.mac for t in known) > 0.995
    assert np.mean([(t.real + t.imag) / 2 for t in seen]) > 0.9
