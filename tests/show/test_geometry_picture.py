"""The picture of a test's points: all of it is inside, lengths are true."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from mpl_toolkits.mplot3d.proj3d import proj_transform

from planner.recording.dof import Dof
from planner.recording.geometry import Geometry
from planner.report.matrix_plots import geometry_figure, shapes_figure
from tests.support.struck_structures import struck
from tests.support.structures import plate


@pytest.mark.parametrize(("turn", "lines"), [((0, 1, 2), True), ((2, 0, 1), False)])
def test_axes_of_flat_structures_are_inside_and_to_scale(turn, lines):
    structure = plate(4, 3)
    matrix = struck(structure, [0], np.arange(5, 50.0), np.random.default_rng(1))
    place = np.array(list(structure.position_m.values()))[:, turn]
    traces = tuple((str(a), str(b)) for a, b in structure.lines) if lines else ()
    geometry = Geometry(tuple(map(str, structure.position_m)), place, traces)
    figure = geometry_figure(matrix, geometry, "points")
    figure.canvas.draw()
    (panel,) = figure.axes
    limits = np.array([panel.get_xlim(), panel.get_ylim(), panel.get_zlim()])
    assert np.all(limits[:, 0] <= place.min(axis=0))
    assert np.all(limits[:, 1] >= place.max(axis=0))
    scale = np.diff(limits)[:, 0] / panel._box_aspect
    assert scale == pytest.approx(scale[0], rel=1e-6)
    for axis in (panel.xaxis, panel.yaxis, panel.zaxis):
        box = axis.get_tightbbox()
        assert box is not None
        assert min(box.x0, box.y0) >= 0
        assert box.x1 <= figure.bbox.x1
        assert box.y1 <= figure.bbox.y1


def test_a_tool_far_out_is_inside_every_shape():
    arm = [[0, 0, 0], [0, 0, 0.5], [0.3, 0, 0.8], [1.3, 0.3, 1.6], [2.2, 0.6, 1.5], [2.6, 0.7, 0.6]]
    names = tuple("123456")
    geometry = Geometry(names, np.array(arm), tuple(pairwise(names)))
    dofs = tuple(Dof(name, axis) for name in names for axis in "xyz")
    shapes = np.random.default_rng(2).normal(size=(3, 18)) + 0j
    modes = [SimpleNamespace(shape=shape, frequency_hz=10.0) for shape in shapes]
    figure = shapes_figure(SimpleNamespace(modes=modes, dofs=dofs), geometry)  # pyright: ignore
    figure.canvas.draw()
    for panel in figure.axes:
        (dots,) = [c for c in panel.collections if hasattr(c, "_offsets3d")]
        x, y, _ = proj_transform(*map(np.asarray, dots._offsets3d), panel.get_proj())
        place = (panel.transData - panel.transAxes).transform(np.column_stack([x, y]))
        assert np.all((place > 0) & (place < 1))
        assert np.max(np.abs(place - 0.5)) > 0.3  # and not small
