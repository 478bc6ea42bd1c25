"""Named columns, wherever they were stored, to records: the one convention for all such files.

Time histories: `time_s` (or an attribute such as `sampling_rate_hz`), `force_n`,
`acceleration_x_m_s2`, `acceleration_y_m_s2`, `acceleration_z_m_s2`, attribute `hit` ("+x"); of a
sensor at a point of the robot `acceleration_NAME_x_m_s2`, attribute `hit_point` ("NAME"). Names as
people write them ("Time [s]", "Acc X (g)") say the same. FRFs: see `frf_columns`.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.recording.column_names import (
    bare,
    direction_in,
    hit_direction,
    lookup,
    time_unit,
    unit_text,
)
from planner.recording.records import Channel, Record, TimeRecord, check_numbers
from planner.recording.sampling import UNEVEN, aligned, sampling_rate
from planner.recording.stated import RATES, STEPS, number

_AT = re.compile(r"acceleration_(.+)_[xyz]$")


@dataclass(frozen=True)
class Named:
    """Columns by name, with units where stated, and attributes of the file.

    `start_s` says when a column begins (s), where the file does.
    """

    columns: Mapping[str, np.ndarray]
    units: Mapping[str, str] = field(default_factory=dict)
    attributes: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    start_s: Mapping[str, float] = field(default_factory=dict)

    def attribute(self, *names: str) -> str | None:
        """The first attribute of these names; letters alone count."""
        for key, value in self.attributes.items():
            if _letters(key) in names:
                return str(value)
        return None

    @property
    def simulated(self) -> bool:
        """Whether the file says that it holds simulated data."""
        value = self.attribute("simulated")
        return value is not None and value.strip().lower() not in ("", "0", "false", "no")

    def unit(self, name: str) -> str:
        """The unit of a column as stated beside it or in its name."""
        return self.units.get(name) or unit_text(name)


def _letters(text: str) -> str:
    return re.sub(r"[^a-z]", "", text.lower())


def to_records(path: Path, named: Named) -> tuple[Record, ...]:
    """Records of a file's named columns. Raises InputError saying what is wrong or missing."""
    from planner.recording.frf_columns import frf_record, holds_frfs

    if not named.columns:
        raise InputError(f"{path} holds no named columns of numbers; export time histories.")
    if holds_frfs(named):
        return (frf_record(path, named),)
    for name, values in named.columns.items():
        check_numbers(path, name, values)
        if np.iscomplexobj(values) and np.any(np.imag(values)):
            raise InputError(
                f"{path}: {name} holds complex numbers, which no time history does; export time "
                f"histories, or FRFs with their frequencies (frequency_hz, accelerance_xx)."
            )
    return (_time(path, named),)


def _time(path: Path, named: Named) -> TimeRecord:
    times = {n: u for n in named.columns if (u := time_unit(n, named.units.get(n, "")))}
    start_s = dict(named.start_s)
    rates = _stated_rates(path, named)
    current = next(iter(times), None)
    for name, values in named.columns.items():
        if name in times:
            current = name
            rates[name] = sampling_rate(path, np.real(values) * times[name].factor)
        if current is not None and len(times) > 1:
            first = float(np.real(named.columns[current][0])) * times[current].factor
            start_s.setdefault(name, first)
    if not rates:
        names = ", ".join(list(named.columns)[:6])
        raise InputError(
            f"{path} has neither a column time_s nor a sampling_rate_hz, nor FRFs over a column "
            f"frequency_hz; it has {names}: export one of them, with its name."
        )
    rate_hz = rates[min(rates, key=lambda name: name not in times)]
    for name, rate in rates.items():
        if not abs(rate / rate_hz - 1) < UNEVEN:
            first = "its time column one of" if times else "and also"
            raise InputError(
                f"{path} states a sampling rate of {rate:.6g} Hz ({name}), {first} "
                f"{rate_hz:.6g} Hz; correct the one that is wrong."
            )
    channels = [_channel(name, v, named) for name, v in named.columns.items() if name not in times]
    if not channels:
        raise InputError(f"{path} holds times and nothing else; export force and accelerations.")
    begin = [start_s.get(channel.name, 0.0) for channel in channels]
    common, remarks = aligned(path, channels, begin, rate_hz)
    return TimeRecord(path, rate_hz, common, (*named.remarks, *remarks), named.simulated)


def _stated_rates(path: Path, named: Named) -> dict[str, float]:
    """Rates in Hz that attributes state, by their names."""
    found = {}
    for key, text in named.attributes.items():
        name = _letters(bare(key))
        if name in RATES or name in STEPS:
            value = number(str(text), unit_text(key)) or 0.0
            if not 1e-9 < value < 1e9:
                raise InputError(
                    f"{path}: {key} {text} is no rate in Hz nor step in s; correct it."
                )
            found[key] = value if name in RATES else 1 / value
    return found


def _channel(name: str, values: np.ndarray, named: Named) -> Channel:
    unit = lookup(named.unit(name))
    quantity, si, factor = unit or ("unknown", "", 1.0)
    plain = re.sub(r"(_m_s2|_n|_g)$", "", name)
    at = _AT.match(plain)
    direction, node = direction_in(plain[at.end(1) :] if at else plain), at[1] if at else ""
    if quantity == "force":
        hit = named.attribute("hit")
        direction = hit_direction(hit) if hit else 0
        node = (named.attribute("hitpoint") or "").strip()
    return Channel(name, quantity, si, direction, np.real(values).astype(float) * factor, node)
