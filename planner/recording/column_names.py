"""What a file states of a channel: unit, to SI, name, direction, axis, sampling step and start.

In the name of its column, or as attributes of entries: "unit_string", "y_values.quantity.label"
(levels by points). What is not stated is never guessed.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from planner.recording.records import AXES
from planner.recording.sampling import Axis, common_step


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
# What samples stand at: units where none is said, and names.
_AXES = {
    "time": (Unit("time", "s", 1.0), ("time", "t", "zeit", "temps", "tempo", "tiempo")),
    "frequency": (
        Unit("frequency", "Hz", 1.0),
        ("frequency", "freq", "frequenz", "fréquence", "frecuencia", "frequenza"),
    ),
}


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


def axis_unit(name: str, stated: str, quantity: str) -> Unit | None:
    """The unit of a column of times ("time"), or of frequencies ("frequency"), None of any other.

    Where it is not said, s or Hz.
    """
    unit, (si, names) = lookup(stated or unit_text(name)), _AXES[quantity]
    if unit is None:
        return si if bare(name) in names else None
    return unit if unit.quantity == quantity else None


def says_something(name: str, stated: str = "") -> bool:
    """Whether name or unit say what a column holds."""
    said = stated or unit_text(name)
    axis = any(axis_unit(name, stated, quantity) for quantity in _AXES)
    return bool(axis or lookup(said) or lookup_ratio(said))


def direction_in(name: str) -> int:
    """±1, ±2, ±3 of the axis that a channel's name says ("Acc X", "a_-y"); 0 if it says none."""
    found = _DIRECTION.search(f"{name} ")
    return hit_direction(found[1] + found[2]) if found else 0


def hit_direction(text: str) -> int:
    """±1, ±2, ±3 of "+x" … "-z" ("x" means "+x"); 0 if it is none of them."""
    match = re.fullmatch(r"\s*([+-]?)([xyz])\s*", str(text).lower())
    if not match:
        return 0
    return (AXES.index(match[2]) + 1) * (-1 if match[1] == "-" else 1)


Attributes = Mapping[str, object]
# Keys, letters and digits alone, as measuring programs write them.
_NAMES = {"name", "channelname", "signalname", "label", "title", "names", "channelnames", "labels",
          "channels", "columns", "signals", "varnames", "nichannelname"}  # fmt: skip
_UNITS = {"unit", "units", "unitstring", "unitlabel", "yunit", "yunits", "yunitlabel",
          "niunitdescription", "engineeringunits", "engunits", "quantitylabel",
          "unitsymbol"}  # fmt: skip
_RATES = {"fs", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "fsample",
          "rate", "abtastrate", "abtastfrequenz"}  # fmt: skip
_STEPS = {"dt", "deltat", "deltax", "timestep", "increment", "xincrement", "xinc", "wfincrement",
          "timeincrement", "samplinginterval", "sampleinterval", "samplingperiod", "sampleperiod",
          "abtastintervall"}  # fmt: skip
_STARTS = {"start", "starttime", "startvalue", "startoffset", "t0", "tstart", "x0", "xstart",
           "timestart", "wfstarttime", "wfstartoffset"}  # fmt: skip
_ABSCISSA = re.compile(r"x|x.?(values?|axis|data)|abscissa|time.?(axis|base)")
_X_UNITS = {"xunit", "xunits", "xunitlabel", "wfxunitstring", "wfxunit"}
# Zero of LabVIEW's clock: what states it states no time.
_FIRST_DATE = np.datetime64("1904-01-03")


def name_of(attributes: Attributes) -> str:
    """The name stated of a channel, "" where none is."""
    each = _of_keys(attributes, _NAMES)
    return next((v for _, v in each if isinstance(v, str) and v and not lookup(v)), "")


def names_of(attributes: Attributes, count: int) -> tuple[str, ...]:
    """Names stated of `count` columns, () where none are."""
    units = _lists(_of_keys(attributes, _UNITS), count)
    each = _lists([*_of_keys(attributes, _NAMES), *attributes.items()], count)
    return next((v for v in each if v not in units and not all(map(lookup, v))), ())


def units_of(attributes: Attributes, count: int) -> tuple[str, ...]:
    """Units stated of `count` columns, each or of all; "" where none is."""
    stated = _lists(_of_keys(attributes, _UNITS), count)
    each = [*stated, *(v for v in _lists(attributes.items(), count) if all(map(lookup, v)))]
    return each[0] if each else (unit_of(attributes),) * count


