"""The picture of leave-one-out: it names what surprises, and draws what little there is."""

import numpy as np

from planner.report.campaign_plots import left_out_figure
from planner.surrogate.leave_one_out import LeaveOneOut


def texts(figure):
    return [t.get_text() for panel in figure.axes for t in panel.texts]


def test_a_pose_that_surprises_is_named_with_mode_and_error():
    rng = np.random.default_rng(0)
    score = rng.uniform(-1, 1, (12, 2))
    score[4, 1] = 6.0
    found = LeaveOneOut(0.01 * score, np.full((12, 2), 0.01), np.full((12, 2), 0.5))
    figure = left_out_figure(found, tuple(f"P{i}" for i in range(12)), "Title")
    assert texts(figure) == ["P4, mode 2: +6.0 %"]
    assert figure.axes[0].get_legend().get_texts()[-1].get_text() == "24 values"


def test_gaps_and_a_single_pose_are_drawn():
    nothing = np.full((1, 3), np.nan)
    nothing[0, 1] = 0.4
    figure = left_out_figure(LeaveOneOut(nothing, nothing, nothing), ("P1",))
    figure.canvas.draw()
    assert texts(figure) == []
