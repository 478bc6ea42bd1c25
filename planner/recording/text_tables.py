"""Text tables (CSV, TSV, vendors' exports with header blocks, also gzipped)."""

import gzip
import re
import zlib
from pathlib import Path

import numpy as np

from planner.errors import ForeignFileError, InputError
from planner.recording.named_columns import Named, to_records
from planner.recording.records import Record

MAX_BYTES = 256 * 1024 * 1024
LABELS = ("ch no.", "ch no", "channel", "name")  # head a row of names
LEAST_ROWS = 8
MOST_HEADER_LINES, MOST_HEADER_TEXT = (
    10_000,
    2000,
)  # lines, and characters of one that are looked at
SEPARATORS = re.compile(r"[=:,;\t]")  # between a key and its value


def read_text(path: Path) -> tuple[Record, ...]:
    """Records of a text table. Raises InputError saying what is wrong."""
    return to_records(path, parse_table(path, _decode(path)))


def _decode(path: Path) -> str:
    try:
        if path.suffix.lower() == ".gz":
            with gzip.open(path) as file:
                data = file.read(MAX_BYTES + 1)
        else:
            with open(path, "rb") as file:
                data = file.read(MAX_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path} cannot be read ({error}); export it again.") from None
    if len(data) > MAX_BYTES:
        raise InputError(f"{path} holds more than {MAX_BYTES >> 20} MiB of text; split it.")
    if b"\x00" in data[:4096]:
        raise InputError(f"{path} is binary, not a text table; check its name and format.")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _split(line: str, delimiter: str) -> list[str]:
    cells = line.split() if delimiter == " " else line.split(delimiter)
    return [cell.strip().strip('"').strip() for cell in cells]


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _is_complex(cell: str) -> bool:
    try:
        return complex(cell).imag != 0
    except ValueError:
        return False


def parse_table(path: Path, text: str) -> Named:
    """Columns of the longest block of numbers, named by the lines above it."""
    lines = text.splitlines()
    delimiter = _delimiter(path, lines)
    first = _block_start(path, lines, delimiter)
    width = _numeric_width(lines, first, delimiter)
    names, units, attributes = _header(lines[:first], delimiter, width)
    rows = [line for line in lines[first:] if line.strip()]
    values = _numbers(path, rows, first, delimiter, width)
    columns = {name: values[:, i] for i, name in enumerate(names)}
    stated = {n: u for n, u in zip(names, units, strict=True) if u}
    return Named(columns, stated, attributes)


def _delimiter(path: Path, lines: list[str]) -> str:
    """The delimiter with which the last lines (data, not header) have most cells."""
    sample = [line for line in lines[-50:] if line.strip()]
    if not sample:
        raise InputError(f"{path} is empty; export it again.")
    for delimiter in ("\t", ";", ",", " "):
        if all(delimiter in line.strip() for line in sample):
            return delimiter
    return ","


def _block_start(path: Path, lines: list[str], delimiter: str) -> int:
    run = 0
    for i, line in enumerate(lines[:MOST_HEADER_LINES]):
        cells = _split(line, delimiter)
        if cells and _is_number(cells[0]) and (len(cells) < 2 or _is_number(cells[1])):
            run += 1
            if run == LEAST_ROWS:
                return i - LEAST_ROWS + 1
        else:
            run = 0
    if sum(_is_complex(line.strip()) for line in lines[:100]) >= min(LEAST_ROWS, len(lines)):
        raise InputError(
            f"{path} is a list of {len(lines)} complex numbers without frequency lines or units; "
            f"export FRFs with their frequencies."
        )
    raise ForeignFileError(
        f"{path} holds no table of numbers (at least {LEAST_ROWS} rows); export time histories."
    )


def _numeric_width(lines: list[str], first: int, delimiter: str) -> int:
    """How many leading columns are numbers in the block's first rows."""
    widths = []
    for line in lines[first : first + LEAST_ROWS]:
        cells = _split(line, delimiter)
        width = next((i for i, cell in enumerate(cells) if not _is_number(cell)), len(cells))
        widths.append(width)
    return min(widths)


def _header(
    lines: list[str], delimiter: str, width: int
) -> tuple[list[str], list[str], dict[str, str]]:
    names: list[str] = []
    units = [""] * width
    attributes: dict[str, str] = {}
    rows = [_split(line, delimiter) for line in lines]
    labelled = any(row and row[0].lower() in LABELS for row in rows)
    for line, cells in zip(lines, rows, strict=True):
        row = cells[:width]
        full = len(row) == width and all(row) and not any(_is_number(c) for c in row[1:])
        if full and row[0].lower() in ("unit", "units"):
            units = ["", *row[1:]]
        elif labelled and row[0].lower() in LABELS and full:
            names = row
        elif labelled:
            pass
        elif full and not names and (width > 2 or not _is_pair(cells)):
            names = row
        elif full and names and len(set(row)) <= len(set(names)) and not any(units):
            units = row
        pair = _pair(line[:MOST_HEADER_TEXT])
        if pair:
            attributes.setdefault(_key(pair[0]), pair[1])
    if not names:
        names = [f"column_{i + 1}" for i in range(width)]
    elif names[0].lower() in LABELS:
        names = ["time_s", *names[1:]]
    return _distinct(names), units, attributes


def _pair(line: str) -> tuple[str, str] | None:
    """Key and value of a header line such as `# hit = "+x"`; None where it is none."""
    found = SEPARATORS.search(line)
    if found is None:
        return None
    key = line[: found.start()].strip().removeprefix("#").strip().strip('"').strip()
    value = line[found.end() :].strip().removeprefix('"')
    value = re.split(r'[,;\t"]', value, maxsplit=1)[0].strip()
    usable = value and re.fullmatch(r"[\w .()/-]+", key)
    return (key, value) if usable else None


def _is_pair(cells: list[str]) -> bool:
    """A two-column header may be mistaken for a key and its value."""
    return bool(re.search(r"(no\.|title|date|hit|input|name)", cells[0].lower()))


def _key(text: str) -> str:
    plain = re.sub(r"[^a-z]+", "_", text.lower()).strip("_")
    return "sampling_rate_hz" if plain in ("sampling_rate_hz", "sampling_frequency") else plain


def _distinct(names: list[str]) -> list[str]:
    seen: dict[str, int] = {}
    out = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        out.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return out


def _numbers(path: Path, rows: list[str], first: int, delimiter: str, width: int) -> np.ndarray:
    try:
        return np.loadtxt(
            (row.replace('"', "") for row in rows),
            delimiter=None if delimiter == " " else delimiter,
            usecols=range(width),
            ndmin=2,
            comments=None,
        )
    except ValueError:
        for number, row in enumerate(rows):
            cells = _split(row, delimiter)[:width]
            if len(cells) < width or not all(_is_number(cell) for cell in cells):
                raise InputError(
                    f"{path}, row {first + number + 1}: not {width} numbers as in the rows above; "
                    f"the table is cut off or mixed, export it again."
                ) from None
        raise InputError(f"{path} holds cells that are no numbers; export it again.") from None
