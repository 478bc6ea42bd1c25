"""Modes of a matrix of FRFs as a Rerun recording: poles, driving points, MAC, shapes in motion."""

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from matplotlib import colormaps

from planner.frf.matrix import FrfMatrix
from planner.modal.matrix_modes import MatrixModes
from planner.recording.geometry import Geometry
from planner.report.rerun_chart import (
    BRIGHT,
    GROUND,
    Chart,
    ChartAxis,
    ChartBand,
    Curve,
    chart_view,
    draw,
    log_range,
)
from planner.report.rerun_modal import (
    BAND,
    FIT,
    WIDE,
    WIDER,
    draw_auto_mac,
    draw_stabilisation,
    mac_view,
    mode_lines,
    mode_names,
)
from planner.report.rerun_stream import open_stream
from planner.report.shape_motion import FRAMES, motions, moved

MOST_SHOWN, MOST_DRIVEN = 12, 4  # modes, driving points with a view of their own
TIMELINE = "vibration"
REST = (110, 114, 118)


def record_matrix(
    matrix: FrfMatrix, found: MatrixModes, geometry: Geometry | None, name: str, rrd: Path
) -> None:
    """Write the recording. InputError if it cannot be written."""
    shown, driven = found.modes[:MOST_SHOWN], matrix.driving[:MOST_DRIVEN]
    stream = open_stream(f"modes|{name}", name, _blueprint(found, len(driven), geometry), rrd)
    mark = "SIMULATED recordings · " if matrix.simulated else ""
    said = (
        "On the timeline shapes move, exaggerated; grey: at rest."
        if geometry
        else ("Shapes over the degrees of freedom as they are listed: real parts, with ± 2 sd.")
    )
    note = f"# {name}\n{mark}Modes are blue; white is measured, red the fit. {said}"
    stream.log("note", rr.TextDocument(note, media_type="text/markdown"), static=True)
    title = f"{mark}stable and unstable poles of {matrix.count} FRFs, order upwards"
    draw_stabilisation(
        stream, found.found, found, _largest(matrix, found), " (m/s²/N)" * matrix.scaled, title
    )
    for number, (o, i) in enumerate(driven):
        draw(stream, f"modes/driving/{number}", _driven(matrix, found, o, i))
    names = mode_names(found.modes, ".4g")
    draw_auto_mac(stream, "modes/mac", found.modes, names, "shapes of {} degrees of freedom")
    for k, mode in enumerate(shown):
        if geometry is None:
            draw(stream, f"modes/shape/{k + 1}", _listed(names[k], mode.shape, mode.shape_sd))
        else:
            _moving(
                stream, f"modes/shape/{k + 1}", geometry, motions(found.dofs, mode.shape, geometry)
            )
    stream.flush(timeout_sec=10.0)
    stream.disconnect()


def _blueprint(found: MatrixModes, driven: int, geometry: Geometry | None) -> rrb.Blueprint:
    tabs: list[rrb.View | rrb.Container] = [
        chart_view("modes/stabilisation", "Stabilisation diagram", WIDE)
    ]
    if driven:
        charts = [chart_view(f"modes/driving/{k}", f"driving point {k + 1}", WIDER)
                  for k in range(driven)]  # fmt: skip
        tabs.append(rrb.Vertical(*charts, name="Driving points"))
    shapes = []
    for k, mode in enumerate(found.modes[:MOST_SHOWN], 1):
        path, title = f"modes/shape/{k}", f"{k}: {mode.frequency_hz:.4g} Hz"
        view = rrb.Spatial3DView(origin=f"/{path}", name=title, background=GROUND)
        shapes.append(chart_view(path, title, WIDE) if geometry is None else view)
    tabs.append(rrb.Grid(*shapes, name="Mode shapes"))
    tabs.append(mac_view("modes/mac", "AutoMAC", len(found.modes)))
    tabs.append(rrb.TextDocumentView(origin="/note", name="What is what"))
    hidden = rrb.TimePanel(state="hidden")
    moves = rrb.TimePanel(
        state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="all", fps=FRAMES
    )
    return rrb.Blueprint(rrb.Tabs(*tabs), moves if geometry else hidden, collapse_panels=True)


