"""Pictures of the modes of a matrix of FRFs: diagram, driving points, geometry, shapes, motion."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from planner.frf.matrix import FrfMatrix
from planner.modal.matrix_modes import MatrixModes
from planner.modal.modes import motions, moved
from planner.recording.uff import Geometry
from planner.report import modal_plots
from planner.report.pictures import SIMULATED_TITLE
from planner.report.plot_marks import MEASURED, MODEL, empty, magnitude, number_modes, panels

MOST_SHOWN = 24  # modes that have a panel of their own
AHEAD = "tab:red"
FRAMES, FRAME_MS = 24, 50  # of an animation
SIZE = (560, 420)  # of its frames, in pixels
TURN_DEG, RISE_DEG = -60.0, 28.0  # from where structures are seen


def matrix_figures(
    matrix: FrfMatrix, found: MatrixModes, geometry: Geometry | None
) -> dict[str, Figure]:
    """Every picture by its name."""
    data = found.found.data
    table = matrix.accelerance[..., np.isin(matrix.frequency_hz, data.frequency_hz)]
    singular = modal_plots.singular_values(np.where(np.isfinite(table), table, 0.0))[:4]
    poles = modal_plots.poles_by_stability(found.found.diagram, data.rate_1_s)
    figures = {
        "stabilisation": modal_plots.stabilisation_figure(
            data.frequency_hz, singular, found,
            f"Stabilisation diagram of {matrix.count} FRFs",
            f"singular values of {modal_plots.FRFS if matrix.scaled else modal_plots.SPECTRA}",
            poles,
        ),
        "mac": modal_plots.auto_mac_figure(found),
        "complexity": complexity_figure(found),
    }  # fmt: skip
    if matrix.driving:
        figures["driving_points"] = driving_figure(matrix, found)
    if geometry is not None:
        figures["geometry"] = geometry_figure(matrix, geometry)
        figures["shapes"] = shapes_figure(found, geometry)
    else:
        figures["shapes"] = bars_figure(found)
    return figures


def _grid(count: int, title: str, size: float, **options: Any) -> tuple[Figure, list[Any]]:
    """A figure of so many equal panels, side by side."""
    columns = min(count, int(np.ceil(np.sqrt(1.6 * count))))
    rows = -(-count // columns)
    figure = empty((size * columns + 0.6, size * rows + 0.9), title)
    return figure, [figure.add_subplot(rows, columns, k + 1, **options) for k in range(count)]


def _mode_by_mode(found: MatrixModes, title: str, size: float, **options: Any):
    """A figure with a panel of each mode, if they are not too many: its number, panel, and mode."""
    shown = found.modes[:MOST_SHOWN]
    figure, axes = _grid(len(shown), title, size, **options)
    return figure, list(zip(range(1, len(shown) + 1), axes, shown, strict=True))


def complexity_figure(found: MatrixModes) -> Figure:
    """Every shape's points in the complex plane: on one line where all move in phase."""
    figure, each = _mode_by_mode(found, "Mode shapes in the complex plane", 2.1)
    for k, panel, mode in each:
        shape = mode.shape / np.max(np.abs(mode.shape))
        zero = np.zeros(shape.size)
        panel.plot([zero, shape.real], [zero, shape.imag], color=MEASURED, lw=0.8, alpha=0.6)
        panel.plot(shape.real, shape.imag, ".", color=MODEL, ms=4)
        panel.set(xlim=(-1.1, 1.1), ylim=(-1.1, 1.1), aspect="equal", xticks=[], yticks=[])
        panel.axhline(0, color="0.8", lw=0.6, zorder=0)
        panel.axvline(0, color="0.8", lw=0.6, zorder=0)
        panel.set_title(
            f"{k}: {mode.frequency_hz:.4g} Hz\nMPC {mode.collinearity:.3f}, "
            f"MPD {mode.deviation_deg:.1f}°",
            fontsize=8,
        )
    return figure


def driving_figure(matrix: FrfMatrix, found: MatrixModes) -> Figure:
    """FRFs of points hit where they were felt, with the fit, and how right their sign is."""
    pairs = matrix.driving[:4]
    figure, grid = panels((12.0, 2.6 * len(pairs) + 1.2), "Driving points", len(pairs))
    data, (felt, hit) = found.found.data, found.found.data.places
    for panel, (o, i) in zip(grid[:, 0], pairs, strict=True):
        measured, (entry,) = matrix.accelerance[o, i], np.flatnonzero((felt == o) & (hit == i))
        fitted = data.values[entry] - found.found.fit.error[entry]
        magnitude(panel, matrix.frequency_hz, measured, color=MEASURED, lw=1.0, label="measured")
        magnitude(panel, data.frequency_hz, fitted, color=MODEL, lw=1.0, label="fit")
        panel.set_xlim(data.frequency_hz[0], data.frequency_hz[-1])
        panel.grid(True, alpha=0.25)
        panel.set_ylabel("|H| (m/s²/N)" if matrix.scaled else "|H|", fontsize=8)
        point = next(p for p in found.checks.driving if p.dof == matrix.references[i])
        panel.set_title(
            f"{point.dof}: Im H > 0 for {100 * point.positive:.0f} % of it, residues of the right "
            f"sign {100 * point.modes:.0f} %",
            fontsize=9, loc="left", pad=3,
        )  # fmt: skip
        number_modes(panel, found)
    grid[-1, 0].set_xlabel("frequency (Hz)")
    grid[0, 0].legend(fontsize=8, loc="lower right")
    return figure


