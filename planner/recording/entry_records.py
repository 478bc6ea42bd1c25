"""Entries of a file to records: the parts that are a hit, or FRFs, each by themselves.

Nothing in such files says which group is a hit, which a list of settings. So all is tried as one
record; where that is no whole hit, group by group, then what has one length; what is whole counts.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from planner.errors import InputError
from planner.recording.column_names import lookup, says_something, unit_text
from planner.recording.entry_columns import EntryColumn, EntryTree, found_in, named_from
from planner.recording.named_columns import Named, holds_frfs, to_records
from planner.recording.records import FrfRecord, Record
from planner.recording.sampling import LEAST_SAMPLES

MOST_NAMED = 8  # arrays that a sentence names
OF_HITS = ("force", "acceleration", "velocity", "displacement")
LOOKED_FOR = (
    "of a hit time_s or sampling_rate_hz, force_n and acceleration_x_m_s2, … are looked for, of "
    "FRFs frequency_hz and receptance_xx, mobility_xx or accelerance_xx, …"
)
UNREAD = "a table, string array or object of MATLAB's own: save table2struct or cellstr of it"

Columns = tuple[EntryColumn, ...]
_Whole = tuple[Record, Columns]  # and the columns that it is of


def records_of(path: Path, root: EntryTree) -> tuple[Record, ...]:
    """Records of a file. Raises InputError saying what it holds and what that lacks."""
    found = tuple(found_in(path, root))
    columns = tuple(f for f in found if not f.lacks)
    others = tuple(f for f in found if f.lacks and max(f.values.shape) >= LEAST_SAMPLES)
    wholes = _wholes(path, columns)
    if wholes:
        used = {id(column) for _, own in wholes for column in own}
        left = [c for c in columns if id(c) not in used and len(c.values) >= LEAST_SAMPLES]
        remark = f"Left out, as no part of a hit: {_listed([*left, *others], False)}."
        remarks = (remark,) if left or others else ()
        return tuple(replace(record, remarks=record.remarks + remarks) for record, _ in wholes)
    if others or not any(_known(column) for column in columns):
        raise InputError(f"{path} holds {_held(found, root)}: {LOOKED_FOR}; name columns so.")
    try:  # what is no whole hit: responses alone, or what is to be refused in words
        return to_records(path, named_from(path, columns, False))
    except InputError:
        with suppress(InputError):
            return to_records(path, named_from(path, columns, True))
        raise


def _wholes(path: Path, columns: Columns) -> list[_Whole]:
    whole = _whole(path, columns)
    if whole:
        return [whole]
    each = [(part, _wholes(path, part)) for part in _groups(columns)]
    _no_hit_is_lost(path, each)
    if wholes := [whole for _, some in each for whole in some]:
        return wholes
    by_length: dict[int, list[EntryColumn]] = {}
    for column in columns:
        by_length.setdefault(len(column.values), []).append(column)
    for part in by_length.values() if len(by_length) > 1 else ():
        whole = _whole(path, tuple(part))
        if whole and not any(_belongs(c) for c in columns if len(c.values) != len(part[0].values)):
            return [whole]
    return []


def _whole(path: Path, columns: Columns) -> _Whole | None:
    """The record of some columns by either of their names; None where it is no whole hit."""
    for by_place in (False, True):
        try:
            (record,) = to_records(path, named_from(path, columns, by_place))
        except InputError:
            continue
        if isinstance(record, FrfRecord):
            return record, columns
        # Of a hit there is one force, and accelerations can be told apart.
        forces = [c for c in record.channels if c.quantity == "force"]
        felt = [(c.node, abs(c.direction)) for c in record.channels if c.quantity == "acceleration"]
        if len(forces) == 1 and felt and len(set(felt)) == len(felt):
            return record, columns
    return None


def _groups(columns: Columns) -> list[Columns]:
    """Columns group by group, where they first differ; each with those that belong to no group."""
    paths = [column.path for column in columns]
    depth = 0
    while paths and all(len(p) > depth + 1 for p in paths) and len({p[depth] for p in paths}) == 1:
        depth += 1
    grouped: dict[str, list[EntryColumn]] = {}
    common = []
    for column in columns:
        if len(column.path) > depth + 1:
            grouped.setdefault(column.path[depth], []).append(column)
        else:
            common.append(column)
    if len(grouped) < 2 - bool(common):
        return []
    if len(grouped) == 1:
        return [tuple(part) for part in grouped.values()]
    return [(*common, *part) for part in grouped.values()]


def _belongs(column: EntryColumn) -> bool:
    """Whether a column would be of a hit, or an FRF, had it the length of the others."""
    name = column.title or column.last
    unit = lookup(column.unit or unit_text(name))
    return bool(unit and unit.quantity in OF_HITS) or holds_frfs(Named({name: column.values}))


def _no_hit_is_lost(path: Path, each: Sequence[tuple[Columns, list[_Whole]]]) -> None:
    """Raise InputError where a part has the columns of whole hits and is none."""
    alike = {frozenset(c.title or c.last for c in part) for part, wholes in each if wholes}
    for part, wholes in each:
        if not wholes and frozenset(c.title or c.last for c in part) in alike:
            to_records(path, named_from(path, part, False))
            raise InputError(
                f"{path}: {part[-1].place} and what stands with it is no whole hit as the others "
                f"are; correct or leave it out."
            )


def _known(column: EntryColumn) -> bool:
    return says_something(column.title or column.last, column.unit)


def _held(found: Sequence[EntryColumn], root: EntryTree) -> str:
    unread = _unread(root)
    tables = f"{', '.join(unread[:MOST_NAMED])} ({UNREAD})"
    texts = [_listed(found, True)] * bool(found) + [tables] * bool(unread)
    return ", ".join(texts) or "no arrays of numbers"


def _unread(tree: EntryTree) -> list[str]:
    trees = (part for part in tree.parts.values() if isinstance(part, EntryTree))
    return [*tree.unread, *(name for part in trees for name in _unread(part))]


def _listed(found: Sequence[EntryColumn], lacking: bool) -> str:
    """Arrays with their shapes, and what each lacks."""
    texts = []
    for one in found[:MOST_NAMED]:
        shape = " × ".join(map(str, one.values.shape))
        lacks = one.lacks or ("" if _known(one) else "a known name or unit")
        texts.append(f"{one.place} ({shape}{f', lacks {lacks}' if lacks and lacking else ''})")
    more = len(found) - len(texts)
    return ", ".join(texts) + (f" and {more} more" if more else "")
