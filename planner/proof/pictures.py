"""Pictures of a proof: curves over detectability, who was called what, and calibration."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from planner.proof.curves import CLEARLY_NATS, EDGES_NATS, MEASURES, CurveBin, curve, nameable
from planner.proof.score import Scored, by_probability
from planner.report.plot_text import ink

OPEN_DECADES = 10.0  # factor by which the first and last bin are drawn beyond their inner edge
KNOWN = {"nats": "hits and chain known", "nats_open": "hits and chain open"}


def curves(scored: Sequence[Scored]) -> Figure:
    """Share of effects named and placed, over nats, with Wilson's intervals."""
    figure = Figure(figsize=(11, 4.5), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(MEASURES), sharey=True)
    effects = nameable(scored)
    for panel, measure in zip(panels, MEASURES, strict=True):
        bins = curve(effects, measure)
        _shares(panel, bins, "in_set", "tab:green", "or in a set of at most two")
        _shares(panel, bins, "named", "tab:blue", "named and placed")
        panel.axvline(CLEARLY_NATS, color="black", lw=0.8, ls=":")
        panel.set_xscale("log")
        panel.set_ylim(-0.02, 1.05)
        panel.set_title(KNOWN[measure])
        panel.set_xlabel("what the recordings tell of the effect (nats)")
    panels[0].set_ylabel("share of concealed effects")
    panels[0].legend(loc="upper left")
    return figure


def _shares(panel: Axes, bins: Sequence[CurveBin], of: str, color: str, label: str) -> None:
    first, last = EDGES_NATS[1] / OPEN_DECADES, EDGES_NATS[-2] * OPEN_DECADES
    for number, one in enumerate(bins):
        found = getattr(one, of)
        if found.share is None:
            continue
        low, high = max(one.least, first), last if one.most is None else one.most
        middle = float(np.sqrt(low * high))
        panel.fill_between([low, high], *found.interval95, color=color, alpha=0.15, lw=0)
        panel.plot([low, high], [found.share] * 2, color=color, label=None if number else label)
        if of == "named":
            panel.annotate(str(found.of), (middle, found.share), ha="center", va="bottom")
    if bins[0].named.share is None:
        panel.plot([], [], color=color, label=label)


def _name(places: Sequence[tuple[str, str | None]]) -> str:
    if len(places) > 1:
        return "pair"
    return places[0][0] if places else "none"


def confusion(scored: Sequence[Scored]) -> Figure:
    """What was concealed against what was said first."""
    names = sorted({_name(s.true) for s in scored} | {_name(s.said) for s in scored})
    counts = np.zeros((len(names), len(names)), dtype=int)
    for s in scored:
        counts[names.index(_name(s.true)), names.index(_name(s.said))] += 1
    figure = Figure(figsize=(9, 8), layout="constrained")
    FigureCanvasAgg(figure)
    panel = figure.subplots()
    image = panel.imshow(counts, cmap="Blues")
    for (i, j), count in np.ndenumerate(counts):
        if count:
            colour = ink(image.to_rgba(count))
            panel.text(j, i, str(count), ha="center", va="center", color=colour)
    panel.set_xticks(range(len(names)), names, rotation=90)
    panel.set_yticks(range(len(names)), names)
    panel.set_xlabel("said first")
    panel.set_ylabel("concealed")
    return figure


def calibration(scored: Sequence[Scored]) -> Figure:
    """How often what was said first is right, over its stated probability."""
    figure = Figure(figsize=(5, 5), layout="constrained")
    FigureCanvasAgg(figure)
    panel = figure.subplots()
    panel.plot([0, 1], [0, 1], color="black", lw=0.8, ls=":")
    for p, right in by_probability(scored):
        panel.plot(p.mean(), right.mean(), "o", ms=3 + np.sqrt(len(p)))
        panel.annotate(str(len(p)), (p.mean(), right.mean()))
    panel.set_xlabel("stated probability")
    panel.set_ylabel("share that is right")
    return figure


PICTURES: dict[str, Callable[[Sequence[Scored]], Figure]] = {
    "curves": curves,
    "confusion": confusion,
    "calibration": calibration,
}
