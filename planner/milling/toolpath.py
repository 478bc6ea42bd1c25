"""Tool paths as CAM programs write them: G-code and APT (CLDATA) with a constant tool axis."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.errors import InputError

GCODE = (".nc", ".gcode", ".cnc", ".tap", ".mpf", ".ngc", ".eia", ".iso")
APT = (".apt", ".cls", ".cl", ".aptsource")
INCH, MM = 0.0254, 1e-3
ARC_STEP = np.deg2rad(5.0)
MOST_BYTES = 50_000_000
WORD = re.compile(r"([A-Z])\s*([-+]?(?:\d+\.?\d*|\.\d+))")
# Moves whose positions are not those of a plain path in the program's frame.
REFUSED = {
    **dict.fromkeys((5, 5.1, 6.2), "is a spline"),
    **dict.fromkeys((68, 68.1, 68.2, 16, 51), "turns or scales the frame"),
    **dict.fromkeys((10, 52, 92, 43.4, 43.5), "moves the frame"),
    **dict.fromkeys((73, 74, 76, *range(81, 90)), "is a drilling cycle"),
}
PLANES = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}


@dataclass(frozen=True, eq=False)
class Toolpath:
    """m straight moves that cut: starts and ends (m, 3) in m in the program's frame, file lines.

    `spindle` (3,) is the unit vector from the tip to the spindle.
    """

    start: np.ndarray
    end: np.ndarray
    line: tuple[int, ...]
    spindle: np.ndarray

    def points(self, count: int) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
        """Evenly along what is cut: positions and unit feeds (count, 3), names by file lines."""
        move = self.end - self.start
        length = np.linalg.norm(move, axis=1)
        at = np.cumsum(length)
        wanted = (np.arange(count) + 0.5) / count * at[-1]
        which = np.minimum(np.searchsorted(at, wanted), len(at) - 1)
        left = (at[which] - wanted) / length[which]
        position = self.end[which] - left[:, None] * move[which]
        names = [f"line {self.line[i]}" for i in which]
        several = [f"{n} ({names[: i + 1].count(n)})" if names.count(n) > 1 else n
                   for i, n in enumerate(names)]  # fmt: skip
        return position, move[which] / length[which, None], tuple(several)


def is_toolpath(path: Path) -> bool:
    """Whether a file's name says that it is a program rather than a table of poses."""
    return path.suffix.lower() in (*GCODE, *APT)


