"""MAT files of version 5 (MATLAB 5 to 7.2): arrays of numbers and text, by name.

Read here because SciPy's reader trusts the lengths that a file states: where a byte is damaged it
reads beyond its buffers, which ends the process without a word. Layout: "MAT-File Format", The
MathWorks, level 5.
"""

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.recording.entries import LARGEST_BYTES, check_size

HEADER = 128
COMPRESSED, MATRIX = 15, 14  # types of elements
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8",
           13: "u8"}  # types of numbers  # fmt: skip
TEXTS = {16: "utf-8", 17: "utf-16", 18: "utf-32", 4: "utf-16", 2: "latin-1"}  # types of characters
CHARACTERS, NUMERIC = 4, range(6, 16)  # classes of arrays that are read: no cells, no structs
COMPLEX = 0x0800  # flag of an array
MOST_DIMENSIONS = 32


def is_version_5(path: Path) -> bool:
    """Whether a file says that it is a MAT file of version 5."""
    with open(path, "rb") as file:
        head = file.read(HEADER)
    little = head[126:128] == b"IM"
    return len(head) == HEADER and head[126:128] in (b"IM", b"MI") and head[124 + little] == 1


def read_mat5(path: Path) -> dict[str, object]:
    """Arrays, of dimensions as in the file, and texts by name; InputError where it is damaged."""
    data = path.read_bytes()
    order = "<" if data[126:128] == b"IM" else ">"
    try:
        return dict(found for body in _bodies(path, data, order) if (found := _array(body, order)))
    except (struct.error, zlib.error, ValueError, MemoryError):
        raise InputError(f"{path} is not a whole MAT file; export it again.") from None


def _bodies(path: Path, data: bytes, order: str) -> Iterator[bytes]:
    """What stands in each of the file's arrays, unfolded."""
    at, unfolded = HEADER, 0
    while at < len(data):
        kind, size = struct.unpack_from(order + "II", data, at)
        body = _exactly(data, at + 8, size)
        at += 8 + size
        if kind == COMPRESSED:
            inner = zlib.decompressobj().decompress(body, LARGEST_BYTES - unfolded + 1)
            unfolded += len(inner)
            check_size(path, unfolded)
            kind, size = struct.unpack_from(order + "II", inner)
            body = _exactly(inner, 8, size)
        if kind != MATRIX:
            raise ValueError
        yield body


def _exactly(data: bytes, at: int, size: int) -> bytes:
    found = data[at : at + size]
    if len(found) != size:
        raise ValueError
    return found


def _array(body: bytes, order: str) -> tuple[str, object] | None:
    """Name and value of one array; None for cells, structs and the like."""
    kind, flags, at = _part(body, 0, order)
    if kind != 6 or len(flags) != 8:
        raise ValueError
    (word,) = struct.unpack_from(order + "I", flags)
    kind, dimensions, at = _part(body, at, order)
    shape = struct.unpack(f"{order}{len(dimensions) // 4}i", dimensions)
    if kind != 5 or not 2 <= len(shape) <= MOST_DIMENSIONS or min(shape) < 0:
        raise ValueError
    _, name, at = _part(body, at, order)
    text = name.decode("latin-1")
    if word & 0xFF == CHARACTERS:
        kind, characters, _ = _part(body, at, order)
        codec = TEXTS.get(kind, "")
        if codec in ("utf-16", "utf-32"):
            codec += "-le" if order == "<" else "-be"
        return text, characters.decode(codec or "latin-1")
    if word & 0xFF not in NUMERIC:
        return None
    values, at = _numbers(body, at, order)
    if word & COMPLEX:
        imaginary, at = _numbers(body, at, order)
        values = values + 1j * imaginary
    return text, values.reshape(shape, order="F")


def _numbers(body: bytes, at: int, order: str) -> tuple[np.ndarray, int]:
    kind, numbers, at = _part(body, at, order)
    if kind not in NUMBERS:
        raise ValueError
    return np.frombuffer(numbers, np.dtype(order + NUMBERS[kind])), at


def _part(body: bytes, at: int, order: str) -> tuple[int, bytes, int]:
    """Type and bytes of a part of an array, and where the next begins."""
    (kind,) = struct.unpack_from(order + "I", body, at)
    if kind >> 16:  # up to four bytes stand in the tag itself
        return kind & 0xFFFF, _exactly(body, at + 4, min(kind >> 16, 5)), at + 8
    (size,) = struct.unpack_from(order + "I", body, at + 4)
    return kind, _exactly(body, at + 8, size), at + 8 + -(-size // 8) * 8
