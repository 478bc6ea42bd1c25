"""Named entries of files (MAT, HDF5, TDMS, LVM), level by level, and the columns among them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.recording.column_names import (
    Attributes,
    Unit,
    axis_of,
    axis_unit,
    is_abscissa,
    is_axis,
    lookup,
    name_of,
    names_of,
    rescaled,
    unit_of,
    unit_text,
    units_of,
)
from planner.recording.named_columns import Named, holds_frfs
from planner.recording.records import check_numbers
from planner.recording.sampling import common_step, sampling_rate

# A small file may unfold to any size: a hit of 5 channels at 100 kHz over 60 s is 240 MB.
LARGEST_BYTES = 384 * 1024 * 1024
MOST_ENTRIES = 10_000  # groups, arrays and texts of a file that are looked at
DEEPEST = 32  # levels


@dataclass(frozen=True, eq=False)
class EntryTree:
    """A group of a file, a struct, an array with what is stated of it.

    `attributes` are texts, single numbers, dates and lists of texts; `parts` further levels and
    arrays of numbers: (n,), (n, k) and what is no column. An array named "" is the level's own:
    a channel and what is stated of it.
    """

    attributes: Mapping[str, object] = field(default_factory=dict)
    parts: Mapping[str, "EntryTree | np.ndarray"] = field(default_factory=dict)
    unread: tuple[str, ...] = ()  # what is there and cannot be read, in words


def tree_of(
    entries: Mapping[str, object], attributes: Mapping[str, object] | None = None
) -> EntryTree:
    """A level from nested dicts (structs), lists (cells, arrays of structs), arrays and texts."""
    stated = dict(attributes_of(attributes or {}))
    parts: dict[str, EntryTree | np.ndarray] = {}
    unread = []
    for name, value in entries.items():
        while isinstance(value, list):
            value = _of_list(name, value)
        if isinstance(value, Mapping):
            value = tree_of(value)
        if isinstance(value, EntryTree):
            parts[name] = value
        elif value is None:
            unread.append(name)
        elif (found := _attribute(value)) is not None:
            stated[name] = found
        elif isinstance(value, np.ndarray) and value.size > 1 and value.dtype.kind in "fiubc":
            parts[name] = np.squeeze(value)
    return EntryTree(stated, parts, tuple(unread))


def attributes_of(entries: Mapping[str, object]) -> Iterator[tuple[str, object]]:
    """Of any entries those that are attributes."""
    for name, value in entries.items():
        found = _attribute(value)
        if found is not None:
            yield str(name), found


def text_of(value: object) -> str:
    """An attribute as text; what is no UTF-8 is Latin-1, as older analysers write it."""
    if not isinstance(value, bytes):
        return str(value)
    try:
        return value.decode()
    except UnicodeDecodeError:
        return value.decode("latin-1")


def check_size(path: Path, unfolded: int) -> None:
    """Raise InputError where a file's numbers would take too many bytes, before they are read."""
    if unfolded > LARGEST_BYTES:
        raise InputError(
            f"{path} unfolds to {unfolded >> 20} MiB, no single hit does; export a hit a file."
        )


def _attribute(value: object) -> object | None:
    """A text, number, date or list of texts (a tuple); None where it is none of them."""
    if isinstance(value, tuple):
        return tuple(text_of(v).strip() for v in value)
    if isinstance(value, str | bytes):
        return text_of(value).strip()
    array = np.asarray(value)
    kind, texts = array.dtype.kind, array.dtype.kind in "SUO"
    if array.size == 1 and (kind in "fiubSUM" or isinstance(array.item(), str | bytes)):
        only = array.reshape(())
        return text_of(array.item()).strip() if texts else only[()] if kind == "M" else only.item()
    if texts and array.size and all(isinstance(v, str | bytes) for v in array.flat):
        return tuple(text_of(v).strip() for v in array.flat)
    return None


def _of_list(name: str, values: list[object]) -> object:
    """A cell array or an array of structs: texts, columns, or elements by their numbers."""
    if len(values) == 1:
        return values[0]
    texts = tuple(v for v in values if isinstance(v, str))
    if len(texts) == len(values):
        return texts
    structs = [v for v in values if isinstance(v, Mapping)]
    if len(structs) == len(values) and (table := _of_structs(structs)):
        return table
    arrays = [np.squeeze(v) for v in values if isinstance(v, np.ndarray) and np.size(v) > 1]
    alike = len({a.shape for a in arrays}) == 1 and arrays[0].ndim == 1 and len(arrays) > 1
    if alike and len(arrays) + len(texts) == len(values):
        return EntryTree({"names": texts} if texts else {}, {"": np.column_stack(arrays)})
    return {f"{name} {number}": value for number, value in enumerate(values, 1)}


