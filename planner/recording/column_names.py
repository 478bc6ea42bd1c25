"""Units as files state them, to SI, and what else the name of a column says: direction and axis.

What is not stated is never guessed.
"""

import re
from typing import NamedTuple

from planner.recording.records import AXES


class Unit(NamedTuple):
    """A unit: what it measures, its SI unit, and how many of those it is."""

    quantity: str
    si: str
    factor: float


_LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254,
            "inch": 0.0254, "ft": 0.3048, "mil": 2.54e-5}  # fmt: skip
_FORCES = {"n": 1.0, "newton": 1.0, "kn": 1e3, "mn": 1e-3, "dan": 10.0, "kgf": 9.80665,
           "kp": 9.80665, "gf": 9.80665e-3, "lbf": 4.4482216152605,
           "lb": 4.4482216152605}  # fmt: skip
_TIMES = {"s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "sek": 1.0, "ms": 1e-3, "msec": 1e-3,
          "us": 1e-6}  # fmt: skip
_OTHERS = {
    **{name: Unit("acceleration", "m/s^2", 9.80665) for name in ("g", "gn", "g0")},
    "mg": Unit("acceleration", "m/s^2", 9.80665e-3),
    "gal": Unit("acceleration", "m/s^2", 1e-2),
    "pa": Unit("pressure", "Pa", 1.0),
    **{name: Unit("voltage", "V", 1.0) for name in ("v", "volt", "volts")},
    "mv": Unit("voltage", "V", 1e-3),
    "hz": Unit("frequency", "Hz", 1.0),
    "khz": Unit("frequency", "Hz", 1e3),
    **{name: Unit("angle", "deg", 1.0) for name in ("deg", "degree", "degrees", "°", "grad")},
    **{name: Unit("angle", "deg", 57.29577951308232) for name in ("rad", "radian", "radians")},
}
_PER = ("/s2", "/s/s", "s-2", "/sec2")
_KNOWN: dict[str, Unit] = {
    **{name: Unit("displacement", "m", factor) for name, factor in _LENGTHS.items()},
    **{f"{name}/s": Unit("velocity", "m/s", factor) for name, factor in _LENGTHS.items()},
    **{
        name + per: Unit("acceleration", "m/s^2", f) for name, f in _LENGTHS.items() for per in _PER
    },
    **{name: Unit("force", "N", factor) for name, factor in _FORCES.items()},
    **{name: Unit("time", "s", factor) for name, factor in _TIMES.items()},
    **_OTHERS,
}
MOTIONS = {"acceleration": "accelerance", "velocity": "mobility", "displacement": "receptance"}
_SIGNS = str.maketrans({"²": "2", "µ": "u", "μ": "u", "−": "-", "⁻": "-", "·": "", "*": ""})


def lookup(text: str) -> Unit | None:
    """The unit that is written so ("m/s²", "kN", "[g]"), None if it is not known."""
    plain = re.sub(r"[\s\[\](){}^]", "", text.translate(_SIGNS))
    if re.match(r"M(N|g|V|G)", plain):
        return None  # mega, or milli in capitals: nothing says which
    plain = plain.lower()
    if plain.startswith("voltage"):
        plain = "v"
    return _KNOWN.get(plain)


def lookup_ratio(text: str) -> Unit | None:
    """The unit of an FRF that is written so ("(m/s²)/N", "g/lbf"); None if it is not known.

    `quantity` is then "accelerance", "mobility" or "receptance".
    """
    for at in (i for i, sign in reversed(list(enumerate(text))) if sign == "/"):
        top, bottom = lookup(text[:at]), lookup(text[at + 1 :])
        if top and bottom and top.quantity in MOTIONS and bottom.quantity == "force":
            return Unit(MOTIONS[top.quantity], f"{top.si}/N", top.factor / bottom.factor)
    return None


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
    # Names that stand several times in a table are told apart by a number behind #.
    plain = re.sub(r"\s*#\d+$", "", name).rstrip()
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
