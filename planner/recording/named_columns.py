"""Named columns, wherever they were stored, to records: the one convention for all such files.

Time histories: `time_s` (or an attribute `sampling_rate_hz`), `force_n`,
`acceleration_x_m_s2`, `acceleration_y_m_s2`, `acceleration_z_m_s2`, attribute `hit` ("+x"); of a
sensor at a point of the robot `acceleration_NAME_x_m_s2`, attribute `hit_point` ("NAME").
FRFs: `frequency_hz` and `accelerance_xx` … (response, hit), complex or as `…_re`, `…_im`; between
points `accelerance_NAME_x_NAME_x`, response first.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.recording.records import AXES, Channel, FrfRecord, Record, TimeRecord
from planner.recording.units import lookup

_SUFFIXES = {"n": "N", "m_s2": "m/s^2", "m_s": "m/s", "m": "m", "s": "s", "hz": "Hz", "v": "V",
             "pa": "Pa", "g": "g", "kn": "kN", "mm_s2": "mm/s^2", "cm_s2": "cm/s^2"}  # fmt: skip
_DIRECTION = re.compile(r"(?:^|[_\s])([+-]?)([xyz])(?:$|[_\s(\[])", re.IGNORECASE)
_AT = re.compile(r"acceleration_(.+)_[xyz]$")
_FRF = re.compile(r"(accelerance|mobility|receptance)_([xyz])([xyz])(_re|_im|)$")
_BETWEEN = re.compile(r"(accelerance|mobility|receptance)_(.+)_([xyz])_(.+)_([xyz])(_re|_im|)$")
UNEVEN = 1e-3  # share of a step by which sampling times may scatter (rounding in text files)


@dataclass(frozen=True)
class Named:
    """Columns by name, with units where stated, and attributes of the file."""

    columns: Mapping[str, np.ndarray]
    units: Mapping[str, str] = field(default_factory=dict)
    attributes: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


def to_records(path: Path, named: Named) -> tuple[Record, ...]:
    """Records of a file's named columns. Raises InputError saying what is wrong or missing."""
    if not named.columns:
        raise InputError(f"{path} holds no named columns of numbers; export time histories.")
    for name, values in named.columns.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise InputError(
                f"{path}: column {name}, sample {bad[0] + 1} is not a finite number; export again."
            )
    if any(_frf_name(name) for name in named.columns):
        return (_frf(path, named),)
    return (_time(path, named),)


def _attribute(named: Named, name: str) -> str | None:
    wanted = re.sub(r"[^a-z]", "", name.lower())
    for key, value in named.attributes.items():
        if re.sub(r"[^a-z]", "", key.lower()) == wanted:
            return value
    return None


def _simulated(named: Named) -> bool:
    value = _attribute(named, "simulated")
    return value is not None and value.strip().lower() not in ("", "0", "false", "no")


def _time(path: Path, named: Named) -> TimeRecord:
    time_name = next((n for n in named.columns if _is_time(n, named.units.get(n, ""))), None)
    rate = _attribute(named, "sampling_rate_hz")
    if time_name is not None:
        factor = (lookup(named.units.get(time_name, "s")) or ("", "s", 1.0))[2]
        rate_hz = sampling_rate(path, named.columns[time_name] * factor)
        if rate is not None and not abs(_positive(path, rate) / rate_hz - 1) < UNEVEN:
            raise InputError(
                f"{path} states a sampling rate of {rate} Hz, its time column one of "
                f"{rate_hz:.6g} Hz; correct the one that is wrong."
            )
    elif rate is not None:
        rate_hz = _positive(path, rate)
    else:
        raise InputError(
            f"{path} has neither a column time_s nor a sampling_rate_hz; export one of them."
        )
    channels = [
        _channel(name, values, named) for name, values in named.columns.items() if name != time_name
    ]
    lengths = {len(channel.samples) for channel in channels}
    if len(lengths) != 1:
        raise InputError(f"{path} has columns of {len(lengths)} lengths; export them together.")
    return TimeRecord(path, rate_hz, tuple(channels), named.remarks, _simulated(named))


