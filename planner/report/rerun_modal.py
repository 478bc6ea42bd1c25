"""A modal analysis as a Rerun recording: poles of all orders, FRFs with their fit, MAC."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from planner.frf.frf import Frf
from planner.modal.estimate_modes import PoleIdentification
from planner.modal.mac import mac_matrix
from planner.modal.matrix_modes import MatrixModes
from planner.modal.matrix_poles import MatrixPoles
from planner.modal.mode_selection import model
from planner.modal.modes import ModalModel, Mode
from planner.report.frf_plots import AXES
from planner.report.modal_plots import poles_by_stability
from planner.report.plot_text import ink
from planner.report.rerun_chart import (
    BRIGHT,
    GREY,
    GROUND,
    Chart,
    ChartAxis,
    ChartBand,
    Curve,
    chart_view,
    draw,
    log_range,
    write,
)
from planner.report.rerun_stream import open_stream

FIT, BAND, MODE = (255, 120, 100), (70, 74, 80), (90, 190, 255)
STABLE, UNSTABLE = (110, 220, 110), (240, 160, 60)
RESPONSES = ((255, 110, 110), (120, 220, 120), (110, 160, 255))
MOST_VALUES, WORTH_A_VALUE = 8, 0.1  # modes of whose MAC all values are written; of more, which
# Cells of shapes that are alike, and of different ones: bright words are read on both.
ALIKE, DIFFERENT = np.array([28, 100, 180]), np.array([32, 34, 38])
WIDE, WIDER = 2.0, 5.0  # times the height; where charts lie one above the other


def record_modes(
    frf: Frf | None, found: PoleIdentification, modal: ModalModel, name: str, simulated: bool,
    rrd: Path,
) -> None:  # fmt: skip
    """Write the recording; without an FRF what needs none. InputError if it cannot be written."""
    columns = [] if frf is None else np.flatnonzero(frf.measured).tolist()
    stream = open_stream(f"modes|{name}", name, _blueprint(columns, len(modal.modes)), rrd)
    mark = "SIMULATED recordings · " if simulated else ""
    note = f"# {name}\n{mark}Modes are blue; white is measured, with ± 2 sd; red the fit."
    stream.log("note", rr.TextDocument(note, media_type="text/markdown"), static=True)
    singular = np.linalg.svd(np.moveaxis(found.data.response, -1, 0), compute_uv=False)[:, 0]
    unit = " (m/s²/N)" if frf is not None else ""
    title = f"{mark}stable and unstable poles, order upwards"
    draw_stabilisation(stream, found, modal, singular, unit, title)
    if frf is not None:
        fitted = model(found.data, found.fit.refined)
        for k, column in enumerate(columns):
            for i in range(3):
                _frf(stream, frf, found.data.frequency_hz, fitted[i, k], modal, i, column)
            _coherence(stream, frf, modal, column)
    about = "shapes of {} coordinates: different modes can look alike"
    draw_auto_mac(stream, "modes/mac", modal.modes, mode_names(modal.modes), about)
    stream.flush(timeout_sec=10.0)
    stream.disconnect()


def mode_names(modes: Sequence[Mode], digits: str = ".2f") -> list[str]:
    """Number and frequency of each mode."""
    return [f"{k + 1}: {mode.frequency_hz:{digits}} Hz" for k, mode in enumerate(modes)]


def draw_auto_mac(
    stream: rr.RecordingStream, path: str, modes: Sequence[Mode], names: list[str], about: str
) -> None:
    """Log how alike modes are to each other; `about` says of what shapes are, {} of how many."""
    shapes = np.array([mode.shape for mode in modes])
    note = f"AutoMAC, {about.format(shapes.shape[-1])}"
    numbers = [name.partition(":")[0] for name in names]  # whole names are beside the rows
    draw_mac(stream, path, mac_matrix(shapes, shapes), names, numbers, note)


def draw_mac(
    stream: rr.RecordingStream, path: str, mac: np.ndarray, rows: list[str], columns: list[str],
    note: str,
) -> None:  # fmt: skip
    """Log a MAC matrix (k, l) as cells with values and names; black where nothing is known.

    Rerun's own view of a tensor has neither names along its sides nor numbers in its cells. Of many
    modes only values that say something have theirs.
    """
    share = np.nan_to_num(mac)[..., None]
    cells = np.round(share * ALIKE + (1 - share) * DIFFERENT).astype(np.uint8)
    cells[~np.isfinite(mac)] = 0
    stream.log(f"{path}/cells", rr.Image(cells))
    inside = [
        (at, value) for at, value in np.ndenumerate(mac)
        if np.isfinite(value) and (len(mac) <= MOST_VALUES or value > WORTH_A_VALUE)
    ]  # fmt: skip
    words = [(f"{value:.2f}", (j + 0.5, k + 0.42)) for (k, j), value in inside]
    inks = [(0, 0, 0) if ink(cells[k, j] / 255) == "black" else BRIGHT for (k, j), _ in inside]
    words += [(name, (-0.45, k + 0.42)) for k, name in enumerate(rows)]
    words += [(name, (j + 0.5, -0.3)) for j, name in enumerate(columns)]
    words.append((note, (mac.shape[1] / 2, mac.shape[0] + 0.1)))
    write(stream, f"{path}/words", words, inks + [BRIGHT] * (len(rows) + len(columns)) + [GREY])


def mac_view(path: str, name: str, count: int) -> rrb.Spatial2DView:
    """The view of a MAC matrix of so many modes with all its words in sight."""
    bounds = rrb.VisualBounds2D(x_range=[-0.9, count + 0.2], y_range=[-0.6, count + 0.4])
    return rrb.Spatial2DView(origin=f"/{path}", name=name, background=GROUND, visual_bounds=bounds)


def _blueprint(columns: list[int], modes: int) -> rrb.Blueprint:
    tabs: list[rrb.View | rrb.Container] = [
        chart_view("modes/stabilisation", "Stabilisation diagram", WIDE)
    ]
    if columns:
        frfs = [
            chart_view(f"modes/frf/{AXES[i]}{AXES[k]}", f"response {AXES[i]}, hit {AXES[k]}", WIDE)
            for i in range(3) for k in columns
        ]  # fmt: skip
        tabs.append(rrb.Grid(*frfs, grid_columns=len(columns), name="FRFs and their fit"))
        coherence = [
            chart_view(f"modes/coherence/{AXES[k]}", f"hit {AXES[k]}", WIDER) for k in columns
        ]
        tabs.append(rrb.Vertical(*coherence, name="Coherence"))
    tabs.append(mac_view("modes/mac", "AutoMAC", modes))
    tabs.append(rrb.TextDocumentView(origin="/note", name="What is what"))
    return rrb.Blueprint(rrb.Tabs(*tabs), rrb.TimePanel(state="hidden"), collapse_panels=True)


def mode_lines(modal: ModalModel | MatrixModes, bottom: float, top: float) -> Curve:
    """All modes as lines from bottom to top of a chart over frequency."""
    hz = np.array([mode.frequency_hz for mode in modal.modes])
    ends = np.tile([bottom, top, np.nan], len(hz))
    return Curve("mode", np.repeat(hz, 3), ends, MODE, thick=0.5)


def draw_stabilisation(
    stream: rr.RecordingStream, found: PoleIdentification | MatrixPoles,
    modal: ModalModel | MatrixModes, singular: np.ndarray, unit: str, title: str,
) -> None:  # fmt: skip
    """Poles of all orders over the largest singular value (F,) of the responses (CMIF)."""
    hz = found.data.frequency_hz
    y = ChartAxis(*log_range([singular]), f"CMIF{unit}", log=True)
    stable, unstable = poles_by_stability(found)
    orders = max((float(p[1].max()) for p in (stable, unstable) if p.size), default=1.0)
    clouds = [
        Curve(name, p[0], y.low * (y.high / y.low) ** (p[1] / (1.05 * orders)), colour, True, 0.7)
        for name, p, colour in (("unstable", unstable, UNSTABLE), ("stable", stable, STABLE))
    ]
    draw(stream, "modes/stabilisation", Chart(
        title, ChartAxis(float(hz[0]), float(hz[-1]), "frequency (Hz)"), y,
        (mode_lines(modal, y.low, y.high), Curve("CMIF", hz, singular, BRIGHT), *clouds), wide=WIDE,
    ))  # fmt: skip


def _frf(
    stream: rr.RecordingStream, frf: Frf, fitted_hz: np.ndarray, fitted: np.ndarray,
    modal: ModalModel, response: int, hit: int,
) -> None:  # fmt: skip
    low, high = float(fitted_hz[0]), float(fitted_hz[-1])
    inside = (frf.frequency_hz >= low) & (frf.frequency_hz <= high)
    hz, size = frf.frequency_hz[inside], np.abs(frf.accelerance[response, hit, inside])
    sd = np.sqrt(frf.variance[response, hit, inside] / 2)  # of a magnitude
    y = ChartAxis(*log_range([size, np.abs(fitted)]), "|H| (m/s²/N)", log=True)
    band = ChartBand("± 2 sd", hz, np.maximum(size - 2 * sd, 0.0), size + 2 * sd, BAND)
    draw(stream, f"modes/frf/{AXES[response]}{AXES[hit]}", Chart(
        f"response {AXES[response]}, hit {AXES[hit]} ({frf.hits[hit]} averaged)",
        ChartAxis(low, high, "frequency (Hz)"), y,
        (mode_lines(modal, y.low, y.high), Curve("measured", hz, size, BRIGHT),
         Curve("fit", fitted_hz, np.abs(fitted), FIT)), (band,), WIDE,
    ))  # fmt: skip


def _coherence(stream: rr.RecordingStream, frf: Frf, modal: ModalModel, hit: int) -> None:
    known = bool(np.any(np.isfinite(frf.coherence[:, hit])))
    curves = [
        Curve(f"response {AXES[i]}", frf.frequency_hz, frf.coherence[i, hit], RESPONSES[i])
        for i in range(3)
    ]
    title = f"hit {AXES[hit]}" if known else f"hit {AXES[hit]}: not known, it takes two hits"
    draw(stream, f"modes/coherence/{AXES[hit]}", Chart(
        title, ChartAxis(0.0, float(frf.frequency_hz[-1]), "frequency (Hz)"),
        ChartAxis(0.0, 1.05, "coherence"), (mode_lines(modal, 0.0, 1.0), *curves), wide=WIDER,
    ))  # fmt: skip
