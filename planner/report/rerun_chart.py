"""Charts of lines and bands in a Rerun recording, over any quantity and on logarithmic axes.

Rerun's own plots run over its timelines and linearly; frequency responses need neither. A chart is
a view in two dimensions: lines stay sharp however near one looks, and hide one by one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

Colour = tuple[int, int, int]

HEIGHT = 100.0  # of a chart's frame, in scene units
LEFT, RIGHT, ABOVE, BELOW = 18.0, 6.0, 22.0, 24.0  # room around the frame for numbers and names
GREY, FAINT, BRIGHT = (200, 204, 208), (60, 64, 68), (235, 235, 235)
GROUND = (13, 16, 17)  # behind all that is bright, whatever theme the viewer has
LINE, HAIR, MARK = 0.3, 0.12, 1.1  # radii of lines and points
STROKES = 20  # of a bar
BEHIND, BANDS, CURVES, WORDS = 1.0, 5.0, 10.0, 20.0  # what is drawn over what


@dataclass(frozen=True)
class ChartAxis:
    """From `low` to `high`, with what it says (and its unit); `log`: decades are equally far."""

    low: float
    high: float
    label: str
    log: bool = False

    def share(self, values: np.ndarray) -> np.ndarray:
        """Where values lie between both ends, 0 to 1; those beyond lie at the end."""
        v, low, high = np.asarray(values, float), self.low, self.high
        if self.log:
            v = np.log(np.maximum(v, np.finfo(float).tiny))
            low, high = np.log([low, high])
        return np.clip((v - low) / (high - low), 0.0, 1.0)

    @property
    def ticks(self) -> np.ndarray:
        """Round values between both ends."""
        if self.log:
            decades = np.arange(np.ceil(np.log10(self.low)), np.floor(np.log10(self.high)) + 1)
            if decades.size >= 2:
                return 10.0 ** decades[:: -(-decades.size // 6)]
            steps = np.outer(10.0 ** np.arange(np.floor(np.log10(self.low)), 9), [1, 2, 5]).ravel()
            return steps[(steps >= self.low) & (steps <= self.high)]
        rough = (self.high - self.low) / 6
        size = 10.0 ** np.floor(np.log10(rough))
        step = size * next(f for f in (1, 2, 5, 10) if f * size >= 0.999 * rough)
        first = np.ceil(self.low / step - 1e-9)
        return step * np.arange(first, np.floor(self.high / step + 1e-9) + 1) + 0.0  # no −0


@dataclass(frozen=True, eq=False)
class Curve:
    """A line of y (n,) over x (n,), with gaps where y is NaN; `dots` instead of a line.

    `thick` in units of what is usual.
    """

    name: str
    x: np.ndarray
    y: np.ndarray
    colour: Colour
    dots: bool = False
    thick: float = 1.0


@dataclass(frozen=True, eq=False)
class ChartBand:
    """What lies between low and high (n,) over increasing x (n,).

    Rerun fills no areas: it is drawn as strokes, `width` wide (units of x; 0: side by side).
    """

    name: str
    x: np.ndarray
    low: np.ndarray
    high: np.ndarray
    colour: Colour
    width: float = 0.0


@dataclass(frozen=True, eq=False)
class Chart:
    """Curves, the later ones over the others, and bands in a frame `wide` times as wide as high."""

    title: str
    x: ChartAxis
    y: ChartAxis
    curves: Sequence[Curve] = ()
    bands: Sequence[ChartBand] = field(default=())
    wide: float = 2.0


def log_range(values: Sequence[np.ndarray], decades: float = 4.0) -> tuple[float, float]:
    """Ends of a logarithmic axis that shows the values (any shapes) down to so many decades."""
    every = np.concatenate([np.ravel(v) for v in values])
    every = every[np.isfinite(every) & (every > 0)]
    if not every.size:
        return 1e-3, 1.0
    high = 1.6 * float(every.max())
    return max(0.6 * float(every.min()), high * 10.0**-decades), high


def chart_view(path: str, name: str, wide: float = 2.0) -> rrb.Spatial2DView:
    """The view of the chart that is drawn at a path, with all of its frame in sight."""
    return rrb.Spatial2DView(
        origin=f"/{path}",
        name=name,
        background=GROUND,
        visual_bounds=rrb.VisualBounds2D(
            x_range=[-LEFT, wide * HEIGHT + RIGHT], y_range=[-ABOVE, HEIGHT + BELOW]
        ),
    )


def draw(stream: rr.RecordingStream, path: str, chart: Chart) -> None:
    """Log a chart at a path, at the recording's current time.

    Those without a name are not in the legend. Curves and bands of one path should have the same
    names and order each time: what was drawn under another name stays.
    """
    _frame(stream, path, chart)
    for k, band in enumerate(chart.bands):
        _band(stream, f"{path}/{_entity(band.name, f'band {k}')}", chart, band)
    for k, curve in enumerate(chart.curves):
        entity = f"{path}/{_entity(curve.name, f'curve {k}')}"
        _curve(stream, entity, chart, curve, CURVES + 0.1 * k)
    _legend(stream, path, chart)


def _place(chart: Chart, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(n, 2) in the scene, whose second axis points down."""
    right = chart.x.share(x) * chart.wide * HEIGHT
    return np.stack([right, HEIGHT * (1 - chart.y.share(y))], axis=1)


