"""Pictures of Busch et al. 2020: maps (Figures 5 and 8), FRFs beyond, fewer experiments."""

import numpy as np
from matplotlib.figure import Figure

from planner.studies import drawing
from planner.studies.busch2020_data import BEYOND_DEG, TRAINED_DEG, Sweep
from planner.studies.busch2020_scores import FUSED, PAPER_R2, BeyondPrediction, scores
from planner.studies.report import Table

SHOWN_DEG = (106.0, 113.0, 120.0)


def sd_maps(predicted: BeyondPrediction, seen: Sweep) -> Figure:
    """Sd of the models as published over the whole sweep (Figures 8d to 8f)."""
    names = list(predicted.beyond_sd)
    figure = drawing.new((11.0, 3.6), f"Sd of models as published, trained to {TRAINED_DEG:.0f}°")
    panels = figure.subplots(1, len(names), sharey=True, squeeze=False)[0]
    angles = np.concatenate([seen.angles_deg, BEYOND_DEG])
    for panel, name in zip(panels, names, strict=True):
        sd = np.hstack([predicted.trained_sd[name], predicted.beyond_sd[name]])
        image = panel.pcolormesh(angles, seen.lines_hz, sd, cmap="magma", vmin=0, rasterized=True)
        panel.axvline(TRAINED_DEG, color="w", ls="--", lw=1)
        panel.set_title(name, fontsize=9)
        panel.set_xlabel("joint 3 (°)")
        figure.colorbar(image, ax=panel, label="sd (m/s²/N)")
    panels[0].set_ylabel("frequency (Hz)")
    return figure


def maps(predicted: BeyondPrediction, seen: Sweep) -> Figure:
    """What is measured, the truth beyond, and what each model predicts there, one colour scale."""
    figure = drawing.new((11.0, 6.2), f"Driving-point accelerance, measured to {TRAINED_DEG:.0f}°")
    surfaces = {"measured": seen.amplitude, "truth (MuJoCo)": seen.truth} | predicted.amplitude
    columns = -(-len(surfaces) // 2)
    grid = figure.subplots(2, columns, sharey=True, squeeze=False)
    panels = grid.ravel()[: len(surfaces)]
    top = _decibel(seen.amplitude).max()
    for panel, (name, amplitude) in zip(panels, surfaces.items(), strict=True):
        angles = seen.angles_deg if name == "measured" else BEYOND_DEG
        image = panel.pcolormesh(
            angles, seen.lines_hz, _decibel(amplitude), vmin=top - 40, vmax=top, cmap="viridis",
            rasterized=True,
        )  # fmt: skip
        known = name in ("measured", "truth (MuJoCo)")
        r2 = "" if known else f", R² {scores(amplitude, seen)[0]:.3f}"
        panel.set_title(f"{name}{r2}", fontsize=9)
        if panel is panels[-1]:
            figure.colorbar(image, ax=list(panels), label="dB re 1 m/s²/N", pad=0.01)
    for panel in grid[1]:
        panel.set_xlabel("joint 3 (°)")
    for panel in grid[:, 0]:
        panel.set_ylabel("frequency (Hz)")
    return figure


def _decibel(amplitude: np.ndarray) -> np.ndarray:
    return 20 * np.log10(np.maximum(amplitude, 1e-9))


def overlays(predicted: BeyondPrediction, seen: Sweep) -> Figure:
    """FRFs at three angles beyond the training."""
    figure = drawing.new((9.0, 8.0), "FRFs beyond the training, at three angles")
    panels = figure.subplots(len(SHOWN_DEG), 1, sharex=True)
    colours = drawing.COLOURS
    for panel, angle in zip(panels, SHOWN_DEG, strict=True):
        i = int(np.flatnonzero(angle == BEYOND_DEG)[0])
        for name in (n for n in predicted.amplitude if n in PAPER_R2):
            panel.plot(
                seen.lines_hz,
                predicted.amplitude[name][:, i],
                color=colours[name],
                lw=1.1,
                label=name,
            )
        mean, sd = predicted.amplitude[FUSED][:, i], predicted.sd[:, i]
        panel.fill_between(
            seen.lines_hz, np.maximum(mean - 1.96 * sd, 0), mean + 1.96 * sd,
            color=colours[FUSED], alpha=0.25, lw=0,
        )  # fmt: skip
        panel.plot(
            seen.lines_hz, mean, color=colours[FUSED], lw=1.6, label="fused modes, 95 % band"
        )
        panel.plot(seen.lines_hz, seen.truth[:, i], "k--", lw=1.2, label="truth (MuJoCo)")
        panel.set_title(f"joint 3 at {angle:.0f}°", fontsize=9)
        panel.set_ylabel("|H| (m/s²/N)")
        panel.set_xlim(seen.lines_hz[0], seen.lines_hz[-1])
        panel.set_ylim(0, 1.6 * seen.truth[:, i].max())
        panel.grid(True, alpha=0.25)
    panels[-1].set_xlabel("frequency (Hz)")
    drawing.legend(figure, panels[0])
    return figure


def experiments(thin: Table, steps: tuple[int, ...]) -> Figure:
    """R² with fewer experiments (Figure 10)."""
    figure = drawing.new((7.0, 4.2), f"R² beyond {TRAINED_DEG:.0f}° with every n-th experiment")
    panel = figure.subplots()
    values = np.array([row[1:] for row in thin.rows], dtype=float)
    drawing.curves(panel, np.array(steps), thin.columns[1:], values)
    panel.set_xlabel("every … experiment")
    panel.set_ylabel("R²")
    panel.set_xticks(steps)
    panel.set_ylim(min(0.5, float(values.min()) - 0.05), 1.02)
    panel.legend(fontsize=9, loc="lower left")
    return figure
