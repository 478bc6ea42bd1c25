"""FRFs, hits and what was learned, as charts of a campaign's Rerun recording."""

from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from matplotlib import colormaps

from planner.campaign.labels import LabelledPose
from planner.campaign.model import Model
from planner.dataset.measure import MeasuredPose
from planner.report.rerun_chart import (
    BRIGHT,
    GREY,
    Chart,
    ChartAxis,
    ChartBand,
    Colour,
    Curve,
    chart_view,
    draw,
    log_range,
)

AXES = "xyz"
LINES = 300  # frequency lines of a chart: as many as its width shows
PULSE_MS = (5.0, 35.0)  # of a hit shown before and after its peak
WIDE = 2.2  # times the height
EXPECTED, BAND, FUSED = (255, 150, 40), (95, 58, 22), (90, 190, 255)
TARGET = (120, 200, 120)
HIT_COLOURS = ((255, 110, 110), (120, 220, 120), (110, 160, 255))


def mode_colour(k: int) -> Colour:
    """The colour of mode k wherever it is drawn."""
    red, green, blue = (np.array(colormaps["tab10"](k % 10)[:3]) * 155 + 100).astype(int)
    return int(red), int(green), int(blue)


def frf_views() -> rrb.Container:
    """Direct FRFs of the tool, and the force of the hits they are made of."""
    views = [chart_view(f"frf/{a}{a}", f"FRF {a}{a} of the tool", WIDE) for a in AXES]
    return rrb.Grid(*views, chart_view("hits/force", "Force of the hits", WIDE), name="FRFs")


def progress_views(count: int) -> rrb.Container:
    """What is not known yet, and the frequencies measured against those expected."""
    modes = [chart_view(f"frequency/mode_{k + 1}", f"mode {k + 1}", WIDE) for k in range(count)]
    damping = chart_view("damping", "damping", WIDE)
    return rrb.Horizontal(
        chart_view("learning", "What is not known yet", WIDE),
        rrb.Grid(*modes, damping),
        column_shares=[2, 3],
        name="Progress",
    )


@dataclass(frozen=True, eq=False)
class SeenModes:
    """Modes of one measurement (count,): measured, with sds, and what was expected before it.

    NaN where there is none. Frequencies in Hz, damping in %.
    """

    hz: np.ndarray
    damping: np.ndarray
    damping_sd: np.ndarray
    expected_hz: np.ndarray
    expected_sd_hz: np.ndarray

    @classmethod
    def of(cls, pose: LabelledPose, before: Model | None) -> "SeenModes":
        """Of a pose; before the first measurement nothing was expected of it."""
        rows = [
            (m.frequency_hz, 100 * m.damping_ratio, 100 * m.damping_sd) if m else (np.nan,) * 3
            for m in pose.modes
        ]
        expected = np.full((2, len(rows)), np.nan)
        if before is not None and before.labelled:
            said = before.predict(pose.q[None])
            expected = np.array([said.frequency_hz[0], said.frequency_sd_hz[0]])
        return cls(*np.array(rows).T, *expected)