def geometry_figure(matrix: FrfMatrix, geometry: Geometry) -> Figure:
    """Points with their numbers and lines; those hit and felt are marked."""
    figure, (panel,) = _grid(1, "Points", 8.0, projection="3d")
    _draw_lines(panel, geometry, geometry.position_m, "0.7")
    felt = {dof.node for dof in matrix.responses}
    hit = {dof.node for dof in matrix.references}
    hammer = len(felt) < len(hit)  # roved, and not a sensor
    roved, stayed = (hit, felt) if hammer else (felt, hit)
    for group, style in ((roved, {"marker": ".", "color": MEASURED}),
                         (stayed, {"marker": "^", "color": AHEAD, "s": 60})):  # fmt: skip
        at = np.array([p for n, p in zip(geometry.nodes, geometry.position_m, strict=True)
                       if n in group])  # fmt: skip
        if at.size:
            panel.scatter(*at.T, **style)
    if len(geometry.nodes) <= 150:
        for node, place in zip(geometry.nodes, geometry.position_m, strict=True):
            panel.text(*place, f" {node}", fontsize=6.5)
    handles = [
        Line2D([], [], marker=".", ls="", color=MEASURED, label="hit" if hammer else "felt"),
        Line2D([], [], marker="^", ls="", color=AHEAD, label="felt" if hammer else "hit"),
    ]
    panel.legend(handles=handles, fontsize=8)
    # With its axes, a flat structure in a cube would be small and the cube cut off.
    extent = _extent(geometry.position_m)
    # At a longest side of 0.69, in units of the zoom, its axes' labels stay in the picture.
    zoom = 0.69 * float(np.linalg.norm(extent) / np.max(extent))
    _finish(panel, geometry.position_m, zoom)
    panel.locator_params(nbins=6)
    panel.set_xlabel("x (m)", labelpad=10)
    panel.set_ylabel("y (m)", labelpad=10)
    panel.set_zlabel("z (m)")
    return figure


def _draw_lines(panel: Any, geometry: Geometry, position: np.ndarray, colour: str) -> None:
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    index = {node: k for k, node in enumerate(geometry.nodes)}
    ends = [(position[index[a]], position[index[b]]) for a, b in geometry.lines]
    if ends:
        panel.add_collection3d(Line3DCollection(ends, colors=colour, lw=0.9))


def _extent(points: np.ndarray) -> np.ndarray:
    """(3,) of points (n, 3), and not flat: its least part is 0.3 of its largest."""
    extent = np.ptp(points, axis=0)
    return np.maximum(extent, 0.3 * np.max(extent))


def _finish(panel: Any, points: np.ndarray, zoom: float) -> None:
    """Equal scales on all axes, which show points (n, 3)."""
    middle, extent = (points.max(axis=0) + points.min(axis=0)) / 2, _extent(points)
    half = 0.52 * np.maximum(extent, 1e-9)
    limits = zip(("xlim", "ylim", "zlim"), np.stack([middle - half, middle + half], 1), strict=True)
    panel.set(**dict(limits))
    panel.set_box_aspect(half / np.max(half), zoom=zoom)
    panel.view_init(elev=RISE_DEG, azim=TURN_DEG)


def _fill(panel: Any, points: np.ndarray) -> None:
    """Zoom so that points (n, 3) fill 0.92 of the panel, and none of them is cut off."""
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    for _ in range(2):  # perspective: what is nearer grows a little faster
        x, y, _ = proj_transform(points[:, 0], points[:, 1], points[:, 2], panel.get_proj())
        place = (panel.transData - panel.transAxes).transform(np.column_stack([x, y]))
        reach = 2 * np.max(np.abs(place - 0.5))
        panel.set_box_aspect(panel._box_aspect, zoom=0.92 / max(reach, 1e-9))


def shapes_figure(found: MatrixModes, geometry: Geometry) -> Figure:
    """Every shape at its largest motion, coloured by it, beside the structure at rest."""
    figure, each = _mode_by_mode(found, "Mode shapes", 3.0, projection="3d")
    for k, panel, mode in each:
        motion = motions(found.dofs, mode.shape, geometry)
        _draw_lines(panel, geometry, geometry.position_m, "0.85")
        place = moved(geometry, motion, 0.0)
        _draw_lines(panel, geometry, place, "0.4")
        size = np.linalg.norm(np.real(motion), axis=1)
        panel.scatter(*place.T, c=size, cmap="plasma", s=9, depthshade=False)
        panel.set_title(f"{k}: {mode.frequency_hz:.4g} Hz", fontsize=9, pad=0)
        drawn = np.concatenate([geometry.position_m, place])
        _finish(panel, drawn, 1.0)
        _fill(panel, drawn)
        panel.set_axis_off()
    return figure


