"""TDMS files as LabVIEW writes them: unit_string, wf_increment."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from planner.errors import InputError
from planner.recording.entries import check_size
from planner.recording.named_columns import Named, to_records
from planner.recording.records import Record

SAME_RATE = 1e-6  # relative: steps of one clock, as they are rounded in a file


def read_tdms(path: Path) -> tuple[Record, ...]:
    """TDMS files; unit and increment as LabVIEW writes them (unit_string, wf_increment).

    Raises InputError where two groups hold the same channels (each is a hit of its own), and where
    channels were not sampled together.
    """
    with _warnings() as warned:
        try:
            named = _named(path)
        except InputError:
            raise
        except Exception as error:  # the library raises whatever the junk makes it raise
            raise InputError(
                f"{path} is not a readable TDMS file ({type(error).__name__}); export it again."
            ) from None
    if warned:
        raise InputError(f"{path} is cut off ({warned[0]}); export it again.")
    return to_records(path, named)


def _named(path: Path) -> Named:
    from nptdms import TdmsFile

    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    where: dict[str, str] = {}
    with TdmsFile.open(path) as file:
        attributes = {str(k): str(v) for k, v in file.properties.items()}
        groups = file.groups()
        channels = [channel for group in groups for channel in group.channels()]
        for group in groups:
            attributes |= {str(k): str(v) for k, v in group.properties.items()}
        check_size(path, sum(8 * len(channel) for channel in channels))
        for channel in channels:
            name = channel.name
            if name in columns:
                raise InputError(
                    f"{path} holds {name} twice, in {where[name]} and in {channel.group_name}; "
                    f"export each hit into a file of its own."
                )
            columns[name] = np.asarray(channel[:], dtype=float)
            where[name] = channel.group_name
            if channel.properties.get("unit_string"):
                units[name] = str(channel.properties["unit_string"])
    step = _common(path, {c.name: c.properties.get("wf_increment") for c in channels}, SAME_RATE)
    if step:
        attributes.setdefault("sampling_rate_hz", repr(1 / step))
        _common(path, {c.name: c.properties.get("wf_start_offset", 0) for c in channels}, 0, step)
    return Named(columns, units, attributes)


def _common(path: Path, stated: dict[str, Any], relative: float, step: float = 0.0) -> float | None:
    """What channels state alike, None where none does; InputError where they contradict."""
    given = {name: float(value) for name, value in stated.items() if value}
    if step:
        given = {name: float(value or 0.0) for name, value in stated.items()}
    if not given:
        return None
    (first, value), *others = given.items()
    for name, other in others:
        if not abs(other - value) <= relative * abs(value) + step / 2:
            what = f"begin {abs(other - value):.3g} s apart" if step else "have different rates"
            raise InputError(
                f"{path}: channels {first} and {name} {what}; export channels that were sampled "
                f"together."
            )
    return value


@contextmanager
def _warnings() -> Iterator[list[str]]:
    """What the library warns of: a file that is cut off, of which it then gives what there is."""
    kept = _Kept()
    logger = logging.getLogger("nptdms")
    logger.addHandler(kept)
    for name in list(logging.root.manager.loggerDict):
        if name.startswith("nptdms"):
            for handler in logging.getLogger(name).handlers:
                handler.setLevel(logging.WARNING if handler is kept else logging.CRITICAL)
    try:
        yield kept.texts
    finally:
        logger.removeHandler(kept)


class _Kept(logging.Handler):
    """Keeps what a library warns of."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.texts.append(record.getMessage())
