"""FRFs measured and simulated over each other, maps of them along poses, and a diagnosis' ones."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from planner.diagnosis.diagnose import Diagnosis
from planner.diagnosis.mismatch import Residuals, simulated
from planner.recording.points import TOOL
from planner.report import plot_marks as marks

# Dashes over wide lines: where two agree, both are seen.
SEEN = {"label": "measured", "color": "0.25", "lw": 4.5}
GIVEN = {"color": "tab:blue", "ls": ":", "lw": 1.1, "zorder": 3.0}
REFITTED = {"color": "tab:orange", "ls": "-", "lw": 2.6}
EXPLAINED = {"color": "tab:red", "ls": "--", "lw": 1.0}
IDENTIFIED = {"color": "tab:red", "ls": "-", "lw": 1.2}
MOST = 6  # poses whose FRFs are shown
FAINTEST_DB = 50.0  # below the strongest resonance; what is fainter is drawn alike
MOST_NAMES = 40  # of poses that fit beside each other at an axis
DIFFERENCE_DB = 20.0  # a factor of ten saturates the colours of the difference
LINES = 256  # a pose
UNIT = "mean square residual (1: just matters)"
LEAST, MOST_RESIDUAL = 1e-3, 1000.0  # of the scale
STYLES = {"as given": GIVEN, "refitted": REFITTED, "explained": EXPLAINED}


@dataclass(frozen=True, eq=False)
class Side:
    """One simulation's FRFs (n, 3, 3, F) in m/s²/N; its `key` in files' names, how it is drawn."""

    key: str
    label: str
    style: Mapping[str, Any]
    h: np.ndarray


@dataclass(frozen=True, eq=False)
class ComparedFrfs:
    """FRFs of n named poses on lines (n, F): measured (n, 3, 3, F) in m/s²/N, and as simulated.

    NaN where nothing was measured.
    """

    names: tuple[str, ...]
    frequency_hz: np.ndarray
    measured: np.ndarray
    sides: tuple[Side, ...]
    roles: tuple[str, ...] = ()  # of the poses
    place: str = ""  # before titles, where it is not the tool

    def figures(self, first: Sequence[int]) -> dict[str, Figure]:
        """The direct FRFs of so many of the `first` poses, then maps of each over all poses."""
        figures = {}
        for k in first[:MOST]:
            name = re.sub(r"[^\w.-]", "_", str(self.names[k]))
            figures[f"frf_{name}"] = self.overlay(k)
        for i, axis in enumerate(marks.AXES):
            measured = self._aligned(self.measured[:, i, i])
            for side in self.sides:
                figures[f"map_{axis}{axis}_{side.key}"] = frf_map(
                    self.names, measured, self._aligned(side.h[:, i, i]), self.frequency_hz[0],
                    f"{self.place}Map of H {axis}{axis}, simulation {side.label}",
                )  # fmt: skip
        return figures

    def _aligned(self, h: np.ndarray) -> np.ndarray:
        """|H| (n, F) on the lines of the first pose."""
        first, rows = self.frequency_hz[0], zip(self.frequency_hz, np.abs(h), strict=True)
        return np.array([np.interp(first, hz, row, np.nan, np.nan) for hz, row in rows])

    def overlay(self, k: int) -> Figure:
        """Direct FRFs xx, yy, zz of the k-th pose."""
        role = f" ({self.roles[k]})" if self.roles else ""
        figure, grid = marks.panels((7.5, 7.0), f"{self.place}Pose {self.names[k]}{role}", 3)
        hz = self.frequency_hz[k]
        for i, panel in enumerate(grid[:, 0]):
            marks.magnitude(panel, hz, self.measured[k, i, i], **SEEN)
            for side in self.sides:
                marks.magnitude(panel, hz, side.h[k, i, i], label=side.label, **side.style)
            panel.set_ylabel(f"|H {marks.AXES[i]}{marks.AXES[i]}| (m/s²/N)", fontsize=8)
            panel.grid(True, which="both", alpha=0.25)
        marks.name_axes(figure, grid, "frequency (Hz)")
        return figure


def frf_map(
    names: Sequence[str], measured: np.ndarray, simulated: np.ndarray, frequency_hz: np.ndarray,
    title: str,
) -> Figure:  # fmt: skip
    """One FRF over n named poses (Birk et al. 2025, section 2.5): measured, simulated, difference.

    measured and simulated (n, F), complex or magnitudes, in m/s²/N, on frequency_hz (F,) are drawn
    in dB. NaN stays blank.
    """
    least = np.finfo(float).tiny
    seen, made = (20 * np.log10(np.maximum(np.abs(h), least)) for h in (measured, simulated))
    top = max((np.nanmax(v) for v in (seen, made) if not np.isnan(v).all()), default=0.0)
    shown = (
        ("measured", seen, (top - FAINTEST_DB, top), "viridis"),
        ("simulated", made, (top - FAINTEST_DB, top), "viridis"),
        ("simulated − measured", made - seen, (-DIFFERENCE_DB, DIFFERENCE_DB), "RdBu_r"),
    )
    figure, grid = marks.panels((12.0, 4.2), title, 1, 3, sharey=True)
    place, images = np.arange(1, len(names) + 1), []
    every = -(-len(names) // MOST_NAMES)
    ticks = [marks.plain_text(name) for name in names][::every]
    for panel, (name, level, (low, high), colours) in zip(grid[0], shown, strict=True):
        panel.set_title(name, fontsize=9)
        panel.set_xlabel("pose, in recorded order")
        values = np.ma.masked_invalid(level.T)
        style = {"vmin": low, "vmax": high, "cmap": colours, "rasterized": True}
        images.append(panel.pcolormesh(_edges(place), _edges(frequency_hz), values, **style))
        panel.set_xticks(place[::every], ticks, rotation=90, fontsize=7)
    grid[0, 0].set_ylabel("frequency (Hz)")
    figure.colorbar(images[0], ax=[*grid[0, :2]], label="dB re 1 m/s²/N", pad=0.01)
    figure.colorbar(images[2], ax=grid[0, 2], label="dB", pad=0.01)
    return figure


def _edges(centres: np.ndarray) -> np.ndarray:
    """Cell borders (n + 1,) halfway between increasing centres (n,)."""
    if len(centres) == 1:
        return centres[0] + np.array([-0.5, 0.5])
    inner = (centres[1:] + centres[:-1]) / 2
    return np.concatenate([[2 * centres[0] - inner[0]], inner, [2 * centres[-1] - inner[-1]]])


def diagnosis_figures(found: Diagnosis) -> dict[str, Figure]:
    """Residuals by band, pose and direction; FRF maps; direct FRFs of the worst poses.

    Of several sensors and hit points, FRFs are those of the first ones.
    """
    names, search = found.recorded.poses, found.search
    matters = search.prior.effect_library.stiff.robot.config.diagnose.matters
    before, after = (Residuals.of(f, search.band_hz, matters) for f in (found.refitted, found.best))
    data = search.data(LINES)
    seen = data.measured
    measured = np.where(seen.used, seen.accelerance, np.nan)
    sides = (
        Side(label.replace(" ", "_"), label, style, h)
        for (label, style), h in zip(STYLES.items(), simulated(found, data), strict=True)
    )
    there = seen.layout
    place = "" if there == TOOL else f"{there.sensors[0]}, hit at {there.hits[0]}: "
    compared = ComparedFrfs(names, seen.frequency_hz, measured, tuple(sides), place=place)
    worst = np.argsort(-before.by_pose).tolist()
    return {"residuals": _residuals(before, after, names)} | compared.figures(worst)


def _residuals(before: Residuals, after: Residuals, names: Sequence[str]) -> Figure:
    what = "What is left unexplained, errors of hits and sensor taken out (1: just matters)"
    figure = marks.empty((9.0, 6.5), what)
    (bands, poses), (left, right) = figure.subplots(2, 2)
    middle = (before.edges_hz[1:] + before.edges_hz[:-1]) / 2
    number = np.arange(len(names))
    sides = (before, "refitted", 8.0), (after, "explained", 3.5)
    for place, label, size in sides:
        style = STYLES[label] | {"label": label, "marker": "o", "ms": size}
        bands.semilogy(middle, np.maximum(place.by_band, LEAST), **style)
        poses.semilogy(number, np.maximum(place.by_pose, LEAST), **style)
    for panel, what in ((bands, "frequency (Hz)"), (poses, "pose")):
        panel.axhline(1.0, color="black", lw=0.8, ls=":")
        panel.set_xlabel(what)
        panel.set_ylabel(UNIT, fontsize=8)
        panel.legend()
    poses.set_xticks(number, [marks.plain_text(n) for n in names], rotation=60, fontsize=7)
    scale, image = LogNorm(LEAST, MOST_RESIDUAL), ScalarMappable()
    for panel, (place, label, _) in zip((left, right), sides, strict=True):
        image = panel.imshow(np.maximum(place.by_direction, LEAST), cmap="Reds", norm=scale)
        marks.write_values(panel, image, ".3g")
        panel.set_xticks(range(3), [f"hit {a}" for a in marks.AXES])
        panel.set_yticks(range(3), [f"response {a}" for a in marks.AXES])
        panel.set_title(f"by direction, {label}", fontsize=9)
    # One scale for both, so that what an explanation takes away is seen.
    figure.colorbar(image, ax=[left, right], label=UNIT, shrink=0.9)
    return figure