def _of_structs(values: Sequence[Mapping[str, object]]) -> dict[str, object]:
    """Structs of texts and numbers alone as lists of their texts: a table of channels."""
    each = [dict(attributes_of(v)) for v in values]
    if any(len(stated) != len(v) for stated, v in zip(each, values, strict=True)) or not each[0]:
        return {}
    found: dict[str, object] = {}
    for key in each[0]:
        column = [stated.get(key) for stated in each]
        if len(set(map(str, column))) == 1:
            found[key] = column[0]
        elif all(isinstance(v, str) for v in column):
            found[key] = tuple(column)
    return found


@dataclass(frozen=True, eq=False)
class EntryColumn:
    """An array of a file: a column, or one that lacks names (`lacks` says so).

    `name` is stated of it alone, `title` in a list of several; `stated` is all that is.
    """

    path: tuple[str, ...]
    values: np.ndarray  # (n,) unless it lacks something
    stated: Attributes
    name: str = ""
    title: str = ""
    unit: str = ""
    lacks: str = ""

    @property
    def last(self) -> str:
        """The last part of its place in the file."""
        return self.path[-1] if self.path else "data"

    @property
    def place(self) -> str:
        """Where it stands, for reading."""
        return "/".join(self.path) or "data"


def found_in(
    file: Path,
    tree: EntryTree,
    path: tuple[str, ...] = (),
    above: Sequence[tuple[bool, Attributes]] = (),
) -> Iterator[EntryColumn]:
    """Every array of a file, or below a group of it.

    `above`: what groups state, and whether of one array alone. Raises InputError where a channel's
    own times are uneven.
    """
    tree = _with_own_times(file, tree)
    here = [*above, (_arrays(tree) == 1, {**tree.attributes, **_beside(tree)})]
    for name, part in tree.parts.items():
        at = (*path, name) if name else path
        if isinstance(part, EntryTree):
            yield from found_in(file, part, at, here)
        else:
            own = {k: v for alone, of in here if alone for k, v in of.items()}
            own |= _of_one(name, here[-1][1])
            if path and not (unit_text(name) or axis_unit(name, "", "time")):
                unit = unit_of(here[-1][1])  # of all that is in the group
                own = {**({"unit": unit} if lookup(unit) else {}), **own}
            shared = {k: v for alone, of in here if not alone for k, v in of.items()}
            yield from _columns(at, part, own, shared)


def _of_one(name: str, beside: Attributes) -> dict[str, object]:
    """Of what is stated beside arrays that which names one: "Channel_1_Unit" of Channel_1_Data."""
    stems = [stem for stem in (name.rpartition("_")[0], name) if stem]
    return {
        key[len(stem) + 1 :]: value
        for stem in stems
        for key, value in beside.items()
        if key.startswith((f"{stem}_", f"{stem}."))
    }


def _columns(
    at: tuple[str, ...], values: np.ndarray, own: dict[str, object], shared: dict[str, object]
) -> Iterator[EntryColumn]:
    stated, name = {**shared, **own}, name_of(own)
    if values.ndim == 1:
        yield EntryColumn(at, values, stated, name, unit=unit_of(own))
        return
    for count, turned in ((values.shape[1], values), (values.shape[0], values.T)):
        for beside in (own, shared):
            if values.ndim == 2 and (titles := names_of(beside, count)):
                each = (units_of(of, count) for of in (own, shared))
                units = next((u for u in each if u[0]), ("",) * count)
                for title, unit, column in zip(titles, units, turned.T, strict=True):
                    yield EntryColumn(at, column, stated, name, title, unit)
                return
    lacks = f"{min(values.shape)} names beside it" if values.ndim == 2 else "one column an FRF"
    yield EntryColumn(at, values, stated, name, lacks=lacks)


def _arrays(part: EntryTree | np.ndarray) -> int:
    return sum(map(_arrays, part.parts.values())) if isinstance(part, EntryTree) else 1


def _beside(tree: EntryTree) -> dict[str, object]:
    """Attributes of the parts that hold no array: they tell of those beside them."""
    found: dict[str, object] = {}
    for name, part in tree.parts.items():
        if isinstance(part, EntryTree) and not _arrays(part):
            inner = {**part.attributes, **_beside(part)}
            found |= {f"{name}.{key}": value for key, value in inner.items()}
    return found


