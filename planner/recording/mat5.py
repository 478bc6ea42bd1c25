"""MAT files of version 5 (MATLAB 5 to 7.2): arrays of numbers and text, structs, cells, by name.

Read here because SciPy's reader trusts the lengths that a file states: where a byte is damaged it
reads beyond its buffers, which ends the process without a word. Layout: "MAT-File Format", The
MathWorks, level 5.
"""

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.recording.entry_columns import DEEPEST, LARGEST_BYTES, MOST_ENTRIES, check_size

HEADER = 128
COMPRESSED, MATRIX, FLAGS, DIMENSIONS = 15, 14, 6, 5  # types of elements
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8",
           13: "u8"}  # types of numbers  # fmt: skip
TEXTS = {16: "utf-8", 17: "utf-16", 18: "utf-32", 4: "utf-16", 2: "latin-1"}  # types of characters
# Classes of arrays; what is none of these is listed by its name and not read.
CELL, STRUCT, CHARACTERS, NUMERIC, OPAQUE = 1, 2, 4, range(6, 16), 17
COMPLEX = 0x0800  # flag of an array
MOST_DIMENSIONS, LONGEST_NAME = 32, 256

Part = tuple[int, memoryview]  # type and bytes


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
    reader = _ArrayReader("<" if data[126:128] == b"IM" else ">")
    try:
        return dict(reader.array(body) for body in reader.bodies(path, data))
    except (struct.error, zlib.error, ValueError, MemoryError):
        raise InputError(f"{path} is not a whole MAT file; export it again.") from None


def _exactly(data: memoryview, at: int, size: int) -> memoryview:
    found = data[at : at + size]
    if len(found) != size:
        raise ValueError
    return found


def _require(*conditions: bool) -> None:
    if not all(conditions):
        raise ValueError


@dataclass
class _ArrayReader:
    """Reads a file of one byte order; ValueError and the like where a length contradicts another.

    `left` is how many arrays may still follow.
    """

    order: str
    left: int = field(default=MOST_ENTRIES)

    def bodies(self, path: Path, data: memoryview) -> Iterator[memoryview]:
        """What stands in each of the file's arrays, unfolded."""
        at, unfolded = HEADER, 0
        while at < len(data):
            kind, size = struct.unpack_from(self.order + "II", data, at)
            body = _exactly(data, at + 8, size)
            at += 8 + size
            if kind == COMPRESSED:
                inner = zlib.decompressobj().decompress(body, LARGEST_BYTES - unfolded + 1)
                unfolded += len(inner)
                check_size(path, unfolded)
                kind, size = struct.unpack_from(self.order + "II", inner)
                body = _exactly(memoryview(inner), 8, size)
            _require(kind == MATRIX)
            yield body

    def parts(self, body: memoryview) -> Iterator[Part]:
        """The parts of an array."""
        at = 0
        while True:
            (kind,) = struct.unpack_from(self.order + "I", body, at)
            if kind >> 16:  # up to four bytes stand in the tag itself
                yield kind & 0xFFFF, _exactly(body, at + 4, min(kind >> 16, 5))
                at += 8
            else:
                (size,) = struct.unpack_from(self.order + "I", body, at + 4)
                yield kind, _exactly(body, at + 8, size)
                at += 8 + -(-size // 8) * 8

    def array(self, body: memoryview, depth: int = 0) -> tuple[str, object]:
        """Name and value of one array; None for objects and the like."""
        self.left -= 1
        parts = self.parts(body)
        kind, flags = next(parts)
        _require(depth <= DEEPEST, self.left >= 0, kind == FLAGS, len(flags) == 8)
        (word,) = struct.unpack_from(self.order + "I", flags)
        of = word & 0xFF
        if of == OPAQUE:  # tables, strings and other objects have no dimensions
            return bytes(next(parts)[1]).decode("latin-1"), None
        kind, dimensions = next(parts)
        shape = struct.unpack(f"{self.order}{len(dimensions) // 4}i", dimensions)
        _require(kind == DIMENSIONS, 2 <= len(shape) <= MOST_DIMENSIONS, min(shape) >= 0)
        name, value = bytes(next(parts)[1]).decode("latin-1"), None
        if of in (CELL, STRUCT):
            _require(math.prod(shape) <= len(body) // 8)  # each takes a tag at least
            read = self._cells if of == CELL else self._structs
            value = read(parts, math.prod(shape), depth + 1)
        elif of == CHARACTERS:
            value = self._text(next(parts), shape)
        elif of in NUMERIC:
            value = self._numbers(next(parts))
            if word & COMPLEX:
                value = value + 1j * self._numbers(next(parts))
            value = value.reshape(shape, order="F")
        return name, value

    def _cells(self, parts: Iterator[Part], count: int, depth: int) -> list[object]:
        """The next arrays in an array; empty ones may be a tag alone."""
        found: list[object] = []
        for _ in range(count):
            kind, body = next(parts)
            _require(kind == MATRIX)
            found.append(self.array(body, depth)[1] if len(body) else np.zeros((0, 0)))
        return found

    def _structs(self, parts: Iterator[Part], count: int, depth: int) -> object:
        kind, stated = next(parts)
        _require(kind == DIMENSIONS, len(stated) == 4)
        (length,) = struct.unpack(self.order + "i", stated)
        names = bytes(next(parts)[1])
        _require(0 < length <= LONGEST_NAME, len(names) <= length * MOST_ENTRIES)
        texts = [names[i : i + length] for i in range(0, len(names), length)]
        fields = [text.split(b"\0", 1)[0].decode("latin-1") for text in texts]
        each = [
            dict(zip(fields, self._cells(parts, len(fields), depth), strict=True))
            for _ in range(count if fields else 0)
        ]
        return each[0] if len(each) == 1 else each

    def _numbers(self, part: Part) -> np.ndarray:
        kind, numbers = part
        _require(kind in NUMBERS)
        return np.frombuffer(numbers, np.dtype(self.order + NUMBERS[kind]))

    def _text(self, part: Part, shape: tuple[int, ...]) -> object:
        """A text, or the rows of a matrix of characters."""
        codec = TEXTS.get(part[0], "latin-1")
        if codec in ("utf-16", "utf-32"):
            codec += "-le" if self.order == "<" else "-be"
        text, rows = bytes(part[1]).decode(codec), shape[0]
        if rows < 2 or math.prod(shape) != len(text):
            return text
        return tuple(text[row::rows].strip() for row in range(rows))
