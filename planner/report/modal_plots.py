"""Pictures of a modal analysis: stabilisation diagram, FRFs and their fit, coherence, AutoMAC."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from planner.frf.frf import Frf
from planner.modal.estimate_modes import PoleIdentification
from planner.modal.mac import mac_matrix
from planner.modal.matrix_modes import MatrixModes
from planner.modal.matrix_poles import MatrixPoles
from planner.modal.mode_selection import model
from planner.modal.modes import ModalModel
from planner.modal.operating import OperatingModes
from planner.modal.stabilisation import stable
from planner.report.frf_plots import AXES, MEASURED, MODEL
from planner.report.plot_marks import (
    COLUMNS,
    MODE,
    USABLE,
    label_ends,
    label_modes,
    mark_band,
    number_modes,
    panels,
)
from planner.report.plot_text import plain_text, write_values

SINGULAR = ("black", "0.4", "0.65")
STABLE = {"marker": "o", "color": "tab:green", "ms": 3.5, "ls": ""}
UNSTABLE = {"marker": "x", "color": "tab:orange", "ms": 3.5, "mew": 0.7, "ls": ""}
SPREAD = {"color": "0.6", "alpha": 0.6, "lw": 0}
POINTS = {"color": MEASURED, "lw": 0.6, "marker": ".", "ms": 2.5}
TONE = "tab:purple"
FITTED = {"color": MODEL, "lw": 1.2}


def modal_figures(
    frf: Frf | None, found: PoleIdentification, modal: ModalModel, name: str, simulated: bool
) -> dict[str, Figure]:
    """Every picture of one pose by its name; without an FRF only those that need none."""
    mark = "SIMULATED recordings · " if simulated else ""
    end = f" · {name}"
    figures = {
        "stabilisation": stabilisation_figure(
            found, modal, f"{mark}Stabilisation diagram{end}", scaled=frf is not None
        )
    }
    if frf is not None:
        figures["frf"] = matrix_figure(frf, found, modal, f"{mark}FRFs and their fit{end}")
        figures["coherence"] = coherence_figure(frf, modal, f"{mark}Coherence{end}")
    figures["mac"] = mac_figure(modal, f"{mark}AutoMAC{end}")
    return figures


def stabilisation_figure(
    found: PoleIdentification | MatrixPoles,
    modal: ModalModel | MatrixModes,
    title: str = "",
    scaled: bool = True,
    singular: np.ndarray | None = None,
) -> Figure:
    """Poles of all model orders (right axis) over the singular values of the responses (left).

    The singular values of the FRF matrix over frequency are the complex mode indicator function
    (CMIF; Shih et al., Mech. Syst. Signal Process. 2, 1988). `scaled` is False where the
    responses are spectra of free decays, whose size means nothing, or not in SI units. `singular`
    (k, F), decreasing, where it is known already.
    """
    figure, grid = panels((12.0, 7.0 if len(modal.modes) <= COLUMNS else 10.0), title)
    panel, data = grid[0, 0], found.data
    if singular is None:
        singular = np.linalg.svd(np.moveaxis(data.response, -1, 0), compute_uv=False).T
    for k, values in enumerate(singular):
        colour = SINGULAR[min(k, len(SINGULAR) - 1)]
        panel.semilogy(data.frequency_hz, values, color=colour, lw=1.1, label=f"CMIF {k + 1}")
    panel.set_xlim(data.frequency_hz[0], data.frequency_hz[-1])
    panel.set_xlabel("frequency (Hz)")
    kind = "the FRF matrix (m/s²/N)" if scaled else "the decays' spectra (equal rms)"
    panel.set_ylabel(f"singular values of {kind}")
    panel.grid(True, alpha=0.25)
    orders = panel.twinx()
    stays, moves = poles_by_stability(found)
    orders.plot(*moves, **UNSTABLE, label="unstable pole")
    orders.plot(*stays, **STABLE, label="stable pole")
    orders.set_ylim(0, found.order + 1)
    orders.set_ylabel("model order")
    orders.yaxis.set_major_locator(MaxNLocator(integer=True))
    label_modes(panel, modal)
    handles: list[Any] = [*panel.get_lines()[: len(singular)], *orders.get_lines()]
    handles.append(Line2D([], [], color=MODE, label="mode"))
    for beyond in (
        (panel.get_xlim()[0], modal.band_hz[0]),
        (modal.band_hz[1], panel.get_xlim()[1]),
    ):
        if beyond[0] < beyond[1]:
            panel.axvspan(*beyond, color="0.92", lw=0, zorder=0)
    handles.append(Patch(color="0.92", label="outside the band"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=9)
    return figure


def operating_figure(found: OperatingModes, title: str = "") -> Figure:
    """Poles of all orders over the singular values of the responses' cross spectra."""
    figure, grid = panels((12.0, 7.0 if len(found.modes) <= COLUMNS else 10.0), title)
    panel = grid[0, 0]
    values = np.linalg.svd(np.moveaxis(found.spectrum, -1, 0), compute_uv=False).T
    inside = (found.spectrum_hz >= found.band_hz[0]) & (found.spectrum_hz <= found.band_hz[1])
    for k, one in enumerate(values[: len(SINGULAR)]):
        label = f"singular value {k + 1}"
        panel.semilogy(found.spectrum_hz[inside], one[inside], color=SINGULAR[k], label=label)
    panel.set_xlim(*found.band_hz)
    panel.set_xlabel("frequency (Hz)")
    panel.set_ylabel("cross power of the responses (each of unit variance)")
    orders = panel.twinx()
    kept = {complex(p) for line in stable(found.diagram) for p in line.poles}
    for is_stable, style, label in ((False, UNSTABLE, "unstable"), (True, STABLE, "stable")):
        points = [
            (abs(pole) / (2 * np.pi), entry.order)
            for entry in found.diagram.sets
            for pole in entry.poles
            if (complex(pole) in kept) == is_stable
        ]
        x, y = np.array(points, float).reshape(-1, 2).T
        orders.plot(x, y, **style, label=f"{label} pole")
    orders.set_ylabel("model order")
    for k, tone in enumerate(found.tones_hz):
        panel.axvline(tone, color=TONE, ls="--", lw=1.0, label=None if k else "tone, no mode")
    label_modes(panel, found)
    handles = [*panel.get_legend_handles_labels()[0], *orders.get_legend_handles_labels()[0]]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=8)
    return figure


