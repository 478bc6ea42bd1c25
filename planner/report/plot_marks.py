"""What pictures share: panels, curves with bands, marked modes, text that can be read."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from scipy.ndimage import median_filter
from scipy.optimize import isotonic_regression

from planner.report.text import with_sd

if TYPE_CHECKING:
    from matplotlib.image import AxesImage

    from planner.frf.frf import Frf
    from planner.modal.matrix_modes import MatrixModes
    from planner.modal.modes import ModalModel
    from planner.modal.operating import OperatingModes

AXES = ("x", "y", "z")
MEASURED, MODEL = "black", "tab:red"
# Relative luminance of sRGB (ITU-R BT.709), and the one at which black and white contrast alike
# with a colour (WCAG 2: (L + 0.05)² = 0.05 · 1.05).
WEIGHTS, ALIKE = (0.2126, 0.7152, 0.0722), 0.179
MODE, USABLE = "tab:blue", "tab:green"
COHERENT, WINDOW = 0.8, 7  # from this coherence (median of so many lines around) an FRF is shaded
FAINTEST = 1e-3  # of an FRF's largest magnitude: bands that reach below are cut off there
COLUMNS = 9  # labels of several lines that fit side by side; more are turned upright


def plain_text(text: str) -> str:
    """A name as it stands: Matplotlib would read what lies between two dollars as a formula."""
    return text.replace("$", r"\$")


def ink(colour: ArrayLike) -> str:
    """ "black" or "white", whichever is read better on a colour (3 or 4 numbers, 0 to 1)."""
    part = np.asarray(colour, dtype=float)[:3]
    linear = np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)
    return "black" if linear @ WEIGHTS > ALIKE else "white"


def write_values(panel: Axes, image: "AxesImage", form: str, **style: Any) -> None:
    """Values of an image (`form` as of `format`) in its cells, in readable ink."""
    values = np.asarray(image.get_array(), dtype=float)
    for (i, j), value in np.ndenumerate(values):
        if np.isfinite(value):
            colour = ink(image.to_rgba(value))
            panel.text(j, i, format(value, form), ha="center", va="center", color=colour, **style)


def empty(size: tuple[float, float], title: str = "") -> Figure:
    """A figure (size in inches) with a title."""
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(plain_text(title), fontsize=11)
    return figure


def panels(
    size: tuple[float, float], title: str, rows: int = 1, columns: int = 1, **layout: Any
) -> tuple[Figure, Any]:
    """A figure (size in inches) with panels (rows, columns) that share the horizontal axis."""
    figure = empty(size, title)
    return figure, figure.subplots(rows, columns, sharex=True, squeeze=False, **layout)


def name_axes(figure: Figure, grid: np.ndarray, x: str = "", y: str = "") -> None:
    """Labels at the outer panels of a grid, and one legend of the first panel's curves below."""
    for panel in grid[-1] if x else ():
        panel.set_xlabel(x)
    for panel in grid[:, 0] if y else ():
        panel.set_ylabel(y)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    if handles:
        columns = min(len(labels), 7)  # that fit side by side
        figure.legend(handles, labels, loc="outside lower center", ncols=columns, fontsize=9)


def magnitude(
    panel: Axes, frequency_hz: np.ndarray, h: np.ndarray, sd: np.ndarray | None = None,
    floor: float = 0.0, **style: Any,
) -> None:  # fmt: skip
    """|H| on a logarithmic axis, with a band of ± 2 sd cut off at the `floor`."""
    size = np.abs(h)
    if sd is not None:
        band = np.maximum(size - 2 * sd, floor), size + 2 * sd
        colour = style.get("color")
        panel.fill_between(frequency_hz, *band, color=colour, alpha=0.25, lw=0, label="± 2 sd")
    panel.semilogy(frequency_hz, size, **style)


def phase(
    panel: Axes, frequency_hz: np.ndarray, h: np.ndarray, sd: np.ndarray | None = None, **style: Any
) -> None:
    """Phase in ° without strokes from −180° to 180°; its band is the angle of 2 sd."""
    angle = np.angle(h, deg=True)
    if sd is not None:
        half = np.rad2deg(np.arcsin(np.minimum(2 * sd / np.maximum(np.abs(h), 1e-300), 1.0)))
        band = {"color": style.get("color"), "alpha": 0.25, "lw": 0}
        panel.fill_between(frequency_hz, angle - half, angle + half, **band)
    jumps = np.flatnonzero(np.abs(np.diff(angle)) > 180) + 1
    panel.plot(np.insert(frequency_hz, jumps, np.nan), np.insert(angle, jumps, np.nan), **style)
    panel.set(ylim=(-200, 200), yticks=(-180, 0, 180))


