"""Pictures of a modal analysis: stabilisation diagram, FRFs and their fit, coherence, AutoMAC."""

from collections.abc import Sequence
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
from planner.modal.modes import ModalModel
from planner.modal.operating import OperatingModes
from planner.modal.plscf import Diagram, stable
from planner.recording.records import FrfRecord
from planner.report import plot_marks as marks

SINGULAR = ("black", "0.4", "0.65")
STABLE = {"marker": "o", "color": "tab:green", "ms": 3.5, "ls": ""}
UNSTABLE = {"marker": "x", "color": "tab:orange", "ms": 3.5, "mew": 0.7, "ls": ""}
POINTS = {"color": marks.MEASURED, "lw": 0.6, "marker": ".", "ms": 2.5}
TONE = "tab:purple"
FITTED = {"color": marks.MODEL, "lw": 1.2}
# What singular values are of: decays' spectra have a size that means nothing.
FRFS, SPECTRA = "the FRF matrix (m/s²/N)", "the decays' spectra (equal rms)"


def modal_figures(
    frf: Frf | None, found: PoleIdentification, modal: ModalModel
) -> dict[str, Figure]:
    """Every picture of one pose by its name; without an FRF only those that need none."""
    singular = singular_values(found.data.response)
    what = f"singular values of {FRFS if frf is not None else SPECTRA}"
    hz, poles = found.data.frequency_hz, poles_by_stability(found.diagram, found.data.rate_1_s)
    figures = {
        "stabilisation": stabilisation_figure(
            hz, singular, modal, "Stabilisation diagram", what, poles
        )
    }
    if frf is not None:
        figures["frf"] = matrix_figure(frf, found, modal)
        figures["coherence"] = coherence_figure(frf, modal)
    figures["mac"] = auto_mac_figure(modal)
    return figures


def unlabelled_figures(record: FrfRecord, modal: ModalModel) -> dict[str, Figure]:
    """Of FRFs without places: how large all are together, and the AutoMAC."""
    lines = _inside(record.frequency_hz, modal.band_hz)
    size = np.linalg.norm(record.values[:, lines], axis=0)[None]
    what = "singular value of the FRFs (as in the file)"
    diagram = stabilisation_figure(record.frequency_hz[lines], size, modal, "CMIF", what)
    return {"cmif": diagram, "mac": auto_mac_figure(modal)}


def operating_figures(found: OperatingModes) -> dict[str, Figure]:
    """Of responses alone: the diagram over their power, and the AutoMAC."""
    lines = _inside(found.spectrum_hz, found.band_hz)
    diagram = stabilisation_figure(
        found.spectrum_hz[lines],
        singular_values(found.spectrum[..., lines])[: len(SINGULAR)],
        found,
        "Stabilisation diagram, responses alone (unscaled)",
        "cross power of the responses (each of unit variance)",
        poles_by_stability(found.diagram),
        "singular value",
    )
    return {"stabilisation": diagram, "mac": auto_mac_figure(found, "AutoMAC, unscaled")}


def _inside(hz: np.ndarray, band_hz: tuple[float, float]) -> np.ndarray:
    return (hz >= band_hz[0]) & (hz <= band_hz[1])


def singular_values(response: np.ndarray) -> np.ndarray:
    """(k, F), decreasing, of a matrix (r, c, F)."""
    return np.linalg.svd(np.moveaxis(response, -1, 0), compute_uv=False).T


def stabilisation_figure(
    frequency_hz: np.ndarray,
    singular: np.ndarray,
    modal: ModalModel | MatrixModes | OperatingModes,
    title: str,
    what: str,
    poles: tuple[np.ndarray, np.ndarray] | None = None,
    curve: str = "CMIF",
) -> Figure:
    """Poles of all model orders (right axis) over singular values (k, F) of responses (left).

    The singular values of the FRF matrix over frequency are the complex mode indicator function
    (CMIF; Shih et al., Mech. Syst. Signal Process. 2, 1988). `what` is their axis' label, `poles`
    are as of `poles_by_stability`. Tones among operating modes are marked.
    """
    figure, grid = marks.panels((12.0, 7.0 if len(modal.modes) <= marks.COLUMNS else 10.0), title)
    panel = grid[0, 0]
    for k, values in enumerate(singular):
        colour = SINGULAR[min(k, len(SINGULAR) - 1)]
        panel.semilogy(frequency_hz, values, color=colour, lw=1.1, label=f"{curve} {k + 1}")
    ends = frequency_hz[0], frequency_hz[-1]
    panel.set(xlim=ends, xlabel="frequency (Hz)", ylabel=what)
    panel.grid(True, alpha=0.25)
    for k, tone in enumerate(getattr(modal, "tones_hz", ())):
        panel.axvline(tone, color=TONE, ls="--", lw=1.0, label=None if k else "tone, no mode")
    handles: list[Any] = panel.get_legend_handles_labels()[0]
    if poles is not None:
        orders = panel.twinx()
        handles += orders.plot(*poles[0], **STABLE, label="stable pole")
        handles += orders.plot(*poles[1], **UNSTABLE, label="unstable pole")
        highest = max((p[1].max() for p in poles if p.size), default=0)
        orders.set(ylim=(0, highest + 1), ylabel="model order")
        orders.yaxis.set_major_locator(MaxNLocator(integer=True))
    marks.label_modes(panel, modal)
    handles += [Line2D([], [], color=marks.MODE, label="mode")]
    low, high = panel.get_xlim()
    beyond = [(a, b) for a, b in ((low, modal.band_hz[0]), (modal.band_hz[1], high)) if a < b]
    for ends in beyond:
        panel.axvspan(*ends, color="0.92", lw=0, zorder=0)
    handles += [Patch(color="0.92", label="outside the band")] if beyond else []
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=9)
    return figure