def cmif_figure(
    frequency_hz: np.ndarray, values: np.ndarray, modal: ModalModel, title: str = ""
) -> Figure:
    """CMIF of FRFs (k, F) of one hit point, of unknown scale, with the modes found."""
    figure, grid = panels((14.0, 7.0 if len(modal.modes) <= COLUMNS else 10.0), title)
    panel = grid[0, 0]
    low, high = modal.band_hz
    lines = (frequency_hz >= low) & (frequency_hz <= high)
    panel.semilogy(frequency_hz[lines], np.linalg.norm(values[:, lines], axis=0), color="black")
    panel.set_xlim(low, high)
    panel.set_xlabel("frequency (Hz)")
    panel.set_ylabel("singular value of the FRFs (as in the file)")
    panel.grid(True, alpha=0.25)
    label_modes(panel, modal)
    return figure


def poles_by_stability(found: PoleIdentification | MatrixPoles) -> tuple[np.ndarray, np.ndarray]:
    """Frequency (Hz) and order, (2, k), of the poles on stable lines, and of all others."""
    lines = stable(found.diagram)
    kept = {(int(o), complex(p)) for x in lines for o, p in zip(x.orders, x.poles, strict=True)}
    points: tuple[list, list] = ([], [])
    for entry in found.diagram.sets:
        for pole in entry.poles:
            # The line of a pole is where it would lie without the records' exponential window.
            frequency = abs(pole + found.data.rate_1_s) / (2 * np.pi)
            points[(entry.order, complex(pole)) not in kept].append((frequency, entry.order))
    stays, moves = (np.array(p, float).reshape(-1, 2).T for p in points)
    return stays, moves


