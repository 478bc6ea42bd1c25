"""What the name of a column says: its unit, its direction, and whether it is an axis."""

import re

from planner.recording.records import AXES
from planner.recording.units import Unit, lookup, lookup_ratio

_SUFFIXES = {"n": "N", "m_s2": "m/s^2", "m_s": "m/s", "m": "m", "s": "s", "hz": "Hz", "v": "V",
             "pa": "Pa", "g": "g", "kn": "kN", "mm_s2": "mm/s^2", "cm_s2": "cm/s^2"}  # fmt: skip
_DIRECTION = re.compile(
    r"(?:^|[_\s.:])(?:a|acc|accel|acceleration)?[_\s]?([+-]?)([xyz])(?:$|[_\s(\[/,])", re.IGNORECASE
)
TIMES = ("time", "t", "zeit", "temps", "tempo", "tiempo")
FREQUENCIES = ("frequency", "freq", "frequenz", "fréquence", "frecuencia", "frequenza")


def unit_text(name: str) -> str:
    """The unit that a name ends with: "Force (N)", "Acc X [g]", "t/s", "Force, N", "force_n"."""
    return _parted(name)[1]


def bare(name: str) -> str:
    """A name without its unit, lower case."""
    return _parted(name)[0].lower().strip(" ,_\t")


def _parted(name: str) -> tuple[str, str]:
    """A name and its unit, "" where it has none."""
    plain = _without_number(name)
    if plain.endswith((")", "]")):
        at = _opened(plain)
        return plain[: max(at, 0)].rstrip("/ "), plain[at + 1 : -1].strip()
    if "," in plain:
        first, _, last = plain.rpartition(",")
        return first, last.strip()
    for at in (i for i, sign in enumerate(plain) if sign == "/" and i):
        if lookup(plain[at + 1 :]) or lookup_ratio(plain[at + 1 :]):
            return plain[:at], plain[at + 1 :].strip()
    for suffix in sorted(_SUFFIXES, key=len, reverse=True):
        if plain.lower().endswith(f"_{suffix}"):
            return plain[: -len(suffix) - 1], _SUFFIXES[suffix]
    return plain, ""


def _opened(name: str) -> int:
    """Where the bracket opens that ends a name; -1 where none does."""
    depth = 0
    for at in range(len(name) - 1, -1, -1):
        depth += (name[at] in ")]") - (name[at] in "([")
        if depth == 0:
            return at
    return -1


def _without_number(name: str) -> str:
    """Names that stand several times in a table are told apart by a number behind #."""
    return re.sub(r"\s*#\d+$", "", name).rstrip()


def time_unit(name: str, stated: str) -> Unit | None:
    """The unit of a column of times, in s where it is not said; None of any other column."""
    unit = lookup(stated or unit_text(name))
    if unit and unit.quantity == "time":
        return unit
    return lookup("s") if not unit and bare(name) in TIMES else None


def frequency_unit(name: str, stated: str) -> Unit | None:
    """The same of a column of frequencies, in Hz where it is not said."""
    unit = lookup(stated or unit_text(name))
    if unit and unit.quantity == "frequency":
        return unit
    return lookup("hz") if not unit and bare(name) in FREQUENCIES else None


def direction_in(name: str) -> int:
    """±1, ±2, ±3 of the axis that a channel's name says ("Acc X", "a_-y"); 0 if it says none."""
    found = _DIRECTION.search(f"{name} ")
    if not found:
        return 0
    return (AXES.index(found[2].lower()) + 1) * (-1 if found[1] == "-" else 1)


def hit_direction(text: str) -> int:
    """±1, ±2, ±3 of "+x" … "-z" ("x" means "+x"); 0 if it is none of them."""
    match = re.fullmatch(r"\s*([+-]?)([xyz])\s*", str(text).lower())
    if not match:
        return 0
    return (AXES.index(match[2]) + 1) * (-1 if match[1] == "-" else 1)
