"""Figures 7, 8, 10 and 11 of Busch et al. 2022."""

import numpy as np
from matplotlib.figure import Figure

from planner.studies import drawing
from planner.studies.busch2022_data import COMPARED, FREQUENCY_MODELS, KERNELS

FLOOR = -0.2  # of R² in bars; less is drawn cut off


def pictures(
    seven: np.ndarray, eight: np.ndarray, ten: np.ndarray, eleven: np.ndarray,
    shown: tuple[int, ...],
) -> dict[str, Figure]:  # fmt: skip
    """By file name; scores (outputs, models, 3), in 8 by count, in 11 by residue."""
    return {
        "busch2022_figure_7": _benchmark(
            seven, FREQUENCY_MODELS, "Figure 7: frequencies, 15 poses trained, 20 predicted",
            "RMSE (Hz)",
        ),
        "busch2022_figure_8": _figure_8(eight, shown),
        "busch2022_figure_10": _benchmark(
            ten, KERNELS, "Figure 10: damping ratios, 15 poses trained, 20 predicted",
            "RMSE (% of critical)",
        ),
        "busch2022_figure_11": _figure_11(eleven),
    }  # fmt: skip


def _modes(count: int) -> list[str]:
    return [f"mode {k + 1}" for k in range(count)]


def _benchmark(scores: np.ndarray, names: tuple[str, ...], title: str, unit: str) -> Figure:
    figure = drawing.new((9.0, 6.0), title)
    panels = figure.subplots(2, 1, sharex=True)
    modes = _modes(len(scores))
    drawing.bars(panels[0], modes, names, scores[..., 0], "R²", FLOOR)
    drawing.bars(panels[1], modes, names, scores[..., 1], unit)
    drawing.legend(figure, panels[0])
    return figure


def _figure_8(eight: np.ndarray, shown: tuple[int, ...]) -> Figure:
    counts = np.array(shown)
    modes = eight.shape[1]
    figure = drawing.new(
        (3.2 * modes, 6.4),
        "Figure 8: natural frequencies, predicted with N poses (medians over splits)",
    )
    panels = figure.subplots(2, modes, sharex=True)
    for k in range(modes):
        upper, lower = panels[:, k]
        drawing.curves(upper, counts, COMPARED, np.maximum(eight[:, k, :, 0], FLOOR))
        upper.axhline(0.9, color="black", ls="--", lw=0.8)
        upper.set_ylim(FLOOR - 0.03, 1.05)
        upper.set_title(f"mode {k + 1}", fontsize=10)
        drawing.curves(lower, counts, COMPARED, eight[:, k, :, 1])
        lower.set_ylim(0, 1.1 * float(np.quantile(eight[..., 1], 0.97)))
        lower.set_xlabel("poses N")
        lower.set_xticks(counts[::2] if len(counts) > 5 else counts)
    panels[0, 0].set_ylabel(f"R² (below {FLOOR:g}: drawn there)")
    panels[1, 0].set_ylabel("RMSE (Hz)")
    drawing.legend(figure, panels[0, 0])
    return figure


def _figure_11(eleven: np.ndarray) -> Figure:
    figure = drawing.new((10.0, 6.4), "Figure 11: residues, 15 poses trained, 20 predicted")
    panels = figure.subplots(2, 2, sharex=True)
    modes = _modes(eleven.shape[1])
    for row, direction in enumerate(("xx", "yy")):
        for column, part in enumerate(("real", "imaginary")):
            panel = panels[row, column]
            drawing.bars(
                panel, modes, KERNELS, eleven[2 * row + column, ..., 1], "RMSE / mode's rms"
            )
            panel.set_title(f"R {direction}, {part} part", fontsize=10)
    drawing.legend(figure, panels[0, 0])
    return figure