def matrix_figure(
    frf: Frf, found: PoleIdentification, modal: ModalModel, title: str = ""
) -> Figure:
    """Magnitude and phase of every response to every hit axis, measured ± 2 sd, and the fit.

    The variance E|δH|² of a complex line is shared by its two parts, so that its magnitude has
    the standard deviation √(variance/2) and its phase that over |H|.
    """
    columns = np.flatnonzero(frf.measured).tolist()
    layout = {"height_ratios": [3, 1.2] * 3}
    figure, grid = panels((13.0, 10.0), title, 6, len(columns), gridspec_kw=layout)
    fitted = model(found.data, found.fit.refined)
    for i, k in np.ndindex(3, len(columns)):
        size, phase = grid[2 * i, k], grid[2 * i + 1, k]
        h, sd = frf.accelerance[i, columns[k]], np.sqrt(frf.variance[i, columns[k]] / 2)
        for panel in (size, phase):
            mark_band(panel, frf, i, columns[k])
        _magnitude(size, frf, h, sd)
        _phase(phase, frf.frequency_hz, h, sd)
        size.plot(found.data.frequency_hz, np.abs(fitted[i, k]), **FITTED)
        _wrapped(phase, found.data.frequency_hz, fitted[i, k], **FITTED)
        size.set_title(_entry(i, columns[k]), fontsize=9, pad=3, loc="left")
        number_modes(size, modal)
        if k == 0:
            size.set_ylabel("|H| (m/s²/N)", fontsize=8)
            phase.set_ylabel("phase (°)", fontsize=8)
    handles: list = [Line2D([], [], **POINTS, label="measured")]
    if np.any(np.isfinite(frf.variance)):
        handles.append(Patch(**SPREAD, label="± 2 sd"))
    _legend(figure, grid, [*handles, Line2D([], [], **FITTED, label="fit")])
    return figure


def _entry(response: int, hit: int) -> str:
    return f"response {AXES[response]}, hit {AXES[hit]}"


def _magnitude(panel: Axes, frf: Frf, h: np.ndarray, sd: np.ndarray) -> None:
    size = np.abs(h)
    low, high = frf.usable_band_hz
    inside = (frf.frequency_hz >= low) & (frf.frequency_hz <= high)
    seen = size[inside & np.isfinite(size) & (size > 0)]
    if not seen.size:
        panel.text(0.5, 0.5, "not measured", transform=panel.transAxes, ha="center")
        return
    floor = 0.5 * seen.min()
    below = np.maximum(size - 2 * sd, 0.1 * floor)
    panel.fill_between(frf.frequency_hz, below, size + 2 * sd, **SPREAD)
    panel.semilogy(frf.frequency_hz, size, **POINTS)
    panel.set_ylim(floor, 6 * seen.max())  # room for the modes' numbers


def _phase(panel: Axes, frequency_hz: np.ndarray, h: np.ndarray, sd: np.ndarray) -> None:
    angle = np.angle(h, deg=True)
    error = np.rad2deg(np.minimum(2 * sd / np.maximum(np.abs(h), 1e-300), np.pi))
    panel.fill_between(frequency_hz, angle - error, angle + error, **SPREAD)
    _wrapped(panel, frequency_hz, h, **POINTS)
    panel.set_ylim(-200, 200)
    panel.set_yticks([-180, 0, 180])


def _wrapped(panel: Axes, frequency_hz: np.ndarray, h: np.ndarray, **style: Any) -> None:
    """Phase without strokes from −180° to 180°."""
    angle = np.angle(h, deg=True)
    jumps = np.flatnonzero(np.abs(np.diff(angle)) > 180) + 1
    panel.plot(np.insert(frequency_hz, jumps, np.nan), np.insert(angle, jumps, np.nan), **style)