def read_toolpath(path: Path) -> Toolpath:
    """A program's cutting moves; InputError naming file, line and remedy."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"{path} is larger than {MOST_BYTES // 10**6} MB; give a part of it.")
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); name a file.") from None
    if path.suffix.lower() in APT:
        moves, spindle = _apt(path, text)
    else:
        moves, spindle = _gcode(path, text), np.array([0.0, 0.0, 1.0])
    kept = []
    for a, b, line in moves:
        length = np.linalg.norm(b - a)
        # From this share along the tool's axis on a move is a plunge, no milling.
        if length > 0 and abs((b - a) @ spindle) < 0.8 * length:
            kept.append((a, b, line))
    if not kept:
        raise InputError(f"{path} holds no cutting moves across the tool's axis; check the file.")
    start, end, lines = zip(*kept, strict=True)
    return Toolpath(np.array(start), np.array(end), tuple(lines), spindle)


Move = tuple[np.ndarray, np.ndarray, int]


def _gcode(path: Path, text: str) -> list[Move]:
    at, known, unit = np.zeros(3), np.zeros(3, bool), 0.0
    motion, plane, relative, turned = 0, 17, False, {}
    moves: list[Move] = []
    for number, raw in enumerate(text.splitlines(), 1):
        line = re.sub(r"\([^)]*\)|;.*|%.*", " ", raw.upper())
        words = [(letter, _number(path, number, value)) for letter, value in WORD.findall(line)]
        codes = [value for letter, value in words if letter == "G"]
        for code in codes:
            if code in REFUSED:
                raise InputError(
                    f"{path}, line {number}: G{code:g} {REFUSED[code]}, which is not followed; "
                    f"give positions by G1 to G3."
                )
            unit = {20: INCH, 70: INCH, 21: MM, 71: MM}.get(int(code), unit)
            relative = code == 91 if code in (90, 91) else relative
            plane = int(code) if code in PLANES else plane
            motion = int(code) if code in (0, 1, 2, 3) else motion
        given = {letter: value for letter, value in words if letter not in "GNM"}
        for letter in set("ABC") & set(given):
            if abs(given[letter] - turned.setdefault(letter, given[letter])) > 1e-6:
                raise InputError(
                    f"{path}, line {number}: {letter} turns the tool's axis, which has to be "
                    f"constant; give a path of one tool axis, or poses as CSV."
                )
        if not set("XYZ") & set(given) or {4.0, 28.0, 30.0, 53.0} & set(codes):
            continue
        if not unit:
            raise InputError(
                f"{path}, line {number}: neither G21 (mm) nor G20 (inch) says the unit; add it."
            )
        there = at.copy()
        for k, letter in enumerate("XYZ"):
            if letter in given:
                there[k] = given[letter] * unit + (at[k] if relative else 0.0)
                known[k] = True
        if motion and known.all():
            points = [there]
            if motion > 1:
                centre = {k: given[k] * unit for k in "IJKR" if k in given}
                points = _arc(
                    at, there, centre, PLANES[plane], motion == 2, f"{path}, line {number}"
                )
            for point in points:
                moves.append((at, point, number))
                at = point
        at = there
    return moves


def _number(path: Path, line: int, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{path}, line {line}: {text[:20]} is no number.") from None
    if not abs(value) < 1e7:
        raise InputError(f"{path}, line {line}: {text} is no coordinate; correct it.")
    return value


def _arc(
    a: np.ndarray, b: np.ndarray, given: dict[str, float], plane: tuple[int, int, int],
    clockwise: bool, where: str,
) -> list[np.ndarray]:  # fmt: skip
    """Points after a of an arc to b."""
    u, v, _ = plane
    p, q = a[[u, v]], b[[u, v]]
    if "R" in given:
        half, chord = (q - p) / 2, float(np.linalg.norm(q - p))
        radius = abs(given["R"])
        if not 0 < chord <= 2 * radius * (1 + 1e-6):
            raise InputError(f"{where}: no arc of that radius joins its ends; correct R.")
        height = np.sqrt(max(radius**2 - chord**2 / 4, 0.0))
        side = -1.0 if clockwise == (given["R"] > 0) else 1.0
        centre = p + half + side * height * np.array([-half[1], half[0]]) / (chord / 2)
    else:
        if not {"IJK"[u], "IJK"[v]} & set(given):
            raise InputError(f"{where}: an arc lacks its centre or radius; add I, J, K or R.")
        centre = p + np.array([given.get("IJK"[u], 0.0), given.get("IJK"[v], 0.0)])
    first, last = (np.arctan2(*(x - centre)[::-1]) for x in (p, q))
    swept = (first - last if clockwise else last - first) % (2 * np.pi) or 2 * np.pi
    swept = 2 * np.pi if swept < 1e-9 else swept
    count = int(np.ceil(swept / ARC_STEP))
    share = np.arange(1, count + 1) / count
    angle = first + (-1 if clockwise else 1) * swept * share
    points = a + (b - a) * share[:, None]
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points[:, [u, v]] = centre + np.linalg.norm(p - centre) * around
    points[-1] = b
    return list(points)


def _apt(path: Path, text: str) -> tuple[list[Move], np.ndarray]:
    at, unit, rapid = None, 0.0, False
    spindle: np.ndarray | None = None
    moves: list[Move] = []
    joined = re.sub(r"\$[ \t]*\n", " ", re.sub(r"\$\$.*", "", text.upper()))
    for number, line in enumerate(joined.splitlines(), 1):
        word, _, rest = (part.strip() for part in line.partition("/"))
        if word == "UNITS":
            unit = INCH if rest.startswith("INCH") else MM
        if word in ("RAPID", "CIRCLE"):
            rapid = word == "RAPID"
        if word not in ("GOTO", "FROM", "GODLTA"):
            continue
        values = np.array([_number(path, number, part.strip()) for part in rest.split(",")])
        if len(values) not in (3, 6):
            raise InputError(f"{path}, line {number}: {word} needs 3 or 6 numbers; correct it.")
        if not unit:
            raise InputError(f"{path}, line {number}: no UNITS/MM or UNITS/INCHES before; add it.")
        if len(values) == 6:
            axis = values[3:] / max(float(np.linalg.norm(values[3:])), 1e-300)
            spindle = axis if spindle is None else spindle
            # By which the tool's axis may differ along the path
            if np.linalg.norm(axis - spindle) > 1e-4:
                raise InputError(
                    f"{path}, line {number}: the tool's axis turns, but has to be constant; give a "
                    f"path of one tool axis, or poses as CSV."
                )
        there = values[:3] * unit + (at if word == "GODLTA" and at is not None else 0.0)
        if at is not None and word != "FROM" and not rapid:
            moves.append((at, there, number))
        at, rapid = there, False
    return moves, np.array([0.0, 0.0, 1.0]) if spindle is None else spindle