def bars_figure(found: MatrixModes) -> Figure:
    """Real parts of all shapes with 2 sd over the degrees of freedom, where no place is known."""
    figure, each = _mode_by_mode(found, "Mode shapes", 2.6)
    names = [str(dof) for dof in found.dofs]
    for k, panel, mode in each:
        x = np.arange(len(names))
        style = {"fmt": ".", "ms": 3, "lw": 0.8, "color": MEASURED}
        sd = None if mode.shape_sd is None else 2 * mode.shape_sd
        panel.errorbar(x, np.real(mode.shape), sd, **style)
        panel.axhline(0, color="0.7", lw=0.6)
        step = max(1, len(names) // 6)
        panel.set_xticks(x[::step], names[::step], rotation=90, fontsize=6)
        panel.tick_params(axis="y", labelsize=6)
        panel.set_title(f"{k}: {mode.frequency_hz:.4g} Hz", fontsize=8)
    return figure


def animate(
    found: MatrixModes, geometry: Geometry, folder: Path, simulated: bool = False
) -> list[Path]:
    """One GIF for every mode, whose title says what is simulated; their paths."""
    files, mark = [], f"{SIMULATED_TITLE} · " if simulated else ""
    for k, mode in enumerate(found.modes):
        file = folder / f"mode_{k + 1:02d}.gif"
        title = (
            f"{mark}mode {k + 1}: {mode.frequency_hz:.4g} Hz,"
            f" damping {100 * mode.damping_ratio:.2f} %"
        )
        _gif(geometry, motions(found.dofs, mode.shape, geometry), title, file)
        files.append(file)
    return files


def _gif(geometry: Geometry, motion: np.ndarray, title: str, file: Path) -> None:
    phases = 2 * np.pi * np.arange(FRAMES) / FRAMES
    rest = _seen(geometry.position_m)
    paths = [_seen(moved(geometry, motion, phase)) for phase in phases]
    every = np.concatenate([rest, *paths])
    low, high = every.min(axis=0), every.max(axis=0)
    # Room for the title above and a margin around.
    room = np.array([SIZE[0] - 40, SIZE[1] - 60])
    scale = float(np.min(room / np.maximum(high - low, 1e-12)))
    middle = (low + high) / 2

    def on_screen(points: np.ndarray) -> np.ndarray:
        at = (points - middle) * scale
        return np.stack([SIZE[0] / 2 + at[:, 0], SIZE[1] / 2 + 15 - at[:, 1]], axis=1)

    sizes = (np.linalg.norm(np.real(motion * np.exp(1j * phase)), axis=1) for phase in phases)
    frames = [
        _frame(geometry, on_screen(rest), on_screen(path), size, title)
        for path, size in zip(paths, sizes, strict=True)
    ]
    frames[0].save(file, save_all=True, append_images=frames[1:], duration=FRAME_MS, loop=0)


def _seen(position: np.ndarray) -> np.ndarray:
    """(n, 2) parallel projection: to the right and up."""
    turn, rise = np.deg2rad([TURN_DEG, RISE_DEG])
    right = np.array([-np.sin(turn), np.cos(turn), 0.0])
    up = np.array([-np.sin(rise) * np.cos(turn), -np.sin(rise) * np.sin(turn), np.cos(rise)])
    return position @ np.stack([right, up], axis=1)


def _frame(geometry: Geometry, rest: np.ndarray, points: np.ndarray, size: np.ndarray, title: str):
    from PIL import Image, ImageDraw

    image = Image.new("P", SIZE, 0)
    image.putpalette(_palette())
    pen = ImageDraw.Draw(image)
    index = {node: k for k, node in enumerate(geometry.nodes)}
    for places, still in ((rest, True), (points, False)):
        for a, b in geometry.lines:
            i, j = index[a], index[b]
            colour = 1 if still else _colour((size[i] + size[j]) / 2)
            pen.line([*places[i], *places[j]], fill=colour, width=1 if still else 2)
    for (x, y), amount in zip(points, size, strict=True):
        pen.ellipse([x - 3, y - 3, x + 3, y + 3], fill=_colour(amount))
    pen.text((12, 10), title, fill=2)
    return image


def _colour(size: float) -> int:
    """Entry of the palette for a motion in [0, 1]."""
    return 3 + int(np.clip(size, 0, 1) * 252)


def _palette() -> list[int]:
    """White, grey, black, then blue over purple to orange as motion grows."""
    stops = np.array([[40, 60, 180], [160, 40, 150], [240, 90, 60], [250, 170, 30]])
    x = np.linspace(0, 1, 253)
    colours = np.stack([np.interp(x, np.linspace(0, 1, 4), stops[:, c]) for c in range(3)], axis=1)
    return [255, 255, 255, 205, 205, 205, 0, 0, 0, *colours.astype(int).ravel().tolist()]