def _legend(figure: Figure, grid: Any, handles: list) -> None:
    for panel in grid[-1]:
        panel.set_xlabel("frequency (Hz)", fontsize=9)
    handles = [
        *handles,
        Patch(color=USABLE, alpha=0.15, label="coherent, in the usable band"),
        Line2D([], [], color=MODE, ls=":", label="mode"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=9)


def coherence_figure(frf: Frf, modal: ModalModel, title: str = "") -> Figure:
    """Coherence of every response with every hit axis."""
    columns = np.flatnonzero(frf.measured).tolist()
    figure, grid = panels((13.0, 7.5), title, 3, len(columns))
    for i, k in np.ndindex(3, len(columns)):
        panel, values = grid[i, k], frf.coherence[i, columns[k]]
        mark_band(panel, frf, i, columns[k])
        if np.any(np.isfinite(values)):
            panel.plot(frf.frequency_hz, values, color=MEASURED, lw=1.0)
        else:
            why = "unknown: it takes two hits" if frf.hits[columns[k]] < 2 else "unknown"
            panel.text(0.5, 0.5, why, transform=panel.transAxes, ha="center", fontsize=9)
        hits = frf.hits[columns[k]]
        panel.set_ylim(0, 1.18)  # room for the modes' numbers
        panel.set_yticks([0, 0.25, 0.5, 0.75, 1])
        panel.set_title(f"{_entry(i, columns[k])} ({hits} averaged)", fontsize=9, pad=3, loc="left")
        number_modes(panel, modal)
        if k == 0:
            panel.set_ylabel("coherence", fontsize=9)
    _legend(figure, grid, [Line2D([], [], color=MEASURED, label="coherence")])
    return figure


def mac_figure(modal: ModalModel | MatrixModes | OperatingModes, title: str = "") -> Figure:
    """AutoMAC of the shapes, with its values in the cells."""
    count = len(modal.modes)
    side = float(np.clip(0.6 * count, 4.0, 14.0))
    figure, grid = panels((side + 2.0, side + 1.2), title.replace(" · ", "\n"))
    shapes = np.array([mode.shape for mode in modal.modes])
    values, panel = mac_matrix(shapes, shapes), grid[0, 0]
    image = panel.imshow(values, vmin=0, vmax=1, cmap="Blues")
    write_values(panel, image, ".2f", fontsize=8)
    names = [f"{k + 1}: {mode.frequency_hz:.2f} Hz" for k, mode in enumerate(modal.modes)]
    panel.set_xticks(range(count), names, rotation=45, ha="right", rotation_mode="anchor")
    panel.set_yticks(range(count), names)
    panel.tick_params(labelsize=8)
    figure.colorbar(image, ax=panel, label="MAC (1: same shape, 0: orthogonal)")
    note = f"Shapes of {shapes.shape[1]} coordinates: different modes can look alike in so few."
    figure.supxlabel(note, fontsize=7.5, color="0.35")
    return figure


def frequency_figure(
    place: tuple[str, ...] | np.ndarray,
    frequency_hz: np.ndarray,
    sd_hz: np.ndarray,
    simulated_hz: np.ndarray | None = None,
    axis: str = "pose",
    title: str = "",
) -> Figure:
    """Natural frequencies of labelled modes over the poses, ± 2 sd, the simulated ones dashed.

    place: names of the poses in their order, or a coordinate (n,) of theirs that `axis` names
    with its unit; frequency_hz, sd_hz and simulated_hz (n, k), NaN where there is none (a gap).
    """
    named = len(place) > 0 and isinstance(place[0], str)
    x = np.arange(len(place), dtype=float) if named else np.asarray(place, float)
    order = np.argsort(x, kind="stable")
    figure, grid = panels((11.0, 6.5), title)
    panel = grid[0, 0]
    for k in range(frequency_hz.shape[1]):
        colour = f"C{k % 10}"
        if simulated_hz is not None:
            style = {"color": colour, "lw": 1.0, "marker": "D", "ms": 3.5, "mfc": "none"}
            panel.plot(x[order], simulated_hz[order, k], "--", **style)
        error = np.where(np.isfinite(sd_hz[order, k]), 2 * sd_hz[order, k], 0.0)
        style = {"color": colour, "lw": 1.4, "marker": "o", "ms": 4, "capsize": 3}
        panel.errorbar(x[order], frequency_hz[order, k], error, **style)
    if named:
        panel.set_xticks(x, [plain_text(p) for p in place], rotation=90 if len(place) > 12 else 0)
    panel.set_xlabel(axis)
    panel.set_ylabel("natural frequency (Hz)")
    panel.grid(True, alpha=0.25)
    names = [f"mode {k + 1}" for k in range(frequency_hz.shape[1])]
    label_ends(panel, frequency_hz[order], names)
    handles = [Line2D([], [], color="0.3", marker="o", label="measured, ± 2 sd")]
    if simulated_hz is not None:
        handles.append(
            Line2D([], [], color="0.3", ls="--", marker="D", mfc="none", label="simulation")
        )
    figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=9)
    return figure
