"""Named columns, wherever they were stored, to records: the one convention for all such files.

Time histories: `time_s` (or an attribute such as `sampling_rate_hz`), `force_n`,
`acceleration_x_m_s2`, `acceleration_y_m_s2`, `acceleration_z_m_s2`, attribute `hit` ("+x"); of a
sensor at a point of the robot `acceleration_NAME_x_m_s2`, attribute `hit_point` ("NAME"). FRFs:
`frequency_hz` and `accelerance_xx` … (response, hit), complex or as `…_re`, `…_im`; between points
`accelerance_NAME_x_NAME_x`, response first; `coherence_xx`. Names as people and analysers write
them say the same: "Time [s]", "Acc X (g)", "Frequency (Hz)", "Real (m/N)", "Magnitude (dB)",
"Phase (deg)", with attributes `hit`, `response` ("+x") and `hit_point`, `response_point`.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.recording.column_names import (
    Unit,
    axis_of,
    axis_unit,
    bare,
    direction_in,
    hit_direction,
    lookup,
    lookup_ratio,
    unit_text,
)
from planner.recording.records import Channel, End, FrfRecord, Record, TimeRecord, check_numbers
from planner.recording.sampling import Axis, aligned, common_step, sampling_rate

_AT = re.compile(r"acceleration_(.+)_[xyz]$")


@dataclass(frozen=True)
class Named:
    """Columns by name, with units where stated, and attributes of the file.

    `sampled` is what the file states of single columns' samples.
    """

    columns: Mapping[str, np.ndarray]
    units: Mapping[str, str] = field(default_factory=dict)
    attributes: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    sampled: Mapping[str, Axis] = field(default_factory=dict)

    def attribute(self, *names: str) -> str | None:
        """The first attribute of these names; letters alone count."""
        each = self.attributes.items()
        return next((str(value) for key, value in each if _letters(key) in names), None)

    @property
    def simulated(self) -> bool:
        """Whether the file says that it holds simulated data."""
        value = self.attribute("simulated")
        return value is not None and value.strip().lower() not in ("", "0", "false", "no")

    def unit(self, name: str) -> str:
        """The unit of a column as stated beside it or in its name."""
        return self.units.get(name) or unit_text(name)

    def axis(self, name: str, quantity: str) -> Unit | None:
        """The unit of a column of times or frequencies ("time", "frequency"), None of others."""
        return axis_unit(name, self.units.get(name, ""), quantity)


def _letters(text: str) -> str:
    return re.sub(r"[^a-z]", "", text.lower())


def to_records(path: Path, named: Named) -> tuple[Record, ...]:
    """Records of a file's named columns. Raises InputError saying what is wrong or missing."""
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
    times = {n: np.real(v) * unit.factor for n, v in named.columns.items()
             if (unit := named.axis(n, "time"))}  # fmt: skip
    steps = {name: 1 / sampling_rate(path, at) for name, at in times.items()}
    steps |= {n: axis.step for n, axis in named.sampled.items() if axis.step and n not in times}
    if of_all := axis_of(path, named.attributes).step:
        steps["its header"] = of_all
    step = common_step(path, steps)
    if step is None:
        names = ", ".join(list(named.columns)[:6])
        raise InputError(
            f"{path} has neither a column time_s nor a sampling_rate_hz, nor FRFs over a column "
            f"frequency_hz; it has {names}: export one of them, with its name."
        )
    channels, axes, current = [], [], next(iter(times), "")
    for name, values in named.columns.items():
        if name in times:
            current = name
            continue
        channels.append(_channel(name, values, named))
        # Of several columns of times each is of those that follow it.
        start = float(times[current][0]) if len(times) > 1 else None
        axes.append(named.sampled.get(name, Axis(offset=start)))
    if not channels:
        raise InputError(f"{path} holds times and nothing else; export force and accelerations.")
    rate_hz = float(f"{1 / step:.12g}")  # quotients round the last digits
    common, remarks = aligned(path, channels, axes, rate_hz)
    return TimeRecord(path, rate_hz, common, (*named.remarks, *remarks), named.simulated)


def _channel(name: str, values: np.ndarray, named: Named) -> Channel:
    quantity, si, factor = lookup(named.unit(name)) or Unit("unknown", "", 1.0)
    plain = re.sub(r"(_m_s2|_n|_g)$", "", name)
    at = _AT.match(plain)
    direction, node = direction_in(plain[at.end(1) :] if at else plain), at[1] if at else ""
    if quantity == "force":
        hit = named.attribute("hit")
        direction = hit_direction(hit) if hit else 0
        node = (named.attribute("hitpoint") or "").strip()
    return Channel(name, quantity, si, direction, np.real(values).astype(float) * factor, node)


