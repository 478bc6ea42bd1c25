"""Universal files written by hand, as the dataset's description has them: not by a library."""

from pathlib import Path

import numpy as np

Quantity = tuple[int, str, str]  # specific data type, label, unit's label
NONE: Quantity = (0, "NONE", "NONE")


def units_164(code: int, length: float, force: float) -> bytes:
    """Dataset 164: a system of units, its factors from SI, and the line of a temperature offset."""
    numbers = [f"{v:25.17E}".replace("E", "D") for v in (length, force, 1.0, 273.15)]
    first = f"{code:10d}{'units':<20}{2:10d}"
    lines = ["    -1", "   164", first, "".join(numbers[:3]), numbers[3], "    -1"]
    return ("\n".join(lines) + "\n").encode()


def dataset_58(
    function: int,
    values: np.ndarray,
    ordinate: Quantity,
    denominator: Quantity = NONE,
    felt: tuple[int, int] = (1, 1),
    hit: tuple[int, int] = (1, 1),
    start: float = 0.0,
    step: float = 1 / 512,
    padded: int = 0,
) -> bytes:
    """Dataset 58, evenly spaced, single precision ASCII; `padded` zeros follow the last value."""
    parts = np.column_stack([values.real, values.imag]) if np.iscomplexobj(values) else values
    numbers = [*np.ravel(parts), *[0.0] * padded]
    kind = 5 if np.iscomplexobj(values) else 2
    lines = _head("    58", function, (kind, len(values), 1, start, step), ordinate, denominator)
    lines[7] = _places(function, felt, hit)
    rows = [numbers[i : i + 6] for i in range(0, len(numbers), 6)]
    lines += ["".join(f"{number:13.5E}" for number in row) for row in rows]
    return ("\n".join([*lines, "    -1"]) + "\n").encode()


def dataset_58b_mixed(x: np.ndarray, values: np.ndarray, ordinate: Quantity) -> bytes:
    """Dataset 58b of double precision over an uneven abscissa, which is of single precision."""
    body = np.zeros(len(x), [("x", "<f4"), ("y", "<f8")])
    body["x"], body["y"] = x, values
    first = f"    58b{1:6d}{2:6d}{11:12d}{body.nbytes:12d}{0:6d}{0:6d}{0:12d}{0:12d}"
    lines = _head(first, 1, (4, len(x), 0, 0.0, 0.0), ordinate, NONE)
    return ("\n".join(lines) + "\n").encode() + body.tobytes() + b"\n    -1\n"


def _places(function: int, felt: tuple[int, int], hit: tuple[int, int]) -> str:
    ends = f"NONE      {felt[0]:10d}{felt[1]:4d} NONE      {hit[0]:10d}{hit[1]:4d}"
    return f"{function:5d}{0:10d}{0:5d}{0:10d} {ends}"


def _head(
    first: str,
    function: int,
    form: tuple[int, int, int, float, float],
    ordinate: Quantity,
    denominator: Quantity,
) -> list[str]:
    kind, count, even, start, step = form
    axis = (18, "Frequency", "Hz") if function == 4 else (17, "Time", "s")
    return [
        "    -1",
        f"{first:<80}",
        *["NONE"] * 5,
        _places(function, (1, 1), (1, 1)),
        f"{kind:10d}{count:10d}{even:10d}{start:13.5E}{step:13.5E}{0.0:13.5E}",
        *(
            f"{number:10d}{0:5d}{0:5d}{0:5d} {label:<20} {unit:<20}"
            for number, label, unit in (axis, ordinate, denominator, NONE)
        ),
    ]


def write(path: Path, *sets: bytes) -> Path:
    """A file of datasets."""
    path.write_bytes(b"".join(sets))
    return path
