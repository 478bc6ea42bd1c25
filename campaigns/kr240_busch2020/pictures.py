"""Scores and pictures of Busch et al. 2020: Table 2, maps (Figures 5, 8), FRFs, Figure 10."""

from dataclasses import dataclass, field

import numpy as np
from matplotlib.figure import Figure

from planner.report.plot_marks import empty, name_axes, panels
from planner.studies import drawing
from planner.studies.report import Table, r_squared
from planner.surrogate.models.frf_surface import SURFACES

from .data import BEYOND_DEG, TRAINED_DEG, Sweep

PAPER_R2 = {"simulation": 0.353, "GP": 0.785, "MFDGP": 0.758, "NARGP": 0.982}  # Table 2, test
PAPER_ALL = {"simulation": 0.345, "GP": 0.943, "MFDGP": 0.932, "NARGP": 0.992}  # and training
FUSED, DIAGNOSED = "fused modes", "diagnosed"
THIN = ("GP", "NARGP", FUSED)  # with every number of experiments; MFDGP and diagnosis once

Effects = tuple[tuple[str, str | None], ...]  # effect and place


@dataclass(frozen=True, eq=False)
class BeyondPrediction:
    """Amplitude (f, p) at BEYOND_DEG by name, the sd of the fused one, what diagnosis said, and
    the effects that it `named`.

    `whole` (2, f, n + p): amplitude and sd of models as published, at the measured angles as well.
    """

    amplitude: dict[str, np.ndarray]
    sd: np.ndarray
    said: str = ""
    whole: dict[str, np.ndarray] = field(default_factory=dict)
    named: Effects = ()


def scores(amplitude: np.ndarray, seen: Sweep) -> tuple[float, float]:
    """R² and RMSE in m/s²/N against the truth without noise."""
    rmse = np.sqrt(np.mean((amplitude - seen.truth) ** 2))
    return float(r_squared(amplitude, seen.truth)), float(rmse)


def inside(predicted: BeyondPrediction, seen: Sweep) -> float:
    """Share of the truth within 1.96 sd of the fused modes' FRF."""
    return float(np.mean(np.abs(predicted.amplitude[FUSED] - seen.truth) < 1.96 * predicted.sd))


def everywhere(name: str, predicted: BeyondPrediction, seen: Sweep) -> float:
    """R² over measured angles (against what was measured) and those beyond (against the truth)."""
    if name not in predicted.whole:
        return float("nan")
    return float(r_squared(predicted.whole[name][0], np.hstack([seen.amplitude, seen.truth])))


def score_table(predicted: BeyondPrediction, seen: Sweep) -> Table:
    """R² and RMSE of every model beside the paper's."""
    nan = float("nan")
    rows = []
    for name, amplitude in predicted.amplitude.items():
        beyond = *scores(amplitude, seen), PAPER_R2.get(name, nan)
        rows.append((name, *beyond, everywhere(name, predicted, seen), PAPER_ALL.get(name, nan)))
    title = f"Table 2: R² and RMSE beyond {TRAINED_DEG:.0f}°, trained below; R² over both"
    columns = ("model", "R²", "RMSE m/s²/N", "R² in the paper", "R² over both", "in the paper")
    return Table("busch2020_r2", title, columns, tuple(rows))


def thin_table(predicted: dict[int, BeyondPrediction], seen: Sweep) -> Table:
    """R² with every n-th experiment (Figure 10)."""
    rows = [
        (
            f"every {step}: {len(seen.every(step).angles_deg)} experiments",
            *(scores(each.amplitude[name], seen)[0] for name in THIN),
        )
        for step, each in predicted.items()
    ]
    return Table("busch2020_experiments", "R² with fewer experiments", ("trained with", *THIN),
                 tuple(rows))  # fmt: skip


SHOWN_DEG = (106.0, 113.0, 120.0)