def _frame(stream: rr.RecordingStream, path: str, chart: Chart) -> None:
    width = chart.wide * HEIGHT
    box = np.array([[0, 0], [width, 0], [width, HEIGHT], [0, HEIGHT], [0, 0]])
    across, up = chart.x.ticks, chart.y.ticks
    columns, rows = chart.x.share(across) * width, HEIGHT * (1 - chart.y.share(up))
    lines = [box, *([[c, 0], [c, HEIGHT]] for c in columns), *([[0, r], [width, r]] for r in rows)]
    stream.log(
        f"{path}/frame",
        rr.LineStrips2D(
            lines, radii=HAIR, colors=[GREY] + [FAINT] * (len(lines) - 1), draw_order=BEHIND
        ),
    )
    words = [
        *((f"{v:g}", (c, HEIGHT + 1.0)) for v, c in zip(across, columns, strict=True)),
        *((f"{v:g}", (-0.35 * LEFT, r - 0.03 * HEIGHT)) for v, r in zip(up, rows, strict=True)),
        (chart.x.label, (width / 2, HEIGHT + 0.5 * BELOW)),
        (chart.y.label, (0.04 * width, -0.45 * ABOVE)),
        (chart.title, (width / 2, -0.9 * ABOVE)),
    ]
    write(stream, f"{path}/words", words, [GREY] * (len(words) - 1) + [BRIGHT])


def write(
    stream: rr.RecordingStream,
    path: str,
    words: Sequence[tuple[str, tuple[float, float]]],
    colours: Sequence[Colour],
) -> None:
    """Log words below places (x, y) of the scene: labels of points too small to be seen."""
    stream.log(
        path,
        rr.Points2D(
            [place for _, place in words], radii=0.01, labels=[word for word, _ in words],
            colors=colours, show_labels=True, draw_order=WORDS,
        ),
    )  # fmt: skip


def _legend(stream: rr.RecordingStream, path: str, chart: Chart) -> None:
    named = [(curve.name, curve.colour) for curve in chart.curves if curve.name]
    named += [(band.name, _bright(band.colour)) for band in chart.bands if band.name]
    step = chart.wide * HEIGHT / (len(named) + 1)  # the first place is the vertical axis' name
    places = [((k + 1.25) * step, -0.45 * ABOVE) for k in range(len(named))]
    words = [(name, place) for (name, _), place in zip(named, places, strict=True)]
    if words:
        write(stream, f"{path}/legend", words, [colour for _, colour in named])


def _band(stream: rr.RecordingStream, path: str, chart: Chart, band: ChartBand) -> None:
    known = np.isfinite(band.low) & np.isfinite(band.high)
    known &= (band.high >= chart.y.low) & (band.low <= chart.y.high)
    x, low, high = band.x[known], band.low[known], band.high[known]
    spacing = (chart.x.high - chart.x.low) / max(len(band.x) - 1, 1)
    if band.width > 0:  # of slender strokes: their ends are round
        spacing = band.width / STROKES
        beside = spacing * (np.arange(STROKES) - (STROKES - 1) / 2)
        x = (x[:, None] + beside).ravel()
        low, high = np.repeat(low, STROKES), np.repeat(high, STROKES)
    strips = np.stack([_place(chart, x, low), _place(chart, x, high)], axis=1)
    # A little over half, so that no gaps are seen.
    radius = 0.55 * spacing / (chart.x.high - chart.x.low) * chart.wide * HEIGHT
    stream.log(path, rr.LineStrips2D(strips, radii=radius, colors=band.colour, draw_order=BANDS))


def _curve(stream: rr.RecordingStream, path: str, chart: Chart, curve: Curve, order: float) -> None:
    known = np.isfinite(curve.x) & np.isfinite(curve.y)
    places = _place(chart, curve.x, curve.y)
    if curve.dots:
        radii = MARK * curve.thick
        dots = rr.Points2D(places[known], radii=radii, colors=curve.colour, draw_order=order)
        stream.log(path, dots)
        return
    ends = np.flatnonzero(np.diff(known.astype(int))) + 1
    parts = [p[k] for p, k in zip(np.split(places, ends), np.split(known, ends), strict=True)]
    strips = [part for part in parts if len(part) > 1]
    stream.log(
        path,
        rr.LineStrips2D(strips, radii=LINE * curve.thick, colors=curve.colour, draw_order=order),
    )


def _entity(name: str, otherwise: str) -> str:
    """A name as a part of an entity's path."""
    return "".join(c if c.isalnum() else "_" for c in name or otherwise)


def _bright(colour: Colour) -> Colour:
    """The same hue as bright as it gets: for words."""
    r, g, b = (int(c * 255 / max(*colour, 1)) for c in colour)
    return r, g, b