def spread(x: np.ndarray, gap: float, low: float, high: float) -> np.ndarray:
    """Increasing positions (k,) moved as little as it takes to lie `gap` apart in [low, high].

    Least squares: with the gaps taken off, the positions only must not decrease.
    """
    if not x.size:
        return x
    steps = gap * np.arange(x.size)
    level = isotonic_regression(x - steps).x
    return np.clip(level, low, max(low, high - steps[-1])) + steps


def label_modes(panel: Axes, modal: "ModalModel | MatrixModes | OperatingModes") -> None:
    """Modes as vertical lines, with frequency, damping and probability above the panel."""
    upright = len(modal.modes) > COLUMNS
    low, high = panel.get_xlim()
    gap = (high - low) / (max(40, len(modal.modes)) if upright else COLUMNS)
    frequency = np.array([mode.frequency_hz for mode in modal.modes])
    for k, (mode, x) in enumerate(zip(modal.modes, spread(frequency, gap, low, high), strict=True)):
        panel.axvline(mode.frequency_hz, color=MODE, lw=1.2, alpha=0.8)
        rows = (
            f"mode {k + 1}",
            f"{with_sd(mode.frequency_hz, mode.frequency_sd_hz, '.3f')} Hz",
            f"ζ {with_sd(100 * mode.damping_ratio, 100 * mode.damping_sd)} %",
            f"physical {100 * mode.probability:.0f} %",
        )
        panel.annotate(
            ("   " if upright else "\n").join(rows),
            xy=(mode.frequency_hz, 1.0),
            xycoords=panel.get_xaxis_transform(),
            xytext=(x, 1.06),
            textcoords=panel.get_xaxis_transform(),
            ha="center",
            va="bottom",
            rotation=90 if upright else 0,
            fontsize=7.5,
            color=MODE,
            arrowprops={"arrowstyle": "-", "color": MODE, "lw": 0.8, "relpos": (0.5, 0.0)},
        )


def number_modes(panel: Axes, modal: "ModalModel | MatrixModes | OperatingModes") -> None:
    """Modes as thin vertical lines, with their numbers inside at the top."""
    low, high = panel.get_xlim()
    frequency = np.array([mode.frequency_hz for mode in modal.modes])
    places = spread(frequency, 0.026 * (high - low), low, high)
    for k, (line, x) in enumerate(zip(frequency, places, strict=True)):
        panel.axvline(line, color=MODE, lw=0.8, ls=":")
        panel.text(
            x, 0.98, str(k + 1), transform=panel.get_xaxis_transform(),
            ha="center", va="top", fontsize=7, color=MODE, clip_on=True,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8},
        )  # fmt: skip


def mark_band(panel: Axes, frf: "Frf", response: int, hit: int) -> None:
    """The whole frequency axis of an FRF; shaded where it is coherent in the usable band."""
    panel.set_xlim(0, frf.frequency_hz[-1])
    for begins, ends in _trusted(frf, response, hit):
        panel.axvspan(begins, ends, color=USABLE, alpha=0.08, lw=0)
    panel.grid(True, alpha=0.25)
    panel.tick_params(labelsize=8)


def _trusted(frf: "Frf", response: int, hit: int) -> list[tuple[float, float]]:
    """Where (Hz, from and to) an FRF is coherent within the matrix' usable band.

    Where a single hit tells no coherence, the share of the signal in |H|² stands for it.
    """
    low, high = frf.usable_band_hz
    lines = np.flatnonzero((frf.frequency_hz >= low) & (frf.frequency_hz <= high))
    coherence = frf.coherence[response, hit, lines]
    if not np.any(np.isfinite(coherence)):
        power = np.abs(frf.accelerance[response, hit, lines]) ** 2
        coherence = power / (power + np.nan_to_num(frf.variance[response, hit, lines]))
    around = median_filter(np.nan_to_num(coherence), WINDOW, mode="nearest")
    hz, half = frf.frequency_hz[lines], (frf.frequency_hz[1] - frf.frequency_hz[0]) / 2
    good = np.ma.clump_masked(np.ma.masked_where(around >= COHERENT, hz))
    return [(max(hz[part.start] - half, low), min(hz[part.stop - 1] + half, high)) for part in good]


def label_ends(panel: Axes, values: np.ndarray, names: Sequence[str]) -> None:
    """Name of each curve of values (n, k) beside its last point, kept apart."""
    drawn = [k for k in range(values.shape[1]) if np.any(np.isfinite(values[:, k]))]
    last = np.array([values[np.isfinite(values[:, k]), k][-1] for k in drawn])
    order = np.argsort(last, kind="stable")
    low, high = panel.get_ylim()
    heights = spread(last[order], 0.035 * (high - low), low, high)
    for k, height in zip(np.array(drawn, int)[order], heights, strict=True):
        panel.annotate(
            names[k],
            xy=(1.0, height),
            xycoords=panel.get_yaxis_transform(),
            xytext=(5, 0),
            textcoords="offset points",
            va="center",
            fontsize=9,
            color=f"C{k % 10}",
        )