def sd_maps(predicted: BeyondPrediction, seen: Sweep) -> Figure:
    """Sd of the models as published over the whole sweep (Figures 8d to 8f)."""
    names = [name for name in predicted.whole if name in SURFACES]
    title = f"Sd of models as published, trained to {TRAINED_DEG:.0f}°"
    figure, grid = panels((11.0, 3.6), title, 1, len(names), sharey=True)
    angles = np.concatenate([seen.angles_deg, BEYOND_DEG])
    for panel, name in zip(grid[0], names, strict=True):
        sd, style = predicted.whole[name][1], {"cmap": "magma", "vmin": 0, "rasterized": True}
        image = panel.pcolormesh(angles, seen.lines_hz, sd, **style)
        panel.axvline(TRAINED_DEG, color="w", ls="--", lw=1)
        panel.set_title(name, fontsize=9)
        figure.colorbar(image, ax=panel, label="sd (m/s²/N)")
    name_axes(figure, grid, "joint 3 (°)", "frequency (Hz)")
    return figure


def maps(predicted: BeyondPrediction, seen: Sweep) -> Figure:
    """What is measured, the truth beyond, and what each model predicts there, one colour scale."""
    figure = empty((11.0, 6.2), f"Driving-point accelerance, measured to {TRAINED_DEG:.0f}°")
    surfaces = {"measured": (seen.angles_deg, seen.lines_hz, seen.amplitude)}
    surfaces["truth (MuJoCo)"] = BEYOND_DEG, seen.lines_hz, seen.truth
    for name, amplitude in predicted.amplitude.items():
        r2 = scores(amplitude, seen)[0]
        surfaces[f"{name}, R² {r2:.3f}"] = BEYOND_DEG, seen.lines_hz, amplitude
    grid = figure.subplots(2, -(-len(surfaces) // 2), sharey=True, squeeze=False)
    drawing.maps(figure, list(grid.ravel()[: len(surfaces)]), surfaces, 40)
    name_axes(figure, grid, "joint 3 (°)", "frequency (Hz)")
    return figure


def overlays(predicted: BeyondPrediction, seen: Sweep) -> Figure:
    """FRFs at three angles beyond the training."""
    title = "FRFs beyond the training, at three angles"
    figure, grid = panels((9.0, 8.0), title, len(SHOWN_DEG))
    colours, hz = drawing.COLOURS, seen.lines_hz
    for panel, angle in zip(grid[:, 0], SHOWN_DEG, strict=True):
        i = int(np.flatnonzero(angle == BEYOND_DEG)[0])
        for name in (n for n in predicted.amplitude if n in PAPER_R2):
            amplitude = predicted.amplitude[name][:, i]
            panel.plot(hz, amplitude, color=colours[name], lw=1.1, label=name)
        mean, spread = predicted.amplitude[FUSED][:, i], 1.96 * predicted.sd[:, i]
        low, colour = np.maximum(mean - spread, 0), colours[FUSED]
        panel.fill_between(hz, low, mean + spread, color=colour, alpha=0.25, lw=0)
        panel.plot(hz, mean, color=colour, lw=1.6, label="fused modes, 95 % band")
        panel.plot(hz, seen.truth[:, i], "k--", lw=1.2, label="truth (MuJoCo)")
        panel.set_title(f"joint 3 at {angle:.0f}°", fontsize=9)
        panel.set_xlim(hz[0], hz[-1])
        panel.set_ylim(0, 1.6 * seen.truth[:, i].max())
        panel.grid(True, alpha=0.25)
    name_axes(figure, grid, "frequency (Hz)", "|H| (m/s²/N)")
    return figure


def experiments(thin: Table, steps: tuple[int, ...]) -> Figure:
    """R² with fewer experiments (Figure 10)."""
    figure = empty((7.0, 4.2), f"R² beyond {TRAINED_DEG:.0f}° with every n-th experiment")
    panel = figure.subplots()
    values = np.array([row[1:] for row in thin.rows], dtype=float)
    drawing.curves(panel, np.array(steps), thin.columns[1:], values)
    panel.set_xlabel("every … experiment")
    panel.set_ylabel("R²")
    panel.set_xticks(steps)
    panel.set_ylim(min(0.5, float(values.min()) - 0.05), 1.02)
    panel.legend(fontsize=9, loc="lower left")
    return figure
