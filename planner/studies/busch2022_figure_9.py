"""Figure 9 of Busch et al. 2022: a frequency from three poses, with its 95 % interval."""

from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.figure import Figure

from planner.studies import drawing
from planner.studies.busch2022_data import split
from planner.studies.models.fidelity_levels import Samples

Fit = Callable[[Samples], Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]]
FEWEST = 3  # poses: B_3


def figure_9(x: np.ndarray, y: np.ndarray, sd: np.ndarray, fits: Mapping[str, Fit]) -> Figure:
    """Predicted over measured at the test poses, y (n,) in Hz at x (n, d); one panel a model."""
    train, test = split(x, 0)
    test = test[np.isfinite(y[test])]
    samples = Samples.of(x[train[:FEWEST]], y[train[:FEWEST]], sd[train[:FEWEST]])
    figure = drawing.new((10.0, 4.6), "Figure 9: ω₂ predicted from three poses, 95 % interval")
    panels = figure.subplots(1, len(fits), sharex=True, sharey=True)
    ends = float(np.min(y[test])) - 0.3, float(np.max(y[test])) + 0.3
    for panel, (name, fit) in zip(np.atleast_1d(panels), fits.items(), strict=True):
        mean, spread = fit(samples)(x[test])
        inside = np.abs(mean - y[test]) < 1.96 * np.hypot(spread, sd[test])
        panel.errorbar(
            y[test], mean, 1.96 * spread, fmt="o", ms=4, lw=1, color=drawing.COLOURS[name]
        )
        panel.plot(ends, ends, "k--", lw=0.8)
        panel.set_title(f"{name}: {inside.sum()} of {len(test)} inside", fontsize=10)
        panel.set_xlabel("measured (Hz)")
        panel.grid(True, alpha=0.25)
    np.atleast_1d(panels)[0].set_ylabel("predicted (Hz)")
    return figure
