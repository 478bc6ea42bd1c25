"""Text tables (CSV, TSV, vendors' exports with header blocks, also gzipped), of any code page.

Decimals may be commas where columns are not parted by them.
"""

import codecs
import gzip
import re
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from planner.errors import ForeignFileError, InputError
from planner.recording.column_names import lookup, lookup_ratio, says_something
from planner.recording.named_columns import Named, to_records
from planner.recording.records import Record

MAX_BYTES = 256 * 1024 * 1024
LABELS = ("ch no.", "ch no", "channel", "name")  # head a row of names
LEAST_ROWS = 8
MOST_HEADER_LINES, MOST_HEADER_TEXT = 10_000, 2000  # lines, and characters of one, looked at
SEPARATORS = re.compile(r"[=:,;\t]")  # between a key and its value
PAIR = re.compile(r"no\.|title|date|hit|input|name")  # in keys
BOMS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF32_LE: "utf-32", codecs.BOM_UTF32_BE: "utf-32",
        codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}  # fmt: skip


class Form(NamedTuple):
    """How the cells of a table are parted ("" by blanks), and what stands before decimals."""

    delimiter: str
    decimal: str

    def split(self, line: str) -> list[str]:
        """Cells of a line of numbers, decimals with a point."""
        return [cell.replace(self.decimal, ".") for cell in self.cells(line)]

    def cells(self, line: str) -> list[str]:
        """Cells of a line as they are written."""
        cells = line.split(self.delimiter) if self.delimiter else line.split()
        return [cell.strip().strip('"').strip() for cell in cells]


# In this order: a comma parts cells only where nothing else does.
FORMS = tuple(Form(d, p) for d in ("\t", ";", ",", "") for p in ".," if d != p)


def read_text(path: Path) -> tuple[Record, ...]:
    """Records of a text table. Raises InputError saying what is wrong."""
    # Columns are those of the longest block of numbers, named by the lines above it.
    lines = decoded(path, MAX_BYTES).splitlines()
    form, first = _block(path, lines)
    width = _width(lines[first : first + LEAST_ROWS], form)
    names, units, attributes = _header(lines[:first], form, width)
    values = _numbers(path, [line for line in lines[first:] if line.strip()], first, form, width)
    columns = {name: values[:, i] for i, name in enumerate(names)}
    stated = {n: u for n, u in zip(names, units, strict=True) if u}
    return to_records(path, Named(columns, stated, attributes))


def decoded(path: Path, most_bytes: int) -> str:
    """The text of a file, gzipped or not; InputError where it is too large or no text."""
    try:
        with gzip.open(path) if path.suffix.lower() == ".gz" else open(path, "rb") as file:
            data = file.read(most_bytes + 1)
    except FileNotFoundError:
        raise InputError(f"{path} does not exist; check the path.") from None
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path} cannot be read ({error}); export it again.") from None
    if len(data) > most_bytes:
        raise InputError(f"{path} holds more than {most_bytes >> 20} MiB of text; split it.")
    marked = next((name for bom, name in BOMS.items() if data.startswith(bom)), None)
    if marked is None and b"\x00" in data[:4096]:
        raise InputError(f"{path} is binary, not a text table; check its name and format.")
    try:
        return data.decode(marked or "utf-8")
    except UnicodeDecodeError:
        return data.decode("cp1252" if marked is None else "latin-1", errors="replace")


def _is_number(cell: str, kind: type[float] | type[complex] = float) -> bool:
    try:
        kind(cell)
    except ValueError:
        return False
    return True


def _block(path: Path, lines: Sequence[str]) -> tuple[Form, int]:
    """How the first rows of numbers are written, and where they begin."""
    if not any(line.strip() for line in lines):
        raise InputError(f"{path} is empty; export it again.")
    last = next(line for line in reversed(lines) if line.strip())
    ending = [form for form in FORMS if _width([last], form)]
    found = []
    for form in ending or FORMS:
        start, width = _start(lines, form)
        if start >= 0:
            found.append((start, -width, form))
    if found:
        start, _, form = min(found, key=lambda one: one[:2])
        return form, start
    numbers = [complex(line) for line in lines[:100] if _is_number(line, complex)]
    if sum(one.imag != 0 for one in numbers) >= min(LEAST_ROWS, len(lines)):
        raise InputError(
            f"{path} is a list of {len(lines)} complex numbers without frequency lines or units; "
            f"export FRFs with their frequencies."
        )
    raise ForeignFileError(
        f"{path} holds no table of numbers (at least {LEAST_ROWS} rows); export time histories."
    )


def _start(lines: Sequence[str], form: Form) -> tuple[int, int]:
    """Where rows of numbers begin, and how many stand in each; (-1, 0) where there are none."""
    run = 0
    for i, line in enumerate(lines[:MOST_HEADER_LINES]):
        cells = form.split(line)
        run = run + 1 if cells and all(map(_is_number, cells[:2])) else 0
        if run == LEAST_ROWS:
            first = i - LEAST_ROWS + 1
            return first, _width(lines[first : i + 1], form)
    return -1, 0