def _largest(matrix: FrfMatrix, found: MatrixModes) -> np.ndarray:
    """(F,) largest singular value of the matrix at each line that was fitted."""
    lines = np.isin(matrix.frequency_hz, found.found.data.frequency_hz)
    table = np.nan_to_num(matrix.accelerance[..., lines])
    return np.linalg.svd(np.moveaxis(table, -1, 0), compute_uv=False)[:, 0]


def _driven(matrix: FrfMatrix, found: MatrixModes, o: int, i: int) -> Chart:
    poles = found.found
    places = zip(poles.rows.tolist(), poles.columns.tolist(), strict=True)
    entry = list(places).index((o, i))
    size, fitted = np.abs(matrix.accelerance[o, i]), np.abs(poles.fit.fitted[entry])
    hz = poles.data.frequency_hz
    inside = (matrix.frequency_hz >= hz[0]) & (matrix.frequency_hz <= hz[-1])
    y = ChartAxis(*log_range([size[inside], fitted]), "|H|" + " (m/s²/N)" * matrix.scaled, log=True)
    dof = matrix.references[i]
    point = next(p for p in found.checks.driving if p.dof == dof)
    return Chart(
        f"{dof}: Im H > 0 for {100 * point.positive:.0f} %, residues of the right sign "
        f"{100 * point.modes:.0f} %",
        ChartAxis(float(hz[0]), float(hz[-1]), "frequency (Hz)"), y,
        (mode_lines(found, y.low, y.high),
         Curve("measured", matrix.frequency_hz[inside], size[inside], BRIGHT),
         Curve("fit", hz, fitted, FIT)), wide=WIDER,
    )  # fmt: skip


def _listed(title: str, shape: np.ndarray, sd: np.ndarray) -> Chart:
    """Real parts over the degrees of freedom in order."""
    x, real = np.arange(1, len(shape) + 1), shape.real
    known = np.nan_to_num(sd)
    top = 1.1 * float(np.max(np.abs(real) + 2 * known)) or 1.0
    return Chart(
        title, ChartAxis(0.0, len(shape) + 1.0, "degree of freedom"),
        ChartAxis(-top, top, "real part"), (Curve("shape", x, real, FIT, dots=True),),
        (ChartBand("± 2 sd", x, real - 2 * known, real + 2 * known, BAND, width=0.5),), WIDE,
    )  # fmt: skip


def _moving(stream: rr.RecordingStream, path: str, geometry: Geometry, motion: np.ndarray) -> None:
    """Points and lines through one vibration, coloured by how far they move."""
    index = {node: k for k, node in enumerate(geometry.nodes)}
    ends = np.array([(index[a], index[b]) for a, b in geometry.lines], int).reshape(-1, 2)
    rest = geometry.position_m
    span = float(np.linalg.norm(np.ptp(rest, axis=0))) or 1.0
    radius = 0.004 * span
    stream.log(
        f"{path}/rest", rr.LineStrips3D(rest[ends], colors=REST, radii=radius / 4), static=True
    )
    for frame in range(FRAMES):
        phase = 2 * np.pi * frame / FRAMES
        stream.set_time(TIMELINE, sequence=frame)
        place = moved(geometry, motion, phase)
        size = np.linalg.norm(np.real(motion * np.exp(1j * phase)), axis=1)
        colours = (255 * colormaps["plasma"](size)[:, :3]).astype(np.uint8)
        stream.log(f"{path}/points", rr.Points3D(place, colors=colours, radii=radius))
        between = (255 * colormaps["plasma"](size[ends].mean(axis=1))[:, :3]).astype(np.uint8)
        stream.log(f"{path}/lines", rr.LineStrips3D(place[ends], colors=between, radii=radius / 2))
    stream.reset_time()
