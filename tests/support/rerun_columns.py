"""A Rerun recording read back: by columns; what is drawn in which frame, and where that is when."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation

SHAPES = ("Points3D", "Boxes3D", "Arrows3D", "Capsules3D", "Cylinders3D", "Ellipsoids3D", "Asset3D")
WORLD = "tf#/"


def rows_of(rrd: Path | str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Each row of a recording: its entity, and values by column, the row's own number first."""
    reader = RrdReader(rrd)
    for chunk in reader.stream(store=reader.recordings()[0]):
        for row in chunk.to_record_batch().to_pylist():
            yield str(chunk.entity_path), row


def entities_of(rrd: Path | str) -> set[str]:
    """Entities that draw something."""
    return {entity for entity, _ in rows_of(rrd)}


def columns_of(rrd: Path) -> dict[tuple[str, str], list[Any]]:
    """All values of a recording by entity and component."""
    found: dict[tuple[str, str], list[Any]] = {}
    for entity, row in rows_of(rrd):
        for name, value in row.items():
            found.setdefault((entity, name), []).append(value)
    return found


def lines_of(rrd: Path) -> dict[str, list[np.ndarray]]:
    """The lines (parts of (n, 2)) drawn last at each entity; of figures the image is the frame."""
    found = columns_of(rrd)
    images = {entity for entity, name in found if "blob" in name.lower()}
    assert all(entity.endswith("/frame") for entity in images)
    return {
        entity: [np.array(strip) for strip in values[-1] or ()]
        for (entity, name), values in found.items()
        if name == "LineStrips2D:strips"
    }


class Frames:
    """Follows Rerun's rules: an entity lies in the frame that it names, else in one of its path.

    Frames of paths hang below each other; any other pair is tied by a Transform3D that names both.
    """

    def __init__(self, rrd: Path | str):
        self.shapes: dict[str, dict] = {}  # entity: components, the last of each
        self._frame_of: dict[str, str] = {}
        self._ties: dict[str, list[tuple[float, str, np.ndarray]]] = {}
        for entity, row in rows_of(rrd):
            self._read(entity, row)

    def _read(self, entity: str, row: dict) -> None:
        drawn = {name: value for name, value in row.items() if name.startswith(SHAPES)}
        if drawn:
            self.shapes[entity] = self.shapes.get(entity, {}) | drawn
        if row.get("CoordinateFrame:frame"):
            self._frame_of[entity] = row["CoordinateFrame:frame"][0]
        if row.get("Transform3D:child_frame"):
            time = row.get("measurement")
            time = -np.inf if time is None else time
            parent = row["Transform3D:parent_frame"][0]
            tie = (time, parent, _matrix(row))
            self._ties.setdefault(row["Transform3D:child_frame"][0], []).append(tie)

    def frame(self, entity: str) -> str:
        """The frame in which an entity lies."""
        return self._frame_of.get(entity, "tf#" + entity)

    def root(self, frame: str) -> str:
        """The end of the chain of frames above one."""
        above = self._above(frame, np.inf)
        return frame if above is None else self.root(above[0])

    def placement(self, frame: str, time: float) -> np.ndarray:
        """Homogeneous transform (4, 4) of a frame in the root of its chain, at a measurement."""
        above = self._above(frame, time)
        return np.eye(4) if above is None else self.placement(above[0], time) @ above[1]

    def _above(self, frame: str, time: float) -> tuple[str, np.ndarray] | None:
        ties = [tie for tie in self._ties.get(frame, []) if tie[0] <= time]
        if ties:
            return max(ties, key=lambda tie: tie[0])[1:]
        if frame.startswith("tf#/") and frame != WORLD:
            parent = frame.rpartition("/")[0]
            return (WORLD if parent == "tf#" else parent), np.eye(4)
        return None


def _matrix(row: dict) -> np.ndarray:
    matrix = np.eye(4)
    if row.get("Transform3D:quaternion"):
        matrix[:3, :3] = rotation(row["Transform3D:quaternion"][0])
    matrix[:3, 3] = row["Transform3D:translation"][0]
    return matrix


def rotation(xyzw: list[float]) -> np.ndarray:
    """Rotation matrix (3, 3) of a quaternion (x, y, z, w)."""
    return Rotation.from_quat(xyzw).as_matrix()
