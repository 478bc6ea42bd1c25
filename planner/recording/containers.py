"""HDF5 files (MATLAB's v7.3 among them; nothing is taken from other files), and TDMS files."""

import logging
import mmap
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from logging.handlers import BufferingHandler
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.errors import InputError
from planner.recording.entry_columns import DEEPEST, MOST_ENTRIES, EntryTree, check_size, tree_of
from planner.recording.entry_records import records_of
from planner.recording.records import Record

if TYPE_CHECKING:
    import h5py
    import nptdms

_SIZED = (f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
NUMBERS = {"double", "single", "logical", *_SIZED}


def read_hdf5(path: Path) -> tuple[Record, ...]:
    """HDF5 files: groups, datasets and their attributes; structs and cells of MATLAB's v7.3.

    Raises InputError where numbers lie in another file: the copy that a campaign keeps would be
    without them.
    """
    import h5py

    _check_texts(path)
    with h5py.File(path, "r") as file:
        root = _Reader(path).group(file)
    return records_of(path, root)


def _check_texts(path: Path) -> None:
    """Raise InputError where free space among texts has size 0: the library never ends there.

    Heaps of texts: signature and version, size, then parts of number, count, size (16 bytes) and
    data. Part 0 is free space, whose size counts these 16.
    """
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        for heap in re.finditer(rb"GCOL\x01\0\0\0", data):
            end = heap.start() + int.from_bytes(data[heap.end() : heap.end() + 8], "little")
            at = heap.end() + 8
            while at + 16 <= min(end, len(data)):
                number = int.from_bytes(data[at : at + 2], "little")
                size = int.from_bytes(data[at + 8 : at + 16], "little")
                if not number and size < 16:
                    raise InputError(f"{path} is damaged where its texts lie; export it again.")
                at += 16 + -(-size // 8) * 8 if number else size


class _Reader:
    """Reads a file's objects, not too many of them: references may lead in circles."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._left = MOST_ENTRIES
        self._bytes = 0
        self._seen: set[int] = set()

    def _enter(self, depth: int) -> None:
        self._left -= 1
        if depth > DEEPEST:
            raise InputError(f"{self._path} is nested too deep; export a hit a file.")
        if self._left < 0:
            raise InputError(f"{self._path} holds more than {MOST_ENTRIES} objects.")

    def _refuse_elsewhere(self, name: str, elsewhere: bool) -> None:
        if elsewhere:
            raise InputError(
                f"{self._path}: {name} lies in another file, which would not be kept; export all "
                f"channels into one file."
            )

    def group(self, group: "h5py.Group", depth: int = 0) -> EntryTree:
        """A group with what is in it; an array of structs is a list of them."""
        import h5py

        self._enter(depth)
        entries: dict[str, object] = {}
        for name in map(str, group):
            link = group.get(name, getlink=True)
            self._refuse_elsewhere(name, isinstance(link, h5py.ExternalLink))
            if name.startswith("#") or not isinstance(link, h5py.HardLink):
                continue  # MATLAB's own, and links to what is read elsewhere
            item = group[name]
            address = h5py.h5o.get_info(item.id).addr
            if address not in self._seen:  # by another name
                self._seen.add(address)
                entries[name] = self._item(item, depth + 1)
        return tree_of(entries, _attributes(group))

    def _item(self, item: object, depth: int) -> object:
        """What is in a group or dataset; nothing in what is neither."""
        import h5py

        if isinstance(item, h5py.Group):
            return self._struct(item, depth)
        return self._dataset(item, depth) if isinstance(item, h5py.Dataset) else {}

    def _struct(self, group: "h5py.Group", depth: int) -> object:
        """A group, or one struct after another where its fields are lists of references."""
        import h5py

        items = list(group.values()) if _stated(group, "MATLAB_class") == "struct" else []
        lists = [
            i for i in items
            if isinstance(i, h5py.Dataset) and i.dtype == h5py.ref_dtype
            and _stated(i, "MATLAB_class") is None
        ]  # fmt: skip
        if not items or len(lists) < len(items) or len({i.size for i in lists}) > 1:
            return self.group(group, depth)
        each = {name: self._elements(item, depth) for name, item in group.items()}
        return [dict(zip(each, values, strict=True)) for values in zip(*each.values(), strict=True)]

    def _elements(self, dataset: "h5py.Dataset", depth: int) -> list[object]:
        references = np.asarray(dataset[()]).ravel()
        return [self._item(dataset.file[r] if r else None, depth + 1) for r in references]

    def _dataset(self, dataset: "h5py.Dataset", depth: int) -> object:
        """Numbers, a text, a list, or a table's columns; with what is stated of them, a level."""
        import h5py

        self._enter(depth)
        elsewhere = dataset.is_virtual or bool(dataset.external)
        self._refuse_elsewhere(str(dataset.name).lstrip("/"), elsewhere)
        self._bytes += (dataset.size or 0) * dataset.dtype.itemsize
        check_size(self._path, self._bytes)
        kind = _stated(dataset, "MATLAB_class")
        if dataset.shape is None or "MATLAB_empty" in dataset.attrs:
            return {}
        if kind and dataset.dtype == h5py.ref_dtype:
            return self._elements(dataset, depth) if kind == "cell" else None
        if kind == "char":  # codes of UTF-16 in columns; several rows are a list
            rows = (row.astype("<u2").tobytes() for row in np.atleast_2d(dataset[()].T))
            texts = [row.decode("utf-16-le") for row in rows]
            return texts[0] if len(texts) == 1 else tuple(text.strip() for text in texts)
        values: Any = dataset[()]
        fields = dataset.dtype.names or ()
        if fields == ("real", "imag"):
            values, fields = values["real"] + 1j * values["imag"], ()
        if fields:
            return tree_of({name: values[name] for name in fields}, _attributes(dataset))
        if kind:
            return np.asarray(values).T if kind in NUMBERS else None
        stated = _attributes(dataset)
        return tree_of({"": values}, stated) if stated and np.size(values) > 1 else values


def _stated(item: "h5py.Dataset | h5py.Group", name: str) -> str | None:
    value = item.attrs.get(name)
    return value.decode() if isinstance(value, bytes) else None


def _attributes(item: "h5py.Dataset | h5py.Group") -> Mapping[str, object]:
    """What is stated of an object, without MATLAB's own and what cannot be read."""
    found = {}
    for name in item.attrs:
        if not name.startswith(("MATLAB_", "H5PATH")):
            try:
                found[name] = item.attrs[name]
            except (OSError, TypeError):  # of a kind that no attribute of a channel has
                continue
    return found


def read_tdms(path: Path) -> tuple[Record, ...]:
    """TDMS files; groups that are a hit each are a record each, texts and settings are left out.

    Raises InputError where it is damaged, and where channels were not sampled together.
    """
    with _warnings() as warned:
        root = _root(path)
    if warned:
        raise InputError(f"{path} is cut off ({warned[0].getMessage()}); export it again.")
    return records_of(path, root)


def _root(path: Path) -> EntryTree:
    from nptdms import TdmsFile

    with open(path, "rb") as opened, TdmsFile.open(opened, raw_timestamps=True) as file:
        groups = file.groups()
        check_size(path, sum(8 * len(c) for group in groups for c in group.channels()))
        found = {
            group.name: tree_of(
                {channel.name: _channel(channel) for channel in group.channels()},
                _properties(group.properties),
            )
            for group in groups
        }
        return tree_of(found, _properties(file.properties))


def _channel(channel: "nptdms.TdmsChannel") -> EntryTree:
    """A channel's numbers with its properties; dates are times in s. What is neither is empty."""
    values: Any = channel[:]
    if isinstance(values, np.ndarray) and values.dtype.names and values.size:
        seconds = (values["seconds"] - values["seconds"][0]).astype(float)
        return EntryTree({"unit": "s"}, {"": seconds + values["second_fractions"] / 2.0**64})
    if np.asarray(values).dtype.kind not in "fiubc":
        return EntryTree()
    return tree_of({"": np.asarray(values)}, _properties(channel.properties))


def _properties(properties: Mapping[str, Any]) -> dict[str, object]:
    """Properties with dates as NumPy has them."""
    return {
        name: value.as_datetime64("ns") if hasattr(value, "as_datetime64") else value
        for name, value in properties.items()
    }


@contextmanager
def _warnings() -> Iterator[list[logging.LogRecord]]:
    """What the library warns of: a file that is cut off, of which it then gives what there is."""
    kept = BufferingHandler(1000)
    kept.setLevel(logging.WARNING)
    logger = logging.getLogger("nptdms")
    logger.addHandler(kept)
    for name in list(logging.root.manager.loggerDict):
        if name.startswith("nptdms"):
            for handler in logging.getLogger(name).handlers:
                handler.setLevel(logging.WARNING if handler is kept else logging.CRITICAL)
    try:
        yield kept.buffer
    finally:
        logger.removeHandler(kept)
