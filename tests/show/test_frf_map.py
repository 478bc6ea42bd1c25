"""FRF maps hold the numbers that they are given, in the right cells."""

import numpy as np
from matplotlib.collections import QuadMesh

from planner.report.frf_plots import frf_map
from planner.report.pictures import png

FREQUENCY = np.arange(0.0, 30.0)


def panels(figure) -> dict:
    return {axes.get_title(): axes for axes in figure.axes if axes.get_title()}


def levels(figure, title):
    (mesh,) = [c for c in panels(figure)[title].collections if isinstance(c, QuadMesh)]
    return mesh.get_array(), mesh.get_coordinates()


def test_measured_simulated_and_difference():
    rng = np.random.default_rng(0)
    measured = rng.uniform(0.1, 1, (5, 30)) * np.exp(1j)
    pose = np.array([70.0, 80.0, 90.0, 100.0, 110.0])
    figure = frf_map(pose, measured, 2 * measured, FREQUENCY, "joint 3 (°)")
    assert list(panels(figure)) == ["measured", "simulated", "simulated − measured"]
    difference, _ = levels(figure, "simulated − measured")
    np.testing.assert_allclose(difference, 20 * np.log10(2))
    shown, corners = levels(figure, "measured")
    np.testing.assert_allclose(shown[:, 1], 20 * np.log10(np.abs(measured[1])))  # 80° is second
    np.testing.assert_allclose(corners[0, :, 0], [65, 75, 85, 95, 105, 115])
    np.testing.assert_allclose(corners[:, 0, 1], np.arange(31) - 0.5)
    assert panels(figure)["measured"].get_xlabel() == "joint 3 (°)"
    assert png(figure)[:4] == b"\x89PNG"


def test_measured_and_simulated_share_their_colours():
    measured = np.full((3, 30), 1e-3)
    measured[1, 10] = 1.0
    figure = frf_map(np.arange(3), measured, 10 * measured, FREQUENCY)
    limits = [
        c.get_clim()
        for title in ("measured", "simulated")
        for c in panels(figure)[title].collections
        if isinstance(c, QuadMesh)
    ]
    assert limits == [(-30, 20), (-30, 20)]


def test_only_a_simulation_of_one_pose():
    figure = frf_map(np.array([3.0]), None, np.ones((1, 30)), FREQUENCY)
    shown, _ = levels(figure, "simulated")
    assert list(panels(figure)) == ["simulated"]
    assert shown.shape == (30, 1)
    assert png(figure)


def test_nan_stays_blank_and_zero_is_drawn():
    measured = np.ones((4, 30))
    measured[2] = np.nan
    measured[1, 4] = 0.0
    figure = frf_map(np.arange(4), measured, np.ones((4, 30)), FREQUENCY)
    shown, _ = levels(figure, "measured")
    assert shown.mask[:, 2].all()
    assert shown.mask.sum() == 30
    assert png(figure)
    assert png(frf_map(np.arange(4), np.full((4, 30), np.nan), np.ones((4, 30)), FREQUENCY))