def poles_by_stability(diagram: Diagram, rate_1_s: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Frequency (Hz) and order, (2, k), of the poles on stable lines, and of all others.

    A pole is drawn where it would lie without the records' exponential window of that rate.
    """
    lines = stable(diagram)
    kept = {(int(o), complex(p)) for x in lines for o, p in zip(x.orders, x.poles, strict=True)}
    points: tuple[list, list] = ([], [])
    for entry in diagram.sets:
        for pole in entry.poles:
            frequency = abs(pole + rate_1_s) / (2 * np.pi)
            points[(entry.order, complex(pole)) not in kept].append((frequency, entry.order))
    stays, moves = (np.array(p, float).reshape(-1, 2).T for p in points)
    return stays, moves


def matrix_figure(frf: Frf, found: PoleIdentification, modal: ModalModel) -> Figure:
    """Magnitude and phase of every response to every hit axis, measured ± 2 sd, and the fit.

    The variance E|δH|² of a complex line is shared by its two parts, so that its magnitude has
    the standard deviation √(variance/2) and its phase that over |H|.
    """
    columns = np.flatnonzero(frf.measured).tolist()
    layout = {"height_ratios": [3, 1.2] * 3}
    figure, grid = marks.panels(
        (13.0, 10.0), "FRFs and their fit", 6, len(columns), gridspec_kw=layout
    )
    fitted = found.data.response - found.fit.error.reshape(found.data.response.shape)
    for i, k in np.ndindex(3, len(columns)):
        size, turn = grid[2 * i, k], grid[2 * i + 1, k]
        h, sd = frf.accelerance[i, columns[k]], np.sqrt(frf.variance[i, columns[k]] / 2)
        for panel in (size, turn):
            marks.mark_band(panel, frf, i, columns[k])
        _magnitude(size, frf, h, sd)
        marks.phase(turn, frf.frequency_hz, h, sd, **POINTS)
        size.plot(found.data.frequency_hz, np.abs(fitted[i, k]), **FITTED)
        marks.phase(turn, found.data.frequency_hz, fitted[i, k], **FITTED)
        size.set_title(_entry(i, columns[k]), fontsize=9, pad=3, loc="left")
        marks.number_modes(size, modal)
        if k == 0:
            size.set_ylabel("|H| (m/s²/N)", fontsize=8)
            turn.set_ylabel("phase (°)", fontsize=8)
    handles: list = [Line2D([], [], **POINTS, label="measured")]
    if np.any(np.isfinite(frf.variance)):
        handles.append(Patch(color=marks.MEASURED, alpha=0.25, label="± 2 sd"))
    _legend(figure, grid, [*handles, Line2D([], [], **FITTED, label="fit")])
    return figure


def _entry(response: int, hit: int) -> str:
    return f"response {marks.AXES[response]}, hit {marks.AXES[hit]}"


def _magnitude(panel: Axes, frf: Frf, h: np.ndarray, sd: np.ndarray) -> None:
    size = np.abs(h)
    usable = _inside(frf.frequency_hz, frf.usable_band_hz)
    seen = size[usable & np.isfinite(size) & (size > 0)]
    if not seen.size:
        panel.text(0.5, 0.5, "not measured", transform=panel.transAxes, ha="center")
        return
    floor = 0.5 * seen.min()
    marks.magnitude(panel, frf.frequency_hz, h, sd, 0.1 * floor, **POINTS)
    panel.set_ylim(floor, 6 * seen.max())  # room for the modes' numbers


def _legend(figure: Figure, grid: Any, handles: list) -> None:
    for panel in grid[-1]:
        panel.set_xlabel("frequency (Hz)", fontsize=9)
    handles = [
        *handles,
        Patch(color=marks.USABLE, alpha=0.15, label="coherent, in the usable band"),
        Line2D([], [], color=marks.MODE, ls=":", label="mode"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=9)


def coherence_figure(frf: Frf, modal: ModalModel) -> Figure:
    """Coherence of every response with every hit axis."""
    columns = np.flatnonzero(frf.measured).tolist()
    figure, grid = marks.panels((13.0, 7.5), "Coherence", 3, len(columns))
    for i, k in np.ndindex(3, len(columns)):
        panel, values = grid[i, k], frf.coherence[i, columns[k]]
        marks.mark_band(panel, frf, i, columns[k])
        if np.any(np.isfinite(values)):
            panel.plot(frf.frequency_hz, values, color=marks.MEASURED, lw=1.0)
        else:
            why = "unknown: it takes two hits" if frf.hits[columns[k]] < 2 else "unknown"
            panel.text(0.5, 0.5, why, transform=panel.transAxes, ha="center", fontsize=9)
        hits = frf.hits[columns[k]]
        # Room for the modes' numbers.
        panel.set(ylim=(0, 1.18), yticks=[0, 0.25, 0.5, 0.75, 1])
        panel.set_title(f"{_entry(i, columns[k])} ({hits} averaged)", fontsize=9, pad=3, loc="left")
        marks.number_modes(panel, modal)
        if k == 0:
            panel.set_ylabel("coherence", fontsize=9)
    _legend(figure, grid, [Line2D([], [], color=marks.MEASURED, label="coherence")])
    return figure


def auto_mac_figure(
    modal: ModalModel | MatrixModes | OperatingModes, title: str = "AutoMAC"
) -> Figure:
    """AutoMAC of the shapes."""
    shapes = np.array([mode.shape for mode in modal.modes])
    names = [f"{k + 1}: {mode.frequency_hz:.2f} Hz" for k, mode in enumerate(modal.modes)]
    figure = mac_figure(mac_matrix(shapes, shapes), names, names, title)
    note = f"Shapes of {shapes.shape[1]} coordinates: different modes can look alike in so few."
    figure.supxlabel(note, fontsize=7.5, color="0.35")
    return figure


def mac_figure(mac: np.ndarray, rows: Sequence[str], columns: Sequence[str], title: str) -> Figure:
    """MAC (k, l) of shapes with its values in the cells; white where nothing is known."""
    side = float(np.clip(0.6 * len(columns), 4.0, 14.0))
    figure, grid = marks.panels((side + 2.0, side + 1.2), title)
    panel = grid[0, 0]
    image = panel.imshow(mac, vmin=0, vmax=1, cmap="Blues")
    marks.write_values(panel, image, ".2f", fontsize=8)
    panel.set_xticks(range(len(columns)), columns, rotation=45, ha="right", rotation_mode="anchor")
    panel.set_yticks(range(len(rows)), rows)
    panel.tick_params(labelsize=8)
    figure.colorbar(image, ax=panel, label="MAC (1: same shape, 0: orthogonal)")
    return figure


def frequency_figure(
    poses: Sequence[str],
    modes: Sequence[str],
    frequency_hz: np.ndarray,
    sd_hz: np.ndarray,
    simulated_hz: np.ndarray | None = None,
    title: str = "",
) -> Figure:
    """Natural frequencies of k named modes over the poses, ± 2 sd, the simulated ones dashed.

    frequency_hz, sd_hz and simulated_hz (n, k), NaN where there is none (a gap).
    """
    figure, grid = marks.panels((11.0, 6.5), title)
    panel, x = grid[0, 0], np.arange(len(poses))
    for k in range(frequency_hz.shape[1]):
        colour = f"C{k % 10}"
        if simulated_hz is not None:
            style = {"color": colour, "lw": 1.0, "marker": "D", "ms": 3.5, "mfc": "none"}
            panel.plot(x, simulated_hz[:, k], "--", **style)
        error = np.where(np.isfinite(sd_hz[:, k]), 2 * sd_hz[:, k], 0.0)
        style = {"color": colour, "lw": 1.4, "marker": "o", "ms": 4, "capsize": 3}
        panel.errorbar(x, frequency_hz[:, k], error, **style)
    panel.set_xticks(x, map(marks.plain_text, poses), rotation=90 if len(poses) > 12 else 0)
    panel.set(xlabel="pose", ylabel="natural frequency (Hz)")
    panel.grid(True, alpha=0.25)
    marks.label_ends(panel, frequency_hz, modes)
    handles = [Line2D([], [], color="0.3", marker="o", label="measured, ± 2 sd")]
    if simulated_hz is not None:
        style: dict[str, Any] = {"color": "0.3", "ls": "--", "marker": "D", "mfc": "none"}
        handles.append(Line2D([], [], **style, label="simulation"))
    figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=9)
    return figure
