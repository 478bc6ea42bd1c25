"""A Rerun recording read back by columns."""

from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader


def columns_of(rrd: Path) -> dict[tuple[str, str], list[Any]]:
    """All values of a recording by entity and component."""
    reader, found = RrdReader(rrd), {}
    for chunk in reader.stream(store=reader.recordings()[0]):
        for name, values in chunk.to_record_batch().to_pydict().items():
            found.setdefault((str(chunk.entity_path), name), []).extend(values)
    return found


def of(found: dict[tuple[str, str], list[Any]], entity: str, part: str) -> list[Any]:
    """Of one entity, the component whose name has this part."""
    (values,) = [v for (path, name), v in found.items() if path == entity and part in name]
    return values