_KIND = "(accelerance|mobility|receptance|coherence)_"
_OWN = re.compile(rf"{_KIND}()([xyz])()([xyz])(_re|_im|)$", re.IGNORECASE)
_BETWEEN = re.compile(rf"{_KIND}(.+)_([xyz])_(.+)_([xyz])(_re|_im|)$")
_SI = {"accelerance": "m/s^2/N", "mobility": "m/s/N", "receptance": "m/N", "unknown": ""}
_WORDS = {
    "im": r"im|imag|imaginary|imaginär|imaginärteil|imaginaire",
    "re": r"re|real|realteil|réel|réelle|reell",
    "phase": r"phase|phas|phi|angle|arg|winkel",
    "coherence": r"coherence|coh|cohérence|kohärenz|coherencia",
    "magnitude": r"magnitude|mag|amplitude|ampl|amp|betrag|abs|modulus|module|\|[^|]*\|",
}
_PARTS = {part: re.compile(rf"(?<![^\W_])({words})(?![^\W_])") for part, words in _WORDS.items()}
_KINDS = {"accelerance": "accelerance|inertance", "mobility": "mobility",
          "receptance": "receptance|compliance|flexibility"}  # fmt: skip
_COMPLETE = ({"complex"}, {"re", "im"}, {"magnitude", "phase"})


@dataclass
class _Entry:
    """One FRF while its columns are gathered; `parts` are names of columns."""

    stem: str
    kind: str = "unknown"
    place: tuple[End, End] | None = None
    parts: dict[str, str] = field(default_factory=dict)

    def takes(self, part: str) -> bool:
        """Whether a further part may belong to it."""
        return part not in self.parts and any(
            {part, *self.parts} - {"coherence"} <= whole for whole in _COMPLETE
        )


def holds_frfs(named: Named) -> bool:
    """Whether the columns are FRFs (of one, or lacking some): values over frequency."""
    if any(_own(name) for name in named.columns):
        return True
    over_frequency = any(named.axis(name, "frequency") for name in named.columns)
    return over_frequency and any(_part(name, named) for name in named.columns)


def frf_record(path: Path, named: Named) -> FrfRecord:
    """The FRFs of a file's columns. Raises InputError saying what is wrong or missing."""
    axes = {name: unit for name in named.columns if (unit := named.axis(name, "frequency"))}
    if not axes:
        raise InputError(f"{path} holds FRFs but no column frequency_hz; export it too.")
    axis, unit = next(iter(axes.items()))
    frequency = np.real(named.columns[axis]) * unit.factor
    # The line at 0 Hz is used nowhere, and is often none (infinitely many dB below, no phase).
    keep = slice(int(len(frequency) > 1 and frequency[0] == 0), None)
    entries = _entries(named)
    if not entries:
        raise InputError(f"{path} holds frequencies and no FRFs; export FRFs, not spectra.")
    for entry in entries:
        for name in entry.parts.values():
            if len(named.columns[name]) != len(frequency):
                raise InputError(
                    f"{path}: column {name} has {len(named.columns[name])} values for "
                    f"{len(frequency)} frequencies; export them together."
                )
            check_numbers(path, name, named.columns[name][keep])
    read = [_values(path, entry, named) for entry in entries]
    kinds = {kind for kind, _, _ in read}
    if len(kinds) != 1:
        raise InputError(f"{path} mixes {' and '.join(sorted(kinds))}; export one kind.")
    kind, unit = kinds.pop(), _SI[read[0][0]] if all(stated for _, stated, _ in read) else ""
    unknown = np.full(len(frequency), np.nan)
    coherence = [
        np.real(named.columns[e.parts["coherence"]]) if "coherence" in e.parts else unknown
        for e in entries
    ]
    # Where they were felt and hit, as columns' names say, or the first lines of a file with one.
    alone = len(entries) == 1
    felt = _end(named, "response", "resp", "output") if alone else End("", 0)
    hit = _end(named, "hit", "reference", "ref", "input", "excitation")
    said = [felt._replace(direction=direction_in(e.stem) or felt.direction) for e in entries]
    places = tuple(e.place or (end, hit) for e, end in zip(entries, said, strict=True))
    frfs = np.array([values[keep] for _, _, values in read])
    return FrfRecord(
        path, frequency[keep], frfs, places, kind, unit, np.array(coherence)[:, keep],
        named.remarks, named.simulated,
    )  # fmt: skip


def _own(name: str) -> tuple[str, tuple[End, End], str] | None:
    """Quantity, place, and "_re", "_im" or "" of a column that has one of planner's names."""
    found = _OWN.match(name) or _BETWEEN.match(name)
    if not found:
        return None
    kind, felt, i, hit, j, part = found.groups()
    return kind.lower(), (End(felt, hit_direction(i)), End(hit, hit_direction(j))), part.lower()