def _lists(entries: Iterable[tuple[str, object]], count: int) -> list[tuple[str, ...]]:
    return [v for _, v in entries if isinstance(v, tuple) and len(v) == count > 1]


def unit_of(attributes: Attributes) -> str:
    """The unit stated of a channel, "" where none is."""
    return next((v for _, v in _of_keys(attributes, _UNITS) if isinstance(v, str) and v), "")


def rescaled(attributes: Attributes) -> str:
    """A factor or offset that is stated beside a unit, in words; "" where none is."""
    for key, value in attributes.items():
        what = key.rpartition(".")[2].lower()
        neutral = {"factor": 1.0, "offset": 0.0}.get(what, value)
        if "transformation" in key.lower() and isinstance(value, int | float) and value != neutral:
            return f"{what} {value:g}"
    return ""


def axis_of(path: Path, attributes: Attributes) -> Axis:
    """What samples stand at. Raises InputError where it is stated twice and differently."""
    on_axis = (
        lookup(value) for key, value in attributes.items()
        if isinstance(value, str) and (_on_abscissa(key) or set(_forms(key)) & _X_UNITS)
    )  # fmt: skip
    units = (unit for unit in on_axis if unit and unit.quantity in _AXES)
    quantity, _, factor = next(units, _AXES["time"][0])
    rates, steps, starts = (
        {key: n for key, v in _of_keys(attributes, keys)
         if (n := number(v, unit_text(key))) is not None}
        for keys in (_RATES, _STEPS, _STARTS)
    )  # fmt: skip
    stated = {key: 1 / rate for key, rate in rates.items() if rate}
    stated |= {key: step * factor for key, step in steps.items() if step}
    # Offset and date of the first sample, as LabVIEW means them, add up.
    offset = next((start * factor for start in starts.values()), None)
    dates = (date for _, v in _of_keys(attributes, _STARTS) if (date := _date(v)) is not None)
    return Axis(quantity, common_step(path, stated), offset, next(dates, None))


def is_axis(key: str) -> bool:
    """Whether an attribute is of one channel's axis, unit or name, and of no record."""
    known = _STEPS | _RATES | _STARTS | _UNITS | _NAMES | _X_UNITS
    return any(form in known for form in _forms(key))


def _date(value: object) -> float | None:
    """Seconds since 1970 of a date; None where it is none, or LabVIEW's zero."""
    if isinstance(value, str) and re.match(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d", value):
        try:
            value = np.datetime64(re.sub(r"(Z|[+-]\d\d:?\d\d)$", "", value.replace(" ", "T")), "us")
        except ValueError:
            return None
    if not isinstance(value, np.datetime64) or np.isnat(value) or value < _FIRST_DATE:
        return None
    return float((value - np.datetime64(0, "s")) / np.timedelta64(1, "us") * 1e-6)


def number(value: object, unit: str = "") -> float | None:
    """A number, or a text of one with its unit ("51.2 kHz", "0.1 ms") or in `unit`, in SI."""
    found = re.fullmatch(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*([a-zA-Zµμ]*)\s*", str(value))
    known = lookup((found and found[2]) or unit)
    factor = known.factor if known else 1.0
    if isinstance(value, int | float):
        return float(value) * factor
    if not found or found[1].count(".") > 1 or found[1].strip("+-.") == "":
        return None
    return float(found[1]) * factor


def _of_keys(attributes: Attributes, keys: set[str]) -> Iterator[tuple[str, object]]:
    """Attributes of these names; an abscissa's unit and label are of no channel."""
    of_channel = keys is _UNITS or keys is _NAMES
    for key, value in attributes.items():
        if keys.intersection(_forms(key)) and not (of_channel and _on_abscissa(key)):
            yield key, value


def is_abscissa(name: str) -> bool:
    """Whether a group or array of this name is what the samples of a channel stand at."""
    return _ABSCISSA.fullmatch(name.lower()) is not None


def _on_abscissa(key: str) -> bool:
    return any(is_abscissa(level) for level in key.split(".")[:-1])


def _forms(key: str) -> tuple[str, ...]:
    """Letters and digits of a key without its unit: of its last level, and of its last two."""
    levels = [re.sub(r"[^a-z0-9]", "", level) for level in bare(key).split(".")]
    return levels[-1], "".join(levels[-2:])
