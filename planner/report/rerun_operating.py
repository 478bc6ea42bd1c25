"""Modes from responses alone as a Rerun recording: poles over singular values, MAC."""

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from planner.modal.operating import OperatingModes
from planner.modal.stabilisation import stable
from planner.report.rerun_chart import BRIGHT, GREY, Chart, ChartAxis, Colour, Curve, log_range
from planner.report.rerun_modal import (
    MODE,
    STABLE,
    UNSTABLE,
    WIDE,
    draw_auto_mac,
    mac_view,
    mode_names,
)
from planner.report.rerun_sheet import record_sheets

TONE = (210, 130, 240)
SHOWN = 3  # singular values


def record_operating(found: OperatingModes, name: str, mark: str, rrd: Path) -> None:
    """Write the recording, `mark` before what it says. InputError if it cannot be written."""

    def mac(stream: rr.RecordingStream) -> rrb.View:
        names, about = mode_names(found.modes), "unscaled shapes of {} responses"
        draw_auto_mac(stream, "operating/mac", found.modes, names, about)
        return mac_view("operating/mac", "AutoMAC", len(found.modes))

    note = (
        f"{mark}Modes are blue, tones (no modes) violet. Responses alone give no scale: neither "
        f"FRFs nor modal masses follow."
    )
    charts = {"Stabilisation diagram": (_poles(found),)}
    record_sheets(charts, "operating", name, note, rrd, mac if found.modes else None)


def _poles(found: OperatingModes) -> Chart:
    hz, (low, high) = found.spectrum_hz, found.band_hz
    inside = (hz >= low) & (hz <= high)
    values = np.linalg.svd(np.moveaxis(found.spectrum, -1, 0), compute_uv=False).T
    values = values[:SHOWN, inside]
    y = ChartAxis(*log_range([values]), "cross power of the responses", log=True)
    kept = {complex(p) for line in stable(found.diagram) for p in line.poles}
    points = [
        (abs(pole) / (2 * np.pi), entry.order, complex(pole) in kept)
        for entry in found.diagram.sets
        for pole in entry.poles
    ]
    at, order, is_stable = np.array(points, float).reshape(-1, 3).T
    height = y.low * (y.high / y.low) ** (order / (1.05 * max(order.max(initial=1.0), 1.0)))
    clouds = [
        Curve(label, at[which], height[which], colour, dots=True, thick=0.7)
        for label, which, colour in (
            ("unstable", is_stable == 0, UNSTABLE),
            ("stable", is_stable == 1, STABLE),
        )
    ]
    modes = np.array([mode.frequency_hz for mode in found.modes])
    tones = np.array(found.tones_hz)
    lines = [_upright("mode", modes, y, MODE, 0.5), _upright("tone", tones, y, TONE, 0.8)]
    first, *others = values
    curves = [Curve("", hz[inside], one, GREY, thick=0.7) for one in others]
    curves.append(Curve("singular value", hz[inside], first, BRIGHT))
    return Chart(
        "Stable and unstable poles, order upwards", ChartAxis(low, high, "frequency (Hz)"), y,
        (*lines, *curves, *clouds), wide=WIDE,
    )  # fmt: skip


def _upright(name: str, hz: np.ndarray, y: ChartAxis, colour: Colour, thick: float) -> Curve:
    """Lines from bottom to top of a chart at frequencies (n,)."""
    ends = np.tile([y.low, y.high, np.nan], len(hz))
    return Curve(name if len(hz) else "", np.repeat(hz, 3), ends, colour, thick=thick)
