"""Learning curves and identifications as Rerun recordings: charts, not pictures of charts."""

from typing import Any, cast

import numpy as np
import pytest

from planner.report.identification_plots import DirectFrfs, ShownPose
from planner.report.learning_curves import Band, Learning
from planner.report.rerun_chart import HEIGHT
from planner.report.rerun_identification import CELLS, record
from planner.report.rerun_learning import TALL, write
from tests.support.rerun_columns import columns_of, of


def test_learning_curves_lie_where_their_numbers_say(tmp_path):
    n = np.arange(2, 6)

    def band(values: list[float]) -> Band:
        middle = np.array(values)
        return Band(0.9 * middle, middle, 1.1 * middle)

    one = Learning(n, band([10, 4, 2, 1]), band([0.5, 0.7, 0.9, 0.95]), band([0.9] * 4))
    other = Learning(n, band([20, 9, 5, 3]), band([0.2, 0.4, 0.6, 0.8]), band([0.8] * 4))
    rrd = tmp_path / "curves.rrd"
    write({"default": one, "random": other}, rrd, "key", "KR240", "pool of 9 poses")
    found = columns_of(rrd)
    assert not any("blob" in name.lower() for _, name in found)  # no picture of a chart
    strips = of(found, "/rmse_percent/default", "strips")[0][0]
    places = np.array(strips).reshape(-1, 2)
    assert places[:, 0] == pytest.approx(TALL * HEIGHT * n / 5.5, abs=1e-3)
    # Logarithmic: 10 to 4 is as far as 20 to 8; less error is further down.
    steps = np.diff(places[:, 1])
    assert np.all(steps > 0)
    assert steps[1] == pytest.approx(steps[2], rel=1e-3)
    assert "KR240" in of(found, "/note", "text")[0][0]


def test_an_identification_is_a_chart_for_each_pose_and_a_map_of_all(tmp_path):
    hz = np.linspace(5.0, 60.0, 80)
    measured = np.tile(1.0 + 1 / (1 + (hz - 20) ** 2), (4, 3, 1))
    measured[2, 1] = np.nan  # a direction in which a pose was not hit
    shown = DirectFrfs(hz, measured, 0.5 * measured, 0.9 * measured)
    poses = [ShownPose(f"P{i}", np.zeros(3), cast(Any, None), cast(Any, None), i == 3)
             for i in range(4)]  # fmt: skip
    rrd = tmp_path / "identified.rrd"
    record(poses, shown, "arm", "SIMULATED recordings · ", rrd)
    found = columns_of(rrd)
    assert len(of(found, "/frf/xx/measured", "strips")) == 4
    assert sum(len(s) > 0 for s in of(found, "/frf/yy/measured", "strips")) == 3
    titles = [labels for labels in of(found, "/frf/xx/words", "Points2D:labels") if labels]
    assert "P3, held out: H xx" in titles[-1]
    format_ = of(found, "/map/zz/cells", "format")[0][0]
    assert format_["height"] == CELLS
    assert "SIMULATED" in of(found, "/note", "text")[0][0]
