"""What every reader's records are held against: numbers that an instrument can have given."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.recording.records import FrfRecord, Record, TimeRecord

# Chosen: far beyond any hammer, accelerometer or FRF in SI, and far from where squares overflow.
LARGEST = 1e15
SLOWEST_HZ, FASTEST_HZ = 1e-3, 1e9  # sampling rates; slower or faster is a wrong unit


def check(path: Path, records: Sequence[Record]) -> None:
    """Raise InputError saying what of the records of a file no instrument can have given."""
    for record in records:
        if isinstance(record, TimeRecord):
            _check_times(path, record)
        else:
            _check_frfs(path, record)


def check_numbers(path: Path, name: str, values: np.ndarray) -> None:
    """Raise InputError where one of `values` (n,) is not finite or absurdly large."""
    sane = np.abs(values) < LARGEST  # NaN is not
    if not np.all(sane):
        at = int(np.argmin(sane))
        fault = "is not a finite number"
        if np.isfinite(values[at]):
            fault = f"is {abs(values[at]):.3g}, which no instrument gives"
        raise InputError(f"{path}: {name}, sample {at + 1} {fault}; export it again.")


def _check_times(path: Path, record: TimeRecord) -> None:
    rate = record.sampling_rate_hz
    if not SLOWEST_HZ <= rate <= FASTEST_HZ:
        raise InputError(
            f"{path} was sampled at {rate:.4g} Hz as it says; correct the time's unit or step."
        )
    for channel in record.channels:
        check_numbers(path, channel.name, channel.samples)


def _check_frfs(path: Path, record: FrfRecord) -> None:
    lines, values = record.frequency_hz, record.values
    if lines.ndim != 1 or len(lines) < 2 or values.ndim != 2 or values.shape[1] != len(lines):
        raise InputError(
            f"{path} holds FRFs of shape {values.shape} over {lines.size} frequency lines; export "
            f"FRFs and their frequencies together."
        )
    check_numbers(path, "frequency", lines)
    if lines[0] < 0 or not np.all(np.diff(lines) > 0):
        raise InputError(f"{path}: the FRFs' frequency lines do not rise; export them in order.")
    for number, row in enumerate(values, 1):
        check_numbers(path, f"FRF {number}", row)
    if record.coherence.shape != values.shape:
        raise InputError(f"{path}: coherence and FRFs differ in length; export them together.")
