"""MAT files of version 5 (MATLAB 5 to 7.2): arrays of numbers and text, structs, cells, by name.

Read here because SciPy's reader trusts the lengths that a file states: where a byte is damaged it
reads beyond its buffers, which ends the process without a word. Layout: "MAT-File Format", The
MathWorks, level 5.
"""

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.recording.entry_columns import DEEPEST, LARGEST_BYTES, MOST_ENTRIES, check_size

HEADER = 128
COMPRESSED, MATRIX = 15, 14  # types of elements
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8",
           13: "u8"}  # types of numbers  # fmt: skip
TEXTS = {16: "utf-8", 17: "utf-16", 18: "utf-32", 4: "utf-16", 2: "latin-1"}  # types of characters
# Classes of arrays; what is none of these is listed by its name and not read.
CELL, STRUCT, CHARACTERS, NUMERIC, OPAQUE = 1, 2, 4, range(6, 16), 17
COMPLEX = 0x0800  # flag of an array
MOST_DIMENSIONS, LONGEST_NAME = 32, 256


def is_version_5(path: Path) -> bool:
    """Whether a file says that it is a MAT file of version 5."""
    with open(path, "rb") as file:
        head = file.read(HEADER)
    little = head[126:128] == b"IM"
    return len(head) == HEADER and head[126:128] in (b"IM", b"MI") and head[124 + little] == 1


def read_mat5(path: Path) -> dict[str, object]:
    """What a file holds by name; InputError where it is damaged.

    Arrays of numbers have the dimensions of the file; structs are dicts, cell arrays and arrays of
    structs lists in column order, matrices of characters tuples of their rows, others None.
    """
    data = memoryview(path.read_bytes())
    order, left = "<" if data[126:128] == b"IM" else ">", [MOST_ENTRIES]
    try:
        return dict(_array(body, order, left) for body in _bodies(path, data, order))
    except (struct.error, zlib.error, ValueError, MemoryError):
        raise InputError(f"{path} is not a whole MAT file; export it again.") from None


def _bodies(path: Path, data: memoryview, order: str) -> Iterator[memoryview]:
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
            body = _exactly(memoryview(inner), 8, size)
        if kind != MATRIX:
            raise ValueError
        yield body


def _exactly(data: memoryview, at: int, size: int) -> memoryview:
    found = data[at : at + size]
    if len(found) != size:
        raise ValueError
    return found


def _array(body: memoryview, order: str, left: list[int], depth: int = 0) -> tuple[str, object]:
    """Name and value of one array; None for objects and the like."""
    left[0] -= 1
    if depth > DEEPEST or left[0] < 0:
        raise ValueError
    kind, flags, at = _part(body, 0, order)
    if kind != 6 or len(flags) != 8:
        raise ValueError
    (word,) = struct.unpack_from(order + "I", flags)
    if word & 0xFF == OPAQUE:  # tables, strings and other objects have no dimensions
        _, name, _ = _part(body, at, order)
        return bytes(name).decode("latin-1"), None
    kind, dimensions, at = _part(body, at, order)
    shape = struct.unpack(f"{order}{len(dimensions) // 4}i", dimensions)
    if kind != 5 or not 2 <= len(shape) <= MOST_DIMENSIONS or min(shape) < 0:
        raise ValueError
    _, name, at = _part(body, at, order)
    inner = _Inner(body, at, order, left, depth)
    reader = {CELL: _cells, STRUCT: _structs, CHARACTERS: _text}.get(word & 0xFF)
    if reader is not None:
        value = reader(inner, shape)
    elif word & 0xFF in NUMERIC:
        value = _values(inner, shape, bool(word & COMPLEX))
    else:
        value = None
    return bytes(name).decode("latin-1"), value


@dataclass
class _Inner:
    """What stands in an array after its name, read on part by part."""

    body: memoryview
    at: int
    order: str
    left: list[int]  # how many arrays may still follow in the file
    depth: int

    def part(self) -> tuple[int, memoryview]:
        kind, part, self.at = _part(self.body, self.at, self.order)
        return kind, part

    def array(self) -> object:
        """The next array in the array; empty ones may be a tag alone."""
        kind, body = self.part()
        if kind != MATRIX:
            raise ValueError
        if not len(body):
            return np.zeros((0, 0))
        return _array(body, self.order, self.left, self.depth + 1)[1]

    def numbers(self) -> np.ndarray:
        kind, numbers = self.part()
        if kind not in NUMBERS:
            raise ValueError
        return np.frombuffer(numbers, np.dtype(self.order + NUMBERS[kind]))


def _values(inner: _Inner, shape: tuple[int, ...], of_complex: bool) -> np.ndarray:
    values = inner.numbers()
    if of_complex:
        values = values + 1j * inner.numbers()
    return values.reshape(shape, order="F")


def _text(inner: _Inner, shape: tuple[int, ...]) -> object:
    """A text, or the rows of a matrix of characters."""
    kind, characters = inner.part()
    codec = TEXTS.get(kind, "")
    if codec in ("utf-16", "utf-32"):
        codec += "-le" if inner.order == "<" else "-be"
    text = bytes(characters).decode(codec or "latin-1")
    rows = shape[0]
    if rows < 2 or math.prod(shape) != len(text):
        return text
    return tuple(text[row::rows].strip() for row in range(rows))


def _cells(inner: _Inner, shape: tuple[int, ...]) -> list[object]:
    return [inner.array() for _ in range(_count(inner, shape))]


def _structs(inner: _Inner, shape: tuple[int, ...]) -> object:
    kind, stated = inner.part()
    if kind != 5 or len(stated) != 4:
        raise ValueError
    (length,) = struct.unpack(inner.order + "i", stated)
    _, names = inner.part()
    if not 0 < length <= LONGEST_NAME or len(names) > length * MOST_ENTRIES:
        raise ValueError
    texts = [bytes(names[i : i + length]) for i in range(0, len(names), length)]
    fields = [text.split(b"\0", 1)[0].decode("latin-1") for text in texts]
    each = [
        {name: inner.array() for name in fields}
        for _ in range(_count(inner, shape) if fields else 0)
    ]
    return each[0] if len(each) == 1 else each


def _count(inner: _Inner, shape: tuple[int, ...]) -> int:
    """How many elements an array of arrays has; each takes a tag at least."""
    count = math.prod(shape)
    if count > len(inner.body) // 8:
        raise ValueError
    return count


def _part(body: memoryview, at: int, order: str) -> tuple[int, memoryview, int]:
    """Type and bytes of a part of an array, and where the next begins."""
    (kind,) = struct.unpack_from(order + "I", body, at)
    if kind >> 16:  # up to four bytes stand in the tag itself
        return kind & 0xFFFF, _exactly(body, at + 4, min(kind >> 16, 5)), at + 8
    (size,) = struct.unpack_from(order + "I", body, at + 4)
    return kind, _exactly(body, at + 8, size), at + 8 + -(-size // 8) * 8