class CurveDrawing:
    """Draws charts at the recording's current time, with what was measured before."""

    def __init__(self, stream: rr.RecordingStream, target_percent: float):
        self._stream, self._target = stream, target_percent
        self._sd: dict[int, np.ndarray] = {}  # sds (%) after each number of measurements
        self._seen: dict[int, SeenModes] = {}  # by number of the measurement

    def frfs(
        self, model: Model, before: Model | None, pose: LabelledPose, measured: MeasuredPose | None
    ) -> None:
        """Measured FRFs over what was predicted without them, and what is believed with them."""
        low, high = model.cell.config.modes.band_hz
        lines = np.linspace(low, high, LINES)
        now = np.abs(model.frf(pose.q[None], lines)[0][0])
        known = before is not None and bool(before.labelled)
        mean, sd = before.frf(pose.q[None], lines) if known and before else (None, None)
        frf = None if measured is None else measured.frf
        for i, axis in enumerate(AXES):
            seen = np.full(LINES, np.nan)
            if frf is not None:
                seen = np.interp(lines, frf.frequency_hz, np.abs(frf.accelerance[i, i]))
            then, spread = np.full(LINES, np.nan), np.full(LINES, np.nan)
            if mean is not None and sd is not None:
                then, spread = np.abs(mean[0, i, i]), sd[0, i, i]
            bounds = np.maximum(then - 2 * spread, 0.0), then + 2 * spread
            draw(self._stream, f"frf/{axis}{axis}", Chart(
                f"{pose.pose}: response along {axis} to hits along {axis}",
                ChartAxis(low, high, "frequency (Hz)"),
                ChartAxis(*log_range([seen, now[i, i], then]), "|H| (m/s²/N)", log=True),
                (Curve("now", lines, now[i, i], FUSED, thick=1.6),
                 Curve("before", lines, then, EXPECTED),
                 Curve("measured", lines, seen, BRIGHT, thick=0.7)),
                (ChartBand("± 2 sd", lines, *bounds, BAND),), WIDE,
            ))  # fmt: skip

    def hits(self, measured: MeasuredPose) -> None:
        """The force of one hit along each axis around its peak."""
        curves = []
        for axis in AXES:
            x, y = np.full(2, np.nan), np.full(2, np.nan)
            for hit in measured.hits:
                if hit.axis[-1] == axis:
                    ms = 1000 * np.arange(hit.force_n.size) / hit.sampling_rate_hz
                    ms = ms - ms[int(np.argmax(np.abs(hit.force_n)))]
                    near = (ms >= -PULSE_MS[0]) & (ms <= PULSE_MS[1])
                    x, y = ms[near], np.abs(hit.force_n[near])
                    break
            curves.append(Curve(f"along {axis}", x, y, HIT_COLOURS[AXES.index(axis)]))
        top = max((float(np.nanmax(c.y)) for c in curves if np.any(np.isfinite(c.y))), default=1.0)
        title = "one hit an axis" if measured.hits else "FRFs were imported: no hits to show"
        draw(self._stream, "hits/force", Chart(
            title, ChartAxis(-PULSE_MS[0], PULSE_MS[1], "time after the peak (ms)"),
            ChartAxis(0.0, 1.1 * top, "force (N)"), curves, wide=WIDE,
        ))  # fmt: skip

    def frequencies(self, number: int, before: Model | None, pose: LabelledPose) -> None:
        """Modes of measurement `number` beside the earlier ones."""
        self._seen = {n: v for n, v in self._seen.items() if n < number}
        self._seen[number] = SeenModes.of(pose, before)
        n, seen = np.array(list(self._seen), float), list(self._seen.values())
        hz, expected, sd = (
            np.array([getattr(s, name) for s in seen])
            for name in ("hz", "expected_hz", "expected_sd_hz")
        )
        for k in range(len(pose.modes)):
            self._frequency(n, k, hz[:, k], expected[:, k], sd[:, k])
        damping = np.array([s.damping for s in seen])
        spread = np.array([s.damping_sd for s in seen])
        top = float(np.nanmax(damping + spread, initial=1.0))
        modes = range(damping.shape[1])
        draw(self._stream, "damping", Chart(
            "damping ratios, ± 2 sd", _measurements(n), ChartAxis(0.0, 1.1 * top, "damping (%)"),
            [Curve(f"mode {k + 1}", n, damping[:, k], mode_colour(k), dots=True) for k in modes],
            [ChartBand("", n, damping[:, k] - 2 * spread[:, k], damping[:, k] + 2 * spread[:, k],
                       mode_colour(k), 0.06) for k in modes], WIDE,
        ))  # fmt: skip

    def _frequency(
        self, n: np.ndarray, k: int, hz: np.ndarray, expected: np.ndarray, sd: np.ndarray
    ) -> None:
        every = np.concatenate([hz, expected])
        every = every[np.isfinite(every)] if np.any(np.isfinite(every)) else np.ones(1)
        room = 0.25 * float(np.ptp(every)) + 0.02 * float(every.mean())
        strokes = n[:, None] + np.array([-0.3, 0.3, np.nan])
        draw(self._stream, f"frequency/mode_{k + 1}", Chart(
            f"mode {k + 1}: frequency measured, and expected before", _measurements(n),
            ChartAxis(float(every.min()) - room, float(every.max()) + room, "Hz"),
            (Curve("before", strokes.ravel(), np.repeat(expected, 3), EXPECTED, thick=2),
             Curve("measured", n, hz, BRIGHT, dots=True, thick=1.5)),
            (ChartBand("± 2 sd", n, expected - 2 * sd, expected + 2 * sd, BAND, 0.6),), WIDE,
        ))  # fmt: skip

    def learning(self, number: int, sd_percent: np.ndarray) -> None:
        """The sd of each mode's frequency over the workspace after so many measurements."""
        if number in self._sd and np.array_equal(self._sd[number], sd_percent):
            return
        self._sd = {n: v for n, v in self._sd.items() if n < number} | {number: sd_percent}
        n, sd = np.array(list(self._sd)), np.array(list(self._sd.values()))
        curves = [Curve(f"mode {k + 1}", n, sd[:, k], mode_colour(k)) for k in range(sd.shape[1])]
        dots = [Curve("", n, sd[:, k], mode_colour(k), dots=True) for k in range(sd.shape[1])]
        all_of = np.sqrt(np.mean(sd**2, axis=1))
        ends = np.array([0.0, max(10.0, float(n[-1]))])
        target = Curve("target", ends, np.full(2, self._target), TARGET)
        overall = Curve("all modes", n, all_of, GREY)
        draw(self._stream, "learning", Chart(
            "sd of the natural frequencies, over the workspace",
            ChartAxis(0.0, float(ends[1]), "measured poses"),
            ChartAxis(*log_range([sd, target.y]), "sd (%)", log=True),
            (overall, *curves, target, *dots), wide=WIDE,
        ))  # fmt: skip


def _measurements(n: np.ndarray) -> ChartAxis:
    """The axis that counts measurements n (m,)."""
    return ChartAxis(0.5, max(6.0, float(n[-1])) + 0.5, "measurement")
