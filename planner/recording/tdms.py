"""TDMS files as LabVIEW and DAQ programs write them: unit_string, wf_increment, wf_start_time."""

import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from logging.handlers import BufferingHandler
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.errors import InputError
from planner.recording.entries import EntryTree, check_size, tree_of
from planner.recording.entry_records import records_of
from planner.recording.records import Record

if TYPE_CHECKING:
    import nptdms


def read_tdms(path: Path) -> tuple[Record, ...]:
    """TDMS files; groups that are a hit each are a record each, texts and settings are left out.

    Raises InputError where it is damaged, and where channels were not sampled together.
    """
    with _warnings() as warned:
        root = _root(path)
    if warned:
        raise InputError(f"{path} is cut off ({warned[0].getMessage()}); export it again.")
    return records_of(path, root)


def _root(path: Path) -> EntryTree:
    from nptdms import TdmsFile

    with open(path, "rb") as opened, TdmsFile.open(opened, raw_timestamps=True) as file:
        groups = file.groups()
        check_size(path, sum(8 * len(c) for group in groups for c in group.channels()))
        found = {
            group.name: tree_of(
                {channel.name: _channel(channel) for channel in group.channels()},
                _stated(group.properties),
            )
            for group in groups
        }
        return tree_of(found, _stated(file.properties))


def _channel(channel: "nptdms.TdmsChannel") -> EntryTree:
    """A channel's numbers with its properties; dates are times in s. What is neither is empty."""
    values: Any = channel[:]
    if isinstance(values, np.ndarray) and values.dtype.names and values.size:
        seconds = (values["seconds"] - values["seconds"][0]).astype(float)
        return EntryTree({"unit": "s"}, {"": seconds + values["second_fractions"] / 2.0**64})
    if np.asarray(values).dtype.kind not in "fiubc":
        return EntryTree()
    return tree_of({"": np.asarray(values)}, _stated(channel.properties))


def _stated(properties: Mapping[str, Any]) -> dict[str, object]:
    """Properties with dates as NumPy has them."""
    return {
        name: value.as_datetime64("ns") if hasattr(value, "as_datetime64") else value
        for name, value in properties.items()
    }


@contextmanager
def _warnings() -> Iterator[list[logging.LogRecord]]:
    """What the library warns of: a file that is cut off, of which it then gives what there is."""
    kept = BufferingHandler(1000)
    kept.setLevel(logging.WARNING)
    logger = logging.getLogger("nptdms")
    logger.addHandler(kept)
    for name in list(logging.root.manager.loggerDict):
        if name.startswith("nptdms"):
            for handler in logging.getLogger(name).handlers:
                handler.setLevel(logging.WARNING if handler is kept else logging.CRITICAL)
    try:
        yield kept.buffer
    finally:
        logger.removeHandler(kept)
