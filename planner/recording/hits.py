"""Records to hits: force in N, three accelerations in m/s², one stated axis; nothing guessed."""

from collections.abc import Sequence

import numpy as np

from planner.errors import InputError
from planner.recording.named_columns import hit_direction
from planner.recording.records import AXES, Channel, Hit, Record, TimeRecord


def hits_from(records: Sequence[Record], axis: str | None = None) -> tuple[Hit, ...]:
    """The hits in a file's records; `axis` ("+x" … "-z") is what the table of recordings says.

    Raises InputError saying what the file holds instead of a hit.
    """
    times = [record for record in records if isinstance(record, TimeRecord)]
    if not times:
        raise InputError("The file holds no time histories; export force and accelerations.")
    return tuple(_hit(record, axis) for record in times)


def _hit(record: TimeRecord, axis: str | None) -> Hit:
    source = record.source
    forces = [c for c in record.channels if c.quantity == "force"]
    if len(forces) != 1:
        raise InputError(
            f"{source} holds {describe(record)}: a hit needs exactly one force in N; "
            f"export force and accelerations together."
        )
    accelerations = [c for c in record.channels if c.quantity == "acceleration"]
    directions = sorted(abs(c.direction) for c in accelerations)
    if directions != [1, 2, 3]:
        raise InputError(
            f"{source} holds {describe(record)}: a hit needs one acceleration in each of x, y and "
            f"z; export all three with their directions."
        )
    force, remarks = forces[0], list(record.remarks)
    for channel in (force, *accelerations):
        if not channel.unit:
            raise InputError(
                f"{source}: the unit of {channel.name} is not known; label it N or m/s^2."
            )
    samples = np.zeros((3, len(force.samples)))
    for channel in accelerations:
        samples[abs(channel.direction) - 1] = np.sign(channel.direction) * channel.samples
    name = _axis(record, force, axis, remarks)
    return Hit(
        source,
        name,
        record.sampling_rate_hz,
        force.samples,
        samples,
        remarks=tuple(remarks),
        simulated=record.simulated,
    )


def _axis(record: TimeRecord, force: Channel, axis: str | None, remarks: list[str]) -> str:
    stated = hit_direction(axis) if axis else 0
    if axis and not stated:
        raise InputError(f'{record.source}: hit "{axis}" is no signed axis such as +x; correct it.')
    own = force.direction if 1 <= abs(force.direction) <= 3 else 0
    if not own and not stated:
        raise InputError(
            f"{record.source} does not say along which axis it was hit; state it in the file "
            f"(ref_dir) or in recordings.csv (hit)."
        )
    if own and stated and own != stated:
        if abs(own) != abs(stated) or own < 0:
            raise InputError(
                f"{record.source} says it was hit along {_name(own)}, the table says "
                f"{_name(stated)}; correct the one that is wrong."
            )
        remarks.append(f"The file names the axis without its sign; {_name(stated)} is used.")
    return _name(stated or own)


def _name(direction: int) -> str:
    return ("-" if direction < 0 else "+") + AXES[abs(direction) - 1]


def describe(record: TimeRecord) -> str:
    """What a record holds, in words: "2 accelerations (m/s^2), 1 pressure (Pa)"."""
    counts: dict[str, int] = {}
    for channel in record.channels:
        known = channel.quantity != "unknown"
        text = f"{channel.quantity} ({channel.unit})" if known else "unlabelled record"
        counts[text] = counts.get(text, 0) + 1
    return ", ".join(f"{n} × {text}" for text, n in counts.items())
