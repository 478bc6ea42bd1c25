"""What a file states of a channel beside its numbers: name, unit, sampling step and start.

Attributes are as entries have them: "unit_string", "y_values.quantity.label" (levels by points).
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.recording.column_names import lookup
from planner.recording.sampling import UNEVEN

Attributes = Mapping[str, object]
# Keys, letters and digits alone, as measuring programs write them.
_NAMES = {"name", "channelname", "signalname", "label", "title", "names", "channelnames", "labels",
          "channels", "columns", "signals", "varnames", "nichannelname"}  # fmt: skip
_UNITS = {"unit", "units", "unitstring", "unitlabel", "yunit", "yunits", "yunitlabel",
          "niunitdescription", "engineeringunits", "engunits", "quantitylabel",
          "unitsymbol"}  # fmt: skip
RATES = {"fs", "fshz", "samplerate", "sampleratehz", "samplingrate", "samplingratehz",
          "samplefrequency", "samplingfrequency", "samplingfrequencyhz", "fsample", "rate",
          "abtastrate", "abtastfrequenz"}  # fmt: skip
STEPS = {"dt", "dts", "deltat", "deltax", "timestep", "increment", "xincrement", "xinc",
          "wfincrement", "timeincrement", "samplinginterval", "sampleinterval", "samplingperiod",
          "sampleperiod", "abtastintervall"}  # fmt: skip
_STARTS = {"start", "starts", "starttime", "startvalue", "startoffset", "t0", "tstart", "x0",
           "xstart", "timestart", "wfstarttime", "wfstartoffset"}  # fmt: skip
_ABSCISSA = re.compile(r"x|x.?(values?|axis|data)|abscissa|time.?(axis|base)")
_X_UNITS = {"xunit", "xunits", "xunitlabel", "wfxunitstring", "wfxunit"}
# Zero of LabVIEW's clock: what states it states no time.
_FIRST_DATE = np.datetime64("1904-01-03")


@dataclass(frozen=True)
class Axis:
    """What the samples of a channel stand at: `step` and `offset` in s, or in Hz of a spectrum."""

    quantity: str  # "time" or "frequency"
    step: float | None
    offset: float | None  # of the first sample, from `date_s` where that is stated
    date_s: float | None  # since 1970


def name_of(attributes: Attributes) -> str:
    """The name stated of a channel, "" where none is."""
    found = (str(v) for _, v in _of_keys(attributes, _NAMES) if isinstance(v, str))
    return next((text for text in found if text and not lookup(text)), "")


def names_of(attributes: Attributes, count: int) -> tuple[str, ...]:
    """Names stated of `count` columns, () where none are."""
    named = _lists(_of_keys(attributes, _NAMES), count)
    units = _lists(_of_keys(attributes, _UNITS), count)
    each = [*named, *_lists(attributes.items(), count)]
    return next((v for v in each if v not in units and not _are_units(v)), ())


def units_of(attributes: Attributes, count: int) -> tuple[str, ...]:
    """Units stated of `count` columns, each or of all; "" where none is."""
    stated = _lists(_of_keys(attributes, _UNITS), count)
    each = [*stated, *(v for v in _lists(attributes.items(), count) if _are_units(v))]
    return each[0] if each else (unit_of(attributes),) * count


def _lists(entries: Iterable[tuple[str, object]], count: int) -> list[tuple[str, ...]]:
    return [v for _, v in entries if isinstance(v, tuple) and len(v) == count > 1]


def _are_units(texts: tuple[str, ...]) -> bool:
    return all(lookup(text) for text in texts)


def unit_of(attributes: Attributes) -> str:
    """The unit stated of a channel, "" where none is."""
    texts = (str(v) for _, v in _of_keys(attributes, _UNITS) if isinstance(v, str))
    return next((text for text in texts if text), "")


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
    steps = [n for _, v in _of_keys(attributes, STEPS) if (n := number(v)) is not None and n]
    rates = [n for _, v in _of_keys(attributes, RATES) if (n := number(v)) is not None and n]
    quantity, factor = _abscissa(attributes)
    found = [1 / rate for rate in rates] + [step * factor for step in steps]
    for step in found[1:]:
        if not abs(step - found[0]) <= UNEVEN * abs(found[0]):
            raise InputError(
                f"{path} states sampling steps of {found[0]:.6g} and {step:.6g} s for one channel; "
                f"correct the one that is wrong."
            )
    return Axis(quantity, found[0] if found else None, *_start(attributes, factor))


def is_axis(key: str) -> bool:
    """Whether an attribute is of one channel's axis, unit or name, and of no record."""
    known = STEPS | RATES | _STARTS | _UNITS | _NAMES | _X_UNITS
    return any(form in known for form in _forms(key))


def _abscissa(attributes: Attributes) -> tuple[str, float]:
    for key, value in attributes.items():
        if isinstance(value, str) and (_on_abscissa(key) or set(_forms(key)) & _X_UNITS):
            unit = lookup(value)
            if unit and unit.quantity in ("time", "frequency"):
                return unit.quantity, unit.factor
    return "time", 1.0


def _start(attributes: Attributes, factor: float) -> tuple[float | None, float | None]:
    """Offset and date of the first sample; as LabVIEW means them they add up."""
    values = [value for _, value in _of_keys(attributes, _STARTS)]
    dates = (date for value in values if (date := _date(value)) is not None)
    numbers = (n for value in values if (n := number(value)) is not None)
    offset = next(numbers, None)
    return None if offset is None else offset * factor, next(dates, None)


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
    if isinstance(value, int | float):
        return float(value)
    found = re.fullmatch(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*([a-zA-Zµμ]*)\s*", str(value))
    if not found or found[1].count(".") > 1 or found[1].strip("+-.") == "":
        return None
    known = lookup(found[2] or unit)
    return float(found[1]) * (known.factor if known else 1.0)


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
    """Letters and digits of a key: of its last level, and of its last two."""
    levels = [re.sub(r"[^a-z0-9]", "", level) for level in key.lower().split(".")]
    return levels[-1], "".join(levels[-2:])
