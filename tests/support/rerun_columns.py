"""A Rerun recording read back by columns."""

from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import RrdReader


def entities_of(rrd: Path | str) -> set[str]:
    """Entities that draw something."""
    reader = RrdReader(rrd)
    return {str(chunk.entity_path) for chunk in reader.stream(store=reader.recordings()[0])}


def columns_of(rrd: Path) -> dict[tuple[str, str], list[Any]]:
    """All values of a recording by entity and component."""
    reader, found = RrdReader(rrd), {}
    for chunk in reader.stream(store=reader.recordings()[0]):
        for name, values in chunk.to_record_batch().to_pydict().items():
            found.setdefault((str(chunk.entity_path), name), []).extend(values)
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