def _positive(path: Path, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0 < value < 1e9:
        raise InputError(f"{path}: sampling rate {text} is no rate in Hz; correct it.")
    return value


def _is_time(name: str, unit: str) -> bool:
    plain = name.strip().lower()
    stated = lookup(unit)
    return plain in ("time_s", "time", "t", "t_s") or bool(stated and stated[0] == "time")


def sampling_rate(path: Path, time_s: np.ndarray) -> float:
    """Rate in Hz of sampling times (n,) in s; InputError if they are not evenly spaced."""
    if len(time_s) < 8:
        raise InputError(f"{path} holds {len(time_s)} samples; a hit has hundreds: export again.")
    step = (time_s[-1] - time_s[0]) / (len(time_s) - 1)
    if not step > 0:
        raise InputError(f"{path}: the time column does not increase; check the columns.")
    off = np.abs(np.diff(time_s) - step)
    digits = np.finfo(np.float32).eps * max(abs(time_s[0]), abs(time_s[-1]))
    if np.max(off) > max(UNEVEN * step, 4 * digits) and np.max(off) > 0.02 * step:
        row = int(np.argmax(off)) + 2
        raise InputError(
            f"{path}: time step {row} differs from the others; samples must be evenly spaced."
        )
    return float(1 / step)


def _channel(name: str, values: np.ndarray, named: Named) -> Channel:
    unit = named.units.get(name) or _unit_of_name(name)
    known = lookup(unit) if unit else None
    quantity, si, factor = known or ("unknown", "", 1.0)
    plain = re.sub(r"(_m_s2|_n|_g)$", "", name)
    at = _AT.match(plain)
    match = _DIRECTION.search(plain[at.end(1) :] + " " if at else plain.lower() + " ")
    direction, node = 0, at[1] if at else ""
    if match:
        direction = (AXES.index(match[2].lower()) + 1) * (-1 if match[1] == "-" else 1)
    if quantity == "force":
        hit = _attribute(named, "hit")
        direction = hit_direction(hit) if hit else 0
        node = (_attribute(named, "hit_point") or "").strip()
    return Channel(name, quantity, si, direction, np.asarray(values, dtype=float) * factor, node)


def _unit_of_name(name: str) -> str:
    plain = name.rstrip()
    opened = max(plain.rfind("("), plain.rfind("["))
    if opened >= 0 and plain.endswith((")", "]")):
        return plain[opened + 1 : -1]
    for suffix in sorted(_SUFFIXES, key=len, reverse=True):
        if name.lower().endswith(f"_{suffix}"):
            return _SUFFIXES[suffix]
    return ""


def hit_direction(text: str) -> int:
    """±1, ±2, ±3 of "+x" … "-z" ("x" means "+x"); 0 if it is none of them."""
    match = re.fullmatch(r"\s*([+-]?)([xyz])\s*", str(text).lower())
    if not match:
        return 0
    return (AXES.index(match[2]) + 1) * (-1 if match[1] == "-" else 1)


def _frf_name(name: str) -> tuple[str, tuple[str, str, str, str], str] | None:
    """Quantity, (point, axis) of response and of hit, "_re", "_im" or "" of a column's name."""
    match = _FRF.match(name.lower())
    if match:
        return match[1], ("", match[2], "", match[3]), match[4]
    match = _BETWEEN.match(name)
    if match:
        return match[1], (match[2], match[3], match[4], match[5]), match[6]
    return None


def _frf(path: Path, named: Named) -> FrfRecord:
    columns = {name: np.asarray(values) for name, values in named.columns.items()}
    lower = {name.lower(): values for name, values in columns.items()}
    if "frequency_hz" not in lower:
        raise InputError(f"{path} holds FRFs but no column frequency_hz; export it too.")
    lines = len(lower["frequency_hz"])
    for name, column in columns.items():
        known = _frf_name(name) or name.lower().startswith("coherence_")
        if known and len(column) != lines:
            raise InputError(
                f"{path}: column {name} has {len(column)} values for {lines} frequencies; "
                f"export them together."
            )
    values: dict[tuple[str, tuple[str, str, str, str]], np.ndarray] = {}
    for name, column in columns.items():
        found = _frf_name(name)
        if found:
            part = column * (1j if found[2] == "_im" else 1.0)
            values[found[:2]] = values.get(found[:2], 0.0) + part
    quantities = {key[0] for key in values}
    if len(quantities) != 1:
        raise InputError(f"{path} mixes {' and '.join(sorted(quantities))}; export one kind.")
    quantity = quantities.pop()
    frequency = np.real(lower["frequency_hz"])
    unknown = np.full(len(frequency), np.nan)
    coherence = [np.real(lower.get(_coherence(*at), unknown)) for _, at in values]
    unit = {"accelerance": "m/s^2/N", "mobility": "m/s/N", "receptance": "m/N"}[quantity]
    return FrfRecord(
        path,
        frequency,
        np.array([v.astype(complex) for v in values.values()]),
        tuple(AXES.index(at[1]) + 1 for _, at in values),
        tuple(AXES.index(at[3]) + 1 for _, at in values),
        quantity,
        unit,
        np.array(coherence),
        named.remarks,
        _simulated(named),
        tuple(at[0] for _, at in values),
        tuple(at[2] for _, at in values),
    )


def _coherence(point: str, response: str, hit_point: str, hit: str) -> str:
    """The column of an FRF's coherence, in lower case."""
    if not point:
        return f"coherence_{response}{hit}"
    return f"coherence_{point}_{response}_{hit_point}_{hit}".lower()
