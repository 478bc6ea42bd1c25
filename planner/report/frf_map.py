"""FRF map of a path: magnitude over frequency and pose (Birk et al. 2025, section 2.5)."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

from planner.report.plot_marks import plain_text

FAINTEST_DB = 50.0  # below the strongest resonance; what is fainter is drawn alike
MOST_NAMES = 40  # of poses that fit beside each other at an axis
DIFFERENCE_DB = 20.0  # a factor of ten saturates the colours of the difference


def frf_map(
    pose_axis: np.ndarray,
    measured: np.ndarray | None,
    simulated: np.ndarray | None,
    frequency_hz: np.ndarray,
    pose_label: str = "pose",
    title: str = "",
    log_frequency: bool = False,
    names: Sequence[str] = (),
) -> Figure:
    """One FRF along a path: panels measured, simulated, and simulated − measured, in dB.

    pose_axis (n,) is where on the path a pose is (number, angle, length; any order); measured and
    simulated (n, F), complex or magnitudes, in m/s²/N, on frequency_hz (F,). One of the two may be
    None: then the other is the only panel. NaN stays blank. `names` (n,) of the poses stand at the
    axis instead of numbers. Raises ValueError if shapes disagree.
    """
    shape = len(pose_axis), len(frequency_hz)
    order = np.argsort(pose_axis, kind="stable")
    lines = frequency_hz > 0 if log_frequency else np.full(shape[1], True)
    levels = {}
    for name, frf in (("measured", measured), ("simulated", simulated)):
        if frf is not None:
            if np.shape(frf) != shape:
                raise ValueError(f"the {name} FRF has shape {np.shape(frf)}, not {shape}")
            levels[name] = _decibel(np.asarray(frf)[order][:, lines])
    if not levels:
        raise ValueError("neither a measured nor a simulated FRF is given")
    grid = (
        _edges(np.asarray(pose_axis, float)[order]),
        _frequency_edges(np.asarray(frequency_hz, float)[lines], log_frequency),
    )
    figure, panels = _panels(1 if len(levels) == 1 else 3)
    _fill(figure, panels, grid, levels)
    for panel in panels:
        panel.set_xlabel(pose_label)
        panel.set_yscale("log" if log_frequency else "linear")
        if len(names):
            every = -(-len(names) // MOST_NAMES)
            shown = [plain_text(name) for name in names][::every]
            panel.set_xticks(np.asarray(pose_axis)[::every], shown, rotation=90, fontsize=7)
    panels[0].set_ylabel("frequency (Hz)")
    figure.suptitle(plain_text(title), fontsize=10)
    return figure


def _panels(count: int) -> tuple[Figure, np.ndarray]:
    figure = Figure(figsize=(3.6 * count + 1.2, 4.2), layout="constrained")
    return figure, np.atleast_1d(figure.subplots(1, count, sharey=True))


def _fill(
    figure: Figure,
    panels: np.ndarray,
    grid: tuple[np.ndarray, np.ndarray],
    levels: dict[str, np.ndarray],
) -> None:
    """Draw levels (dB) on one colour scale, and the difference where there are two."""
    top = max((np.nanmax(v) for v in levels.values() if not np.isnan(v).all()), default=0.0)
    images = [
        _draw(panel, grid, level, (top - FAINTEST_DB, top), "viridis", name)
        for panel, (name, level) in zip(panels, levels.items(), strict=False)
    ]
    figure.colorbar(images[0], ax=list(panels[: len(images)]), label="dB re 1 m/s²/N", pad=0.01)
    if len(levels) == 2:
        difference = levels["simulated"] - levels["measured"]
        limits = -DIFFERENCE_DB, DIFFERENCE_DB
        image = _draw(panels[2], grid, difference, limits, "RdBu_r", "simulated − measured")
        figure.colorbar(image, ax=panels[2], label="dB", pad=0.01)


def _draw(
    panel: Axes,
    grid: tuple[np.ndarray, np.ndarray],
    level_db: np.ndarray,
    limits_db: tuple[float, float],
    colours: str,
    title: str,
) -> QuadMesh:
    panel.set_title(title, fontsize=9)
    low, high = limits_db
    values = np.ma.masked_invalid(level_db.T)
    return panel.pcolormesh(*grid, values, vmin=low, vmax=high, cmap=colours, rasterized=True)


def _decibel(frf: np.ndarray) -> np.ndarray:
    return 20 * np.log10(np.maximum(np.abs(frf), np.finfo(float).tiny))


def _frequency_edges(frequency_hz: np.ndarray, log: bool) -> np.ndarray:
    return np.exp(_edges(np.log(frequency_hz))) if log else _edges(frequency_hz)


def _edges(centres: np.ndarray) -> np.ndarray:
    """Cell borders (n + 1,) halfway between increasing centres (n,)."""
    if len(centres) == 1:
        return centres[0] + np.array([-0.5, 0.5])
    inner = (centres[1:] + centres[:-1]) / 2
    return np.concatenate([[2 * centres[0] - inner[0]], inner, [2 * centres[-1] - inner[-1]]])
