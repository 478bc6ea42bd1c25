"""What files of named entries hold (MAT, HDF5, TDMS, LVM), level by level, before it is read."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planner.errors import InputError

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
    if all(isinstance(v, Mapping) for v in values) and (table := _of_structs(values)):
        return table
    arrays = [np.squeeze(v) for v in values if isinstance(v, np.ndarray) and np.size(v) > 1]
    alike = len({a.shape for a in arrays}) == 1 and arrays[0].ndim == 1 and len(arrays) > 1
    if alike and len(arrays) + len(texts) == len(values):
        return EntryTree({"names": texts} if texts else {}, {"": np.column_stack(arrays)})
    return {f"{name} {number}": value for number, value in enumerate(values, 1)}


def _of_structs(values: list[object]) -> dict[str, object]:
    """Structs of texts and numbers alone as lists of their texts: a table of channels."""
    each = [dict(attributes_of(v)) for v in values if isinstance(v, Mapping)]
    raw = [v for v in values if isinstance(v, Mapping)]
    if any(len(stated) != len(v) for stated, v in zip(each, raw, strict=True)) or not each[0]:
        return {}
    found: dict[str, object] = {}
    for key in each[0]:
        column = [stated.get(key) for stated in each]
        if len(set(map(str, column))) == 1:
            found[key] = column[0]
        elif all(isinstance(v, str) for v in column):
            found[key] = tuple(column)
    return found
