"""Figures in a Rerun recording: their lines lie where their numbers say."""

from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure

from planner.report.rerun.figures import one_by_one, record_figures
from tests.support.rerun_columns import columns_of, lines_of

X = np.linspace(1.0, 9.0, 33)


def figure(scale: float = 1.0) -> Figure:
    made = Figure(figsize=(6, 4), layout="constrained")
    left, right = made.subplots(1, 2)
    gap = np.where(np.abs(X - 5) < 0.6, np.nan, X)
    left.semilogy(X, scale * 10.0**gap, label="grown (m)")
    left.plot(X, X, "--", label="dashed")
    left.set(xlim=(0, 10), ylim=(1e-3, 1e10))
    right.plot(X, X, "o", label="points")
    right.plot(2 * X, X)
    right.set(xlim=(0, 10), ylim=(0, 10))
    return made


def test_lines_lie_in_the_picture_where_their_numbers_say(tmp_path):
    shown = figure()
    record_figures({"some_plot": shown}, "KR240", "SIMULATED", tmp_path / "a.rrd")
    found = lines_of(tmp_path / "a.rrd")
    assert set(found) == {"/figures/some_plot/0/grown__m_", "/figures/some_plot/1/line_1"}
    parts = found["/figures/some_plot/0/grown__m_"]
    assert len(parts) == 2  # the gap stays one
    places = np.concatenate(parts)
    expected = [shown.axes[0].transData.transform((x, 10.0**x)) for x in X if abs(x - 5) >= 0.6]
    scale = 160 / shown.dpi
    height = shown.bbox.height
    assert places == pytest.approx(
        np.array([(scale * x, scale * (height - y)) for x, y in expected]), abs=0.5
    )
    (beyond,) = found["/figures/some_plot/1/line_1"]
    assert np.max(beyond[:, 0]) <= scale * shown.axes[1].bbox.x1 + 2.0  # cut off at the frame
    assert [line.get_linestyle() for line in shown.axes[0].lines] == ["-", "--"]
    text = columns_of(tmp_path / "a.rrd")[("/note", "TextDocument:text")]
    assert text == [["# KR240\nSIMULATED"]]


def test_figures_follow_each_other_on_a_timeline(tmp_path):
    each = one_by_one("pose", "FRFs", (figure(scale) for scale in (1.0, 0.1, 0.01)))
    record_figures({}, "KR240", "", tmp_path / "a.rrd", each)
    found = columns_of(tmp_path / "a.rrd")
    drawn = [np.array(s[0]) for s in found[("/pose/0/grown__m_", "LineStrips2D:strips")] if s]
    assert found[("/pose/0/grown__m_", "pose")] == [1, 2, 3]
    assert all(np.all(a[:, 1] < b[:, 1]) for a, b in pairwise(drawn))
