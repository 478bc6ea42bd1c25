"""Mode shapes as motions of points in space, and their animation as GIF."""

from pathlib import Path

import numpy as np

from planner.modal.matrix_modes import MatrixModes
from planner.modal.modes import motions, moved
from planner.recording.geometry import Geometry
from planner.report.pictures import SIMULATED_TITLE

FRAMES, FRAME_MS = 24, 50
SIZE = (560, 420)
TURN_DEG, RISE_DEG = -60.0, 28.0  # from where the structure is seen


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