def _with_own_times(file: Path, tree: EntryTree) -> EntryTree:
    """A group with one array where its two are a channel and what its samples stand at."""
    holding = {n: p for n, p in tree.parts.items() if _arrays(p)}
    arrays = {n: only for n, p in holding.items() if (only := _only(p))}
    axes = {n: unit for n, (_, said) in arrays.items() if (unit := _axis_unit(n, said))}
    if len(holding) != 2 or len(arrays) != 2 or len(axes) != 1:
        return tree
    ((name, unit),) = axes.items()
    at = arrays[name][0] * unit.factor
    if len({array.shape for array, _ in arrays.values()}) > 1 or not np.isrealobj(at):
        return tree
    check_numbers(file, name, at)
    axis = {"dt": 1 / sampling_rate(file, at), "t0": float(at[0]), "x_unit": unit.si}
    rest = {n: p for n, p in tree.parts.items() if n != name}
    return EntryTree({**tree.attributes, **axis}, rest, tree.unread)


def _only(part: EntryTree | np.ndarray) -> tuple[np.ndarray, Attributes] | None:
    """The one column that a part holds and what is stated of it; None where it holds others."""
    if not isinstance(part, EntryTree):
        return (part, {}) if part.ndim == 1 else None
    inner = [p for p in part.parts.values() if _arrays(p)]
    found = _only(inner[0]) if len(inner) == 1 else None
    return (found[0], {**part.attributes, **_beside(part), **found[1]}) if found else None


def _axis_unit(name: str, said: Attributes) -> Unit | None:
    """The unit of what samples stand at, where a part is named so."""
    unit = lookup(unit_of(said))
    if unit and unit.quantity in ("time", "frequency") and is_abscissa(name):
        return unit
    return axis_unit(name, unit_of(said), "time")


def named_from(file: Path, columns: Sequence[EntryColumn], by_place: bool) -> Named:
    """Columns with their names: those stated of them, or (`by_place`) the last part of their place.

    Raises InputError where two have the same, or rates differ, or units are stated twice.
    """
    names = _names(file, columns, by_place)
    axes = {n: axis_of(file, c.stated) for n, c in zip(names, columns, strict=True)}
    for column in columns:
        if said := rescaled(column.stated):
            raise InputError(
                f"{file}: {column.place} is in {column.unit or 'a unit'} and has a {said} beside "
                f"it, so nothing says what its numbers are in; export it in N or m/s^2."
            )
    held = {n: c.values for n, c in zip(names, columns, strict=True)}
    units = {n: c.unit for n, c in zip(names, columns, strict=True) if c.unit}
    step = common_step(file, {n: axis.step for n, axis in axes.items() if axis.step})
    if step and any(axis.quantity == "frequency" for axis in axes.values()):
        first = min((a.offset for a in axes.values() if a.offset is not None), default=0.0)
        lines = np.arange(max(map(len, held.values()))) * step + first
        held = {"frequency_hz": lines, **held}
        if not holds_frfs(Named(held)):
            raise InputError(
                f"{file} holds spectra ({', '.join(names[:3])}, … over Hz) and no FRFs; export "
                f"time histories, or FRFs with real and imaginary part."
            )
    return Named(held, units, _attributes(columns), sampled=axes)


def _names(file: Path, columns: Sequence[EntryColumn], by_place: bool) -> list[str]:
    """A name for each, by which they differ."""
    names = [c.title or (not by_place and c.name) or c.last for c in columns]
    same = _grouped(names, columns)
    distinct = [
        _differing(column, same[name], columns) if len(same[name]) > 1 else name
        for name, column in zip(names, columns, strict=True)
    ]
    for alike in _grouped(distinct, columns).values():
        if len(alike) > 1:
            raise InputError(
                f"{file} holds {alike[0].title or alike[0].last} twice, as {alike[0].place} and as "
                f"{alike[1].place}; export each hit into a file of its own."
            )
    return distinct


def _grouped(names: Sequence[str], columns: Sequence[EntryColumn]) -> dict[str, list[EntryColumn]]:
    found: dict[str, list[EntryColumn]] = {}
    for name, column in zip(names, columns, strict=True):
        found.setdefault(name, []).append(column)
    return found


def _differing(
    column: EntryColumn, same: Sequence[EntryColumn], columns: Sequence[EntryColumn]
) -> str:
    """The last level at which places with one name differ, with what is below it.

    A group that holds one column names that by itself.
    """
    path, depth = column.path, 1
    while depth < min(len(c.path) for c in same) and len({c.path[-depth] for c in same}) == 1:
        depth += 1
    stem = path[: len(path) + 1 - depth]
    alone = sum(c.path[: len(stem)] == stem for c in columns) == 1
    return stem[-1] if stem and alone else " ".join(path[-depth:])


def _attributes(columns: Sequence[EntryColumn]) -> dict[str, str]:
    """What is stated of all columns, or of some and contradicted of none."""
    found: dict[str, set[str]] = {}
    for column in columns:
        for key, value in column.stated.items():
            if not isinstance(value, tuple) and not is_axis(key):
                found.setdefault(key.rpartition(".")[2], set()).add(text_of(value))
    return {name: texts.pop() for name, texts in found.items() if len(texts) == 1}
