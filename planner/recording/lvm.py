"""LabVIEW measurement files (.lvm): headers and segments of text, one or many x columns.

Layout: "Specification for the LabVIEW Measurement File (.lvm)", National Instruments. Read here
because the reader on PyPI takes files with special blocks, or whose header stands twice, for
something else, and evaluates what stands in the cells.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from planner.errors import InputError
from planner.recording.entry_columns import MOST_ENTRIES, tree_of
from planner.recording.entry_records import records_of
from planner.recording.records import Record, check_numbers
from planner.recording.sampling import UNEVEN, sampling_rate
from planner.recording.text_tables import MAX_BYTES, decoded, read_text

FIRST_LINE = "LabVIEW Measurement"
END, SPECIAL, END_SPECIAL = "***End_of_Header***", "***Start_Special***", "***End_Special***"
# A row is of numbers if its first cell is one, or empty as without x columns.
NUMBER = re.compile(r"[-+.,\d]|nan|inf|$", re.IGNORECASE)
ABSCISSA, COMMENT = "X_Value", "Comment"


@dataclass
class _Segment:
    """A block of rows, what its header says of each column, and the columns' names.

    Not `announced` is what may follow an empty line, under the header of the block before.
    """

    head: dict[str, str]  # what the file's header says
    stated: dict[str, list[str]]
    names: list[str]
    first_row: int
    announced: bool = True
    rows: list[list[str]] = field(default_factory=list)

    @property
    def cut_off(self) -> bool:
        """Whether its header ends, or states samples, and no row follows."""
        samples = self.stated.get("Samples", [])[1:]
        whole = self.names and set(samples) <= {"0", ""}
        return self.announced and not self.rows and not whole


# By name, columns of numbers (n,) and what is stated of each as in entries of other files: unit,
# x_unit ("s", of spectra "Hz"), dt, t0 (from start_time, if one is stated).
_Channels = dict[str, tuple[np.ndarray, dict[str, Any]]]


def read_lvm(path: Path) -> tuple[Record, ...]:
    """Each segment is a record; those that go on where the last ended are one. Spectra are refused.

    Raises InputError saying what is wrong, and where.
    """
    text = decoded(path, MAX_BYTES)
    if not text.startswith(FIRST_LINE):
        return read_text(path)  # as LabVIEW's "no header" writes it: a table
    parts: list[_Channels] = []
    head: dict[str, str] = {}
    for segment in _segments(text):
        head = segment.head
        if segment.cut_off:
            raise InputError(f"{path} ends within a header; the file is cut off, export it again.")
        channels = _channels(path, segment)
        if parts and _goes_on(parts[-1], channels):
            parts[-1] = {
                name: (np.concatenate([values, channels[name][0]]), said)
                for name, (values, said) in parts[-1].items()
            }
        elif channels:
            parts.append(channels)
    if not parts:
        raise InputError(f"{path} holds headers and no data; export it again.")
    trees = {
        f"segment {number}": {n: tree_of({"": values}, said) for n, (values, said) in part.items()}
        for number, part in enumerate(parts, 1)
    }
    return records_of(path, tree_of(trees, head))


def _segments(text: str) -> Iterator[_Segment]:
    """Segments in order. A row of numbers after an empty line begins another of the same header."""
    separator, special = "\t", False
    head: dict[str, str] = {}
    block: dict[str, list[str]] = {}
    current: _Segment | None = None
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("Separator") and len(line) > len("Separator"):
            separator = line[len("Separator")]
        cells = [cell.strip() for cell in line.split(separator)]
        first = cells[0]
        if special or first == SPECIAL:
            special = first != END_SPECIAL
        elif current and any(cells) and NUMBER.match(first):
            current.rows.append(cells)
        elif current and current.rows:  # it ends with an empty line, or where a header begins
            yield current
            current = (
                None if any(cells) else _Segment(head, block, current.names, number + 1, False)
            )
            block = {first: cells} if any(cells) else block
        elif first == ABSCISSA:
            current = _Segment(head, block, cells, number + 1)
        elif first == END and "Channels" not in block:  # of the file, not of its channels
            head, block = {tag: found[1] for tag, found in block.items() if len(found) > 1}, {}
        elif any(cells):
            block = block if current is None else {}
            block[first], current = cells, None
    if special or (block and not current):
        current = _Segment(head, block, [], 0)
    if current:
        yield current


def _channels(path: Path, segment: _Segment) -> _Channels:
    """Columns with their steps and starts; those of one name, or without, with their numbers."""
    columns = {
        column: _numbers(path, segment, column)
        for column, name in enumerate(segment.names[:MOST_ENTRIES] if segment.rows else [])
        if name != COMMENT and (name or _cell(segment, "Samples", column))
    }
    times = [column for column in columns if segment.names[column] == ABSCISSA]
    x_of = {c: max((t for t in times if t < c), default=-1) for c in columns if c not in times}
    found: list[tuple[str, np.ndarray, dict[str, Any]]] = []
    for column, at in x_of.items():
        # An x column is that of the longest channel on its right.
        owner = max((c for c in x_of if x_of[c] == at), key=lambda c: columns[c].size)
        if count := columns[column].size:
            said = _stated(path, segment, column, count, owner, columns.get(at, np.zeros(0)))
            found.append((segment.names[column], columns[column], said))
    names = [name for name, *_ in found]
    return {
        f"{name} ({number})" if names.count(name) > 1 or not name else name: (values, said)
        for number, (name, values, said) in enumerate(found, 1)
    }


def _stated(
    path: Path, segment: _Segment, column: int, held: int, owner: int, x: np.ndarray
) -> dict[str, Any]:
    """What is stated of a column that holds so many samples."""

    def stated(tag: str, at: int = column) -> str:
        return _cell(segment, tag, at)

    count = stated("Samples")
    if count.isdecimal() and int(count) > held:
        raise InputError(
            f"{path} states {count} samples of {segment.names[column]} and holds {held}; "
            f"the file is cut off, export it again."
        )
    start, step = (_number(path, tag, stated(tag)) for tag in ("X0", "Delta_X"))
    if x.size:  # times have more digits than steps
        check_numbers(path, ABSCISSA, x)
        start += float(x[0]) - _number(path, "X0", stated("X0", owner))
        step = 1 / sampling_rate(path, x - x[0])
    of_spectrum = stated("X_Dimension") == "Frequency" or stated("X_Unit_Label") in ("Hz", "hertz")
    # Seconds since 1904 are a date themselves.
    date = _date(stated("Date"), stated("Time")) if abs(start) < 1e9 else None
    return {"unit": stated("Y_Unit_Label"), "x_unit": "Hz" if of_spectrum else "s", "t0": start,
            "dt": step, **({} if date is None else {"start_time": date})}  # fmt: skip


def _cell(segment: _Segment, tag: str, column: int) -> str:
    """What a header states of the channel in a column."""
    cells = segment.stated.get(tag, [])
    return cells[column] if 0 < column < len(cells) else ""


def _numbers(path: Path, segment: _Segment, column: int) -> np.ndarray:
    """The numbers of a column; one that ends before others is empty from there."""
    texts = [row[column].replace(",", ".") if column < len(row) else "" for row in segment.rows]
    while texts and not texts[-1]:
        texts.pop()
    values = np.empty(len(texts))
    for row, text in enumerate(texts):
        try:
            values[row] = float(text)
        except ValueError:
            raise InputError(
                f"{path}, row {segment.first_row + row}: {segment.names[column]} is "
                f"{text[:20] or 'empty'}, no number; the file is cut off or mixed, export it again."
            ) from None
    return values


def _number(path: Path, tag: str, text: str) -> float:
    try:
        return float((text or "0").replace(",", "."))
    except ValueError:
        raise InputError(f"{path}: {tag} {text[:20]} is no number; export it again.") from None


def _date(date: str, time: str) -> np.datetime64 | None:
    day, clock = date.replace("/", "-"), time.replace(",", ".")[:18]  # to ns
    if not re.fullmatch(r"[\d:.]*", clock):  # NumPy warns of time zones, which the format has not
        return None
    try:
        return np.datetime64(f"{day}T{clock}", "ns")
    except ValueError:
        return None


def _goes_on(before: _Channels, after: _Channels) -> bool:
    """Whether each channel begins where it ended in the last segment."""
    if [*before] != [*after]:
        return False
    for name, (values, first) in before.items():
        count, then = len(values), after[name][1]
        apart = then["t0"] - first["t0"]
        if "start_time" in first and "start_time" in then:
            apart += float((then["start_time"] - first["start_time"]) / np.timedelta64(1, "s"))
        alike = (first["unit"], first["x_unit"]) == (then["unit"], "s")
        near = abs(apart - count * first["dt"]) < max(0.5, UNEVEN * count) * first["dt"]
        if first["dt"] > 0 and not (alike and near):
            return False
    return True
