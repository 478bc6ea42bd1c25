"""Figures 2, 4 and 5 of Seyed Hosseini et al. 2025."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from planner.report.plot_marks import empty, name_axes, panels, write_values
from planner.studies import drawing
from planner.studies.report import Table, r_squared

from .data import MODES, TABLED, PostureData

HELD_OUT = 15
LINES_HZ = np.linspace(5.0, 40.0, 281)


@dataclass(frozen=True, eq=False)
class Direct:
    """Amplitudes (3, F) of xx, yy, zz: predicted, 95 % band (2, 3, F) and truth; R² (3,)."""

    predicted: np.ndarray
    band: np.ndarray
    truth: np.ndarray

    @property
    def r2(self) -> tuple[float, ...]:
        """(3,)"""
        return tuple(map(float, r_squared(self.predicted, self.truth, 1)))


def heatmap(correlation: Table) -> Figure:
    """Figure 2: correlation (6 joints, modes), by joint and mode."""
    figure = empty((5.6, 5.2), "Figure 2: correlation of joint angles with frequencies")
    panel = figure.subplots()
    values = np.array([row[1:] for row in correlation.rows], dtype=float)
    image = panel.imshow(values, cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
    write_values(panel, image, ".2f")
    panel.set_xticks(range(TABLED), correlation.columns[1:])
    panel.set_yticks(range(6), [str(row[0]) for row in correlation.rows])
    figure.colorbar(image, label="correlation")
    return figure


def last_postures(data: PostureData, mean: np.ndarray, sd: np.ndarray) -> Figure:
    """Figure 4: f and ζ over the last postures, mean and sd (15, 48) of the columns."""
    figure, grid = panels((12.0, 6.4), "Figure 4: the last 15 postures", 2, TABLED)
    number = np.arange(len(data.q) - HELD_OUT, len(data.q)) + 1
    for row, (scale, unit) in enumerate(((1.0, "frequency (Hz)"), (100.0, "damping ratio (%)"))):
        for k, panel in enumerate(grid[row]):
            c = MODES * row + k
            low, high = (scale * np.exp(mean[:, c] + z * sd[:, c]) for z in (-1.96, 1.96))
            measured, true = (scale * np.exp(v[-HELD_OUT:, c]) for v in (data.measured, data.clean))
            drawing.band(panel, number, scale * np.exp(mean[:, c]), (low, high), "95 % interval")
            panel.plot(number, measured, "k.", label="measured (simulated)")
            panel.plot(number, true, "k", lw=0.8, label="truth (MuJoCo)")
            if row == 0:
                panel.set_title(f"mode {k + 1}", fontsize=10)
        grid[row, 0].set_ylabel(unit)
    name_axes(figure, grid, "posture")
    return figure


def overlays(frfs: dict[int, Direct]) -> Figure:
    """Figure 5: amplitudes xx, yy, zz at some postures."""
    title = "Figure 5: FRFs put together from predicted modes"
    figure, grid = panels((12.0, 6.4), title, len(frfs), 3)
    for row, (posture, frf) in zip(grid, frfs.items(), strict=True):
        for axis, panel in enumerate(row):
            title = f"posture {posture}, {'xyz'[axis] * 2}, R² {frf.r2[axis]:.3f}"
            drawing.frf(panel, LINES_HZ, frf.predicted[axis], frf.band[:, axis], title)
            panel.plot(LINES_HZ, frf.truth[axis], "k--", lw=1.1, label="truth (MuJoCo)")
    name_axes(figure, grid, "frequency (Hz)", "|H| (m/s²/N)")
    return figure