def _width(lines: Sequence[str], form: Form) -> int:
    """How many leading cells are numbers in all of these lines."""
    rows = map(form.split, lines)
    return min(next((i for i, c in enumerate(row) if not _is_number(c)), len(row)) for row in rows)


def _header(
    lines: Sequence[str], form: Form, width: int
) -> tuple[list[str], list[str], dict[str, str]]:
    """Names and units of the columns ("" where none is stated), and the attributes."""
    rows = [_header_cells(line, form, width) for line in lines]
    full = [i for i, row in enumerate(rows) if row and all(row) and not _numeric(row[1:])]
    labelled = [i for i in full if rows[i][0].lower() in LABELS]
    likely = labelled or [
        i for i in full
        # A header of two columns may be mistaken for a key and its value.
        if (width > 2 or not PAIR.search(rows[i][0].lower())) and not all(map(_is_unit, rows[i]))
    ]  # fmt: skip
    attributes: dict[str, str] = {}
    for line, row in zip(lines, rows, strict=True):
        for key, value in _pairs(line[:MOST_HEADER_TEXT], row):
            attributes.setdefault(re.sub(r"[^a-z]+", "_", key.lower()).strip("_"), value)
    if not likely:
        return [f"column_{i + 1}" for i in range(width)], [""] * width, attributes
    # The row that says most of columns; of several that say as much the first.
    at = max(likely, key=lambda i: (sum(map(says_something, rows[i])), -i))
    names = [name.lstrip("#").strip() for name in rows[at]]
    units = next((u for row in rows[at + 1 :] if (u := _units(row, names))), [""] * width)
    if names[0].lower() in LABELS:
        names = ["time_s", *names[1:]]
    # Names that stand several times get a number.
    distinct = [
        name if names.index(name) == i else f"{name} #{names[: i + 1].count(name)}"
        for i, name in enumerate(names)
    ]
    return distinct, units, attributes


def _header_cells(line: str, form: Form, width: int) -> list[str]:
    """As many cells as the table has columns, where a line of the header can be split so."""
    ways = [form.cells(line)[:width]]
    if not form.delimiter:  # names hold blanks, too: "Time (s)   Acc X (g)"
        by_gaps = re.split(r"\s{2,}|\t|;|,", line.strip())
        by_units = re.findall(r"[^\s(\[]+(?:\s*(?:\([^)]*\)|\[[^\]]*\]))?", line)
        ways = [by_gaps, by_units, form.cells(line)]
    return next(
        ([cell.strip().strip('"').strip() for cell in w] for w in ways if len(w) == width), []
    )


def _numeric(cells: Sequence[str]) -> bool:
    return any(_is_number(cell.replace(",", ".")) for cell in cells)


def _is_unit(cell: str) -> bool:
    return bool(lookup(cell) or lookup_ratio(cell))


def _units(row: Sequence[str], names: Sequence[str]) -> list[str] | None:
    """A row below the names that states units; None where it is something else."""
    if not row or not any(row):
        return None
    if row[0].lower() in ("unit", "units"):
        return ["", *row[1:]]
    known = [_is_unit(cell) for cell in row if cell]
    if all(known) or (all(row) and any(known)):
        return [*row]
    plain = all(row) and not _numeric(row[1:]) and len(set(row)) <= len(set(names))
    return [*row] if plain else None


def _pairs(line: str, row: Sequence[str]) -> list[tuple[str, str]]:
    """Keys and values of a header line: `# hit = "+x"`, or `Ref Chan:Resp Chan  1:+X  2:+X`."""
    keys = row[0].split(":") if row else []
    if len(keys) > 1 and len(keys) == len(row) - 1 and all(key.strip() for key in keys):
        return list(zip(keys, row[1:], strict=True))
    found = SEPARATORS.search(line)
    if found is None:
        return []
    key = line[: found.start()].strip().removeprefix("#").strip().strip('"').strip()
    value = line[found.end() :].strip().removeprefix('"')
    value = re.split(r'[,;\t"]', value, maxsplit=1)[0].strip()
    usable = value and re.fullmatch(r"[\w .()/-]+", key)
    return [(key, value)] if usable else []


def _numbers(path: Path, rows: list[str], first: int, form: Form, width: int) -> np.ndarray:
    try:
        plain = (row.replace('"', "") for row in rows)
        return np.loadtxt(
            plain if form.decimal == "." else (row.replace(",", ".") for row in plain),
            delimiter=form.delimiter or None,
            usecols=range(width),
            ndmin=2,
            comments=None,
        )
    except ValueError:
        for number, row in enumerate(rows):
            cells = form.split(row)[:width]
            if len(cells) < width or not all(_is_number(cell) for cell in cells):
                raise InputError(
                    f"{path}, row {first + number + 1}: not {width} numbers as in the rows above; "
                    f"the table is cut off or mixed, export it again."
                ) from None
        raise InputError(f"{path} holds cells that are no numbers; export it again.") from None