def _part(name: str, named: Named) -> str:
    """Which part of an FRF a column holds ("re", "phase", …); "" where it is none."""
    if np.iscomplexobj(named.columns[name]):
        return "complex"
    plain = bare(name)
    return next((part for part, words in _PARTS.items() if words.search(plain)), "")


def _entries(named: Named) -> list[_Entry]:
    """The columns FRF by FRF: parts belong together by their names, else by their order."""
    entries: list[_Entry] = []
    for name in named.columns:
        own = _own(name)
        if own:
            part = "coherence" if own[0] == "coherence" else own[2].strip("_") or "complex"
            stem, kind, place = str(own[1]), own[0], own[1]
        else:
            part = "" if named.axis(name, "frequency") else _part(name, named)
            # The stem is what a name says beside its part.
            stem, place, plain = bare(name), None, name.lower()
            stem = _PARTS[part].sub("", stem).strip(" _") if part in _PARTS else stem
            kinds = (kind for kind, words in _KINDS.items() if re.search(words, plain))
            kind = next(kinds, "unknown")
        if not part:
            continue
        free = [entry for entry in entries if entry.takes(part)]
        same = [entry for entry in free if entry.stem == stem and entry.place == place]
        if not same and (own or not free or part in ("re", "magnitude", "complex")):
            entries.append(_Entry(stem, place=place))
        entry = (same or ([] if own else free) or entries)[0 if same else -1]
        entry.parts[part] = name
        if part != "coherence" and kind != "unknown":
            entry.kind = kind
    return [entry for entry in entries if set(entry.parts) - {"coherence"}]


def _values(path: Path, entry: _Entry, named: Named) -> tuple[str, bool, np.ndarray]:
    """Kind of one FRF, whether its unit is known, and its values (F,) in SI units."""
    parts = {part: named.columns[name] for part, name in entry.parts.items() if part != "coherence"}
    if set(parts) not in _COMPLETE:
        raise InputError(
            f"{path} holds {', '.join(entry.parts.values())} without the other part; export real "
            f"and imaginary part, or magnitude and phase."
        )
    first = next(part for part in ("complex", "re", "magnitude", "im") if part in parts)
    stated = named.unit(entry.parts[first])
    unit = lookup_ratio(
        re.sub(r"(?i)\bdb\b|\bref?\b\.?|\brel\b\.?|(?<![\w.])1(?![\w.])", "", stated)
    )
    if unit and entry.kind not in ("unknown", unit.quantity):
        raise InputError(
            f"{path}: {entry.parts[first]} names {entry.kind} and states {stated}, which is "
            f"{unit.quantity}; correct the one that is wrong."
        )
    known = unit is not None or (entry.place is not None and not stated)
    factor = unit.factor if unit else 1.0
    kind = unit.quantity if unit else entry.kind
    if first == "magnitude":
        return kind, known, factor * _polar(path, entry, named, "db" in stated.lower())
    values = parts.get("complex", parts.get("re", 0.0)) + 1j * np.real(parts.get("im", 0.0))
    return kind, known, np.asarray(factor * values)


def _polar(path: Path, entry: _Entry, named: Named, in_db: bool) -> np.ndarray:
    """Complex values (F,) of a magnitude and a phase."""
    magnitude, phase = (np.real(named.columns[entry.parts[p]]) for p in ("magnitude", "phase"))
    in_db = in_db or bool(re.search(r"\bdb\b", entry.parts["magnitude"].lower()))
    unit = lookup(named.unit(entry.parts["phase"]))
    if unit is None or unit.quantity != "angle":
        raise InputError(
            f"{path} does not say whether {entry.parts['phase']} is in degrees or radians; name "
            f"the column Phase (deg) or Phase (rad)."
        )
    size = 10.0 ** (magnitude / 20) if in_db else magnitude
    return size * np.exp(1j * np.deg2rad(phase * unit.factor))


def _end(named: Named, *words: str) -> End:
    """Direction and point of one end, as attributes such as `hit`, `Ref DOF` say ("+x", "3:+x")."""
    direction, point = 0, named.attribute(*(f"{word}point" for word in words)) or ""
    for word in words:
        for end in ("", "dof", "direction", "node", "chan", "channel"):
            found = re.fullmatch(
                r"\s*(?:([\w ]+?)[:.\s])?\s*([+-]?[xyzXYZ])\s*", named.attribute(word + end) or ""
            )
            if found and not direction:
                direction = hit_direction(found[2])
                # A number of a channel is no number of a node.
                point = point or (found[1] or "" if end in ("dof", "node") else "")
    return End(point.strip(), direction)
