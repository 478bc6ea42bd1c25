"""WAV files of recorders: samples alone; what they stand for is said in channels.csv beside them.

A copy of a WAV file that is kept elsewhere carries its rows of that table in a chunk of its own,
which other programs skip.
"""

import csv
import io
import math
import struct
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np

from planner.errors import InputError
from planner.recording.entry_columns import check_size
from planner.recording.folder import CHANNELS, TableRow, read_table
from planner.recording.named_columns import Named, to_records
from planner.recording.records import Record

WAV = ".wav"
CHUNK = b"plnr"  # of a kept copy: its rows of channels.csv
EXAMPLE = '"channel,name,unit,full_scale", "1,force,N,2200" and "2,acceleration x,m/s^2,98.1"'


class Scaled(NamedTuple):
    """A row of the table: a channel (from 1) of a file, and what full scale stands for.

    `hit` and `hit_point`, which it need not have, are what it says of the file.
    """

    channel: int
    name: str
    unit: str
    full_scale: float
    hit: str
    hit_point: str


def read_wav(path: Path) -> tuple[Record, ...]:
    """Time histories in units; channels of which channels.csv says nothing are left out.

    Raises InputError saying what the table misses, or how the file has to be exported.
    """
    data = path.read_bytes()
    scales = _scales(path, data)
    rate_hz, samples = _samples(path, data)
    columns, units = {}, {}
    for one in scales:
        if one.channel > samples.shape[1]:
            raise InputError(
                f"{path} has {samples.shape[1]} channels, {CHANNELS} speaks of channel "
                f"{one.channel}; correct the table."
            )
        columns[one.name] = samples[:, one.channel - 1] * one.full_scale
        units[one.name] = one.unit
    attributes = {"sampling_rate_hz": str(rate_hz)}
    for key in ("hit", "hit_point"):
        said = sorted({getattr(one, key) for one in scales} - {""})
        if len(said) > 1:
            raise InputError(
                f"{CHANNELS} says for {path} that {key} is {' and '.join(said)}; leave one."
            )
        attributes |= {key: said[0]} if said else {}
    return to_records(path, Named(columns, units, attributes))


def scales_beside(path: Path) -> Path:
    """The table that belongs to a WAV file."""
    return path.with_name(CHANNELS)


def self_contained(path: Path, data: bytes) -> bytes:
    """The bytes of a WAV file with its rows of the table; as they are where they have them.

    Raises InputError where the table is missing or wrong.
    """
    if CHUNK in _chunks(data) or not _whole(data):
        return data
    rows = io.StringIO(newline="")
    csv.writer(rows, lineterminator="\n").writerows([Scaled._fields, *_scales(path, data)])
    text = rows.getvalue().encode()
    text += b"\n" * (len(text) % 2)
    data = _stated(data)
    data = data + bytes(len(data) % 2) + CHUNK + struct.pack("<I", len(text)) + text
    return data[:4] + struct.pack("<I", len(data) - 8) + data[8:]


def _stated(data: bytes) -> bytes:
    """The bytes of a file as far as it says that it goes."""
    return data[: 8 + struct.unpack("<I", data[4:8])[0]] if len(data) > 8 else data


def _chunks(data: bytes) -> dict[bytes, slice]:
    """Where the content of each chunk is, as it is stated."""
    found, at = {}, 12
    while data[:4] == b"RIFF" and at + 8 <= len(_stated(data)):
        size = struct.unpack("<I", data[at + 4 : at + 8])[0]
        found[data[at : at + 4]] = slice(at + 8, at + 8 + size)
        at += 8 + size + size % 2
    return found


def _whole(data: bytes) -> bool:
    """Whether all chunks are there as long as they are stated to be."""
    end, stated = max((part.stop for part in _chunks(data).values()), default=0), len(_stated(data))
    within = end > 0 and stated - 1 <= end <= stated
    return within and stated == 8 + struct.unpack("<I", data[4:8])[0]


def _samples(path: Path, data: bytes) -> tuple[int, np.ndarray]:
    """Rate in Hz and samples (n, channels) as shares of full scale."""
    from scipy.io import wavfile

    how = "export WAV of 16, 24 or 32 bits or of floating-point numbers again"
    if data[:4] != b"RIFF":
        raise InputError(f"{path} is no WAV file (it does not begin with RIFF); {how}.")
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            rate_hz, found = wavfile.read(io.BytesIO(data))
    except Exception as error:  # the library raises whatever the junk makes it raise
        said = str(error) if isinstance(error, ValueError) else type(error).__name__
        raise InputError(f"{path} is no readable WAV file ({said}); {how}.") from None
    if not _whole(data) or any("EOF" in str(w.message) for w in warned):
        raise InputError(f"{path} is cut off; {how}.")
    samples = found[:, None] if found.ndim == 1 else found
    check_size(path, 8 * samples.size)
    if samples.dtype.kind == "f":
        return rate_hz, samples.astype(float)
    if samples.dtype not in (np.int16, np.int32):  # 24 bits come as the upper ones of 32
        raise InputError(f"{path} holds samples of {8 * samples.dtype.itemsize} bits; {how}.")
    return rate_hz, samples / -float(np.iinfo(samples.dtype).min)


def _scales(path: Path, data: bytes) -> list[Scaled]:
    """What the table says of a file's channels; in a kept copy it is in the file."""
    table = scales_beside(path)
    own = _chunks(data).get(CHUNK)
    if own is not None:
        header, rows = read_table(path, data[own].decode("utf-8", "replace"))
    elif table.is_file():
        header, rows = read_table(table)
    else:
        raise InputError(
            f"{path} says nothing of scale and units: write them into {table}, such as the lines "
            f"{EXAMPLE}: full_scale is what the largest sample stands for, in that unit."
        )
    header = [name.lower() for name in header]
    missing = [name for name in Scaled._fields[:4] if name not in header]
    if missing:
        raise InputError(f"{table} has no column {missing[0]}; its lines are such as {EXAMPLE}.")
    rows = [TableRow(table, row.number, dict(zip(header, row.cells.values(), strict=True)))
            for row in rows]  # fmt: skip
    own_rows = [_scaled(row) for row in rows if row.cell("file") in ("", path.name)]
    for key in ("channel", "name"):
        each = [getattr(one, key) for one in own_rows]
        twice = next((value for value in each if each.count(value) > 1), None)
        if twice is not None:
            raise InputError(f"{table} has {key} {twice} twice for {path.name}; correct it.")
    if not own_rows:
        raise InputError(f"{table} has no row for {path.name}; its lines are such as {EXAMPLE}.")
    return own_rows


def _scaled(row: TableRow) -> Scaled:
    try:
        channel, full_scale = int(row.cell("channel")), float(row.cell("full_scale"))
    except ValueError:
        channel, full_scale = 0, math.nan
    name, unit, hit, hit_point = map(row.cell, ("name", "unit", "hit", "hit_point"))
    if channel < 1 or not 0 < full_scale < math.inf or not name or not unit:
        raise row.wrong(
            f"channel {row.cell('channel') or '?'} needs a number from 1, a name, a unit and a "
            f"full_scale above 0; its lines are such as {EXAMPLE}."
        )
    return Scaled(channel, name, unit, full_scale, hit, hit_point)
