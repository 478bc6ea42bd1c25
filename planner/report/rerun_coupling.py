"""A receptance coupling as a Rerun recording: the tip before and after, and how errors grew."""

import numpy as np

from planner.milling.coupling import AMPLIFICATION_LIMIT, CoupledFrf
from planner.report.frf_plots import AXES
from planner.report.rerun_chart import BRIGHT, Chart, ChartAxis, ChartBand, Curve, log_range
from planner.report.rerun_sheet import Sheets

TOOL, BAND, LIMIT = (90, 190, 255), (26, 62, 88), (255, 110, 110)
WIDE, LOW = 4.0, 3.0  # width over height of one of three charts, of the one of errors
MANY_DECADES = 20.0  # ratio of the band's ends from which its axis is logarithmic
NOTE = "Blue is this tool, with ± 2 sd; white the tip that was measured."


def coupling_sheets(before: CoupledFrf | None, coupled: CoupledFrf, reference: str) -> Sheets:
    """Receptances |H| in µm/N, a tab for each direction of the hit; then how errors grew."""
    f = coupled.frequency_hz
    over = ChartAxis(
        float(f[0]), float(f[-1]), "frequency (Hz)", log=bool(f[-1] / f[0] > MANY_DECADES)
    )
    moved = [k for k in range(3) if np.all(np.isfinite(coupled.receptance[k, k]))]
    sheets = {
        f"Hit {AXES[j]}": [_receptance(before, coupled, reference, over, (i, j)) for i in moved]
        for j in moved
    }
    grown = coupled.amplification
    y = ChartAxis(*log_range([grown, np.array([AMPLIFICATION_LIMIT])]), "times", log=True)
    limit = Curve("limit", np.array([f[0], f[-1]]), np.full(2, AMPLIFICATION_LIMIT), LIMIT)
    title = "How many times relative errors of the measured FRFs grew"
    chart = Chart(title, over, y, (Curve("errors", f, grown, BRIGHT), limit), wide=LOW)
    return {**sheets, "How errors grew": [chart]}


def _receptance(
    before: CoupledFrf | None, coupled: CoupledFrf, reference: str, over: ChartAxis,
    entry: tuple[int, int],
) -> Chart:  # fmt: skip
    i, j = entry
    mean, sd = 1e6 * np.abs(coupled.receptance[i, j]), 1e6 * coupled.sd[i, j]
    curves, f = [Curve("this tool", coupled.frequency_hz, mean, TOOL)], coupled.frequency_hz
    sizes = [mean]
    if before is not None:
        sizes.append(1e6 * np.abs(before.receptance[i, j]))
        curves.insert(0, Curve(reference, f, sizes[1], BRIGHT, thick=0.7))
    y = ChartAxis(*log_range(sizes), "|H| (µm/N)", log=True)
    band = ChartBand("± 2 sd", f, np.maximum(mean - 2 * sd, y.low), mean + 2 * sd, BAND)
    return Chart(f"response {AXES[i]}, hit {AXES[j]}", over, y, curves, (band,), WIDE)
