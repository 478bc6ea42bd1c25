"""Records to hits: force in N, accelerations in m/s², one stated axis; nothing guessed."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.errors import AxisNotStatedError, InputError
from planner.recording.column_names import hit_direction
from planner.recording.points import NOT_STATED, SENSOR, Dof, StatedPoints
from planner.recording.records import (
    AXES,
    NOTICED,
    Channel,
    End,
    Fault,
    FrfRecord,
    Hit,
    Record,
    TimeRecord,
)

# How files of a kind state the axis of a hit.
STATED_IN = {
    **dict.fromkeys(("csv", "tsv", "txt"), 'begin the file with a line such as "# hit: +x"'),
    **dict.fromkeys(("uff", "unv", "uf58"), "state it in the file (ref_dir)"),
    "lvm": "write it into its header, as a line of hit, a tab and +x",
    "wav": 'state it in channels.csv (column hit, such as "+x")',
}


def hits_from(
    records: Sequence[Record], axis: str | None = None, stated: StatedPoints | None = None
) -> tuple[Hit, ...]:
    """The hits in a file's records.

    `axis` ("+x" … "-z") and `stated` are what the table of recordings says. Raises InputError
    saying what the file holds instead of a hit, or which point it names that is none.
    """
    times = [record for record in records if isinstance(record, TimeRecord)]
    if not times:
        raise InputError("The file holds no time histories; export force and accelerations.")
    return tuple(_hit(record, axis, stated or StatedPoints()) for record in times)


def with_axes(record: FrfRecord, hit: str | None, response: str | None) -> FrfRecord:
    """FRFs with axes that they do not state: signed axes as the table of recordings has them.

    Raises InputError where file and table name different axes.
    """
    struck = _completed(record, [struck for _, struck in record.places], hit, "hit")
    felt = _completed(record, [felt for felt, _ in record.places], response, "response")
    return replace(record, places=tuple(zip(felt, struck, strict=True)))


def located(record: FrfRecord, stated: StatedPoints) -> FrfRecord:
    """The record with its nodes by the names of the points. Raises InputError as `hits_from`."""
    source = record.source
    felt = [end._replace(node=_axis_there(source, stated, *end)) for end, _ in record.places]
    struck = [end._replace(node=stated.hit_at(source, end.node)) for _, end in record.places]
    return replace(record, places=tuple(zip(felt, struck, strict=True)))


def _completed(record: FrfRecord, own: list[End], axis: str | None, what: str) -> list[End]:
    """Ends of FRFs, unknown directions (0) as the table says."""
    said = hit_direction(axis) if axis else 0
    other = next((d for _, d in own if d and said and abs(d) != abs(said)), None)
    if other is not None and (what == "hit" or len(own) == 1):
        raise InputError(
            f"{record.source} says that its {what} is {_way(other)}, the table says "
            f"{axis}; correct the one that is wrong."
        )
    return [end._replace(direction=end.direction or said) for end in own]


def _along(direction: int) -> str:
    """ "x", "y" or "z" of a direction; "" where it is unknown or a rotation."""
    return AXES[abs(direction) - 1] if 1 <= abs(direction) <= len(AXES) else ""


def _way(direction: int) -> str:
    """ "along z"; directions beyond 3 turn about the axes, as universal files have them."""
    turns, axis = divmod(abs(direction) - 1, len(AXES))
    return f"{'about' if turns else 'along'} {AXES[axis]}"


def _axis_there(source: object, stated: StatedPoints, node: str, direction: int) -> str:
    """The point at a node, whose sensor has an axis along a direction (±1, ±2, ±3; 0 unknown)."""
    point = stated.response_at(source, node)
    axes = stated.names.axes_of(point)
    if abs(direction) > len(AXES) or _along(direction) not in axes:
        raise InputError(
            f"{source}{stated.where} has a response {_way(direction)} at {point}, whose sensor has "
            f"{', '.join(axes)} only; correct its direction, or the axes in robot.toml."
        )
    return point


def _hit(record: TimeRecord, axis: str | None, stated: StatedPoints) -> Hit:
    source = record.source
    forces = [c for c in record.channels if c.quantity == "force"]
    if len(forces) != 1:
        raise _lacking(record, "exactly one force in N", "export force and accelerations together")
    accelerations = [c for c in record.channels if c.quantity == "acceleration"]
    accelerations, left_out = _at_points(accelerations, stated)
    responses = _responses(record, accelerations, stated)
    force, remarks = forces[0], list(record.remarks)
    for channel in (force, *accelerations):
        if not channel.unit:
            raise InputError(
                f"{source}: the unit of {channel.name} is not known; label it N or m/s^2."
            )
    places = list(dict.fromkeys(dof.node for dof in responses))  # as in the file, x, y, z at each
    order = sorted(responses, key=lambda dof: (places.index(dof.node), dof.number))
    signs = [-1.0 if responses[d].direction < 0 else 1.0 for d in order]
    samples = np.array([responses[d].samples * s for d, s in zip(order, signs, strict=True)])
    hit_point = stated.hit_at(source, force.node)
    if stated.names.anywhere and not _along(force.direction) and not hit_direction(axis or ""):
        axis, hit_point = AXES[0], hit_point + NOT_STATED
    name = _axis(source, force, axis, remarks)
    if unlabelled := without_unit(record):
        remarks.append(f"Left out, as their unit is not known: {unlabelled}.")
    noticed = (Fault(NOTICED, text, refuse=False) for text in remarks)
    return Hit(
        source, name, record.sampling_rate_hz, force.samples, samples, record.simulated, hit_point,
        tuple(order), (*record.faults, *noticed, *left_out),
    )  # fmt: skip


def _at_points(
    accelerations: list[Channel], stated: StatedPoints
) -> tuple[list[Channel], tuple[Fault, ...]]:
    """Those at points of the robot, and remarks on the others; all where that leaves no sensor.

    Where robot.toml names no nodes, the tool's sensor is at the one node that has all its axes.
    """
    names, axes = stated.names, dict[str, set[str]]()
    for c in accelerations:
        axes.setdefault(c.node, set()).add(_along(c.direction))
    whole = [node for node, own in axes.items() if own >= set(names.axes_of(SENSOR))]
    known = [node for node in axes if stated.knows_response(node)]
    if not names.nodes:
        named = [node for node in axes if node in names.known]
        known = [*named, *whole] if not named and len(whole) == 1 else named
    of_tool = any(node in known and stated.response_at("", node) == SENSOR for node in whole)
    if names.anywhere or not of_tool:
        return accelerations, ()
    others = [c for c in accelerations if c.node not in known]
    texts = (f"{c.name} at node {c.node} is left out: that is no [[point]]." for c in others)
    told = tuple(Fault("left_out", text, refuse=False) for text in texts)
    return [c for c in accelerations if c.node in known], told


def _responses(
    record: TimeRecord, accelerations: Sequence[Channel], stated: StatedPoints
) -> dict[Dof, Channel]:
    """Accelerations by point and axis; of the tool's sensor, where it stands alone, all three.

    Of points that belong to no robot any number: a channel without a direction is one by itself, as
    if it had an axis x only.
    """
    found: dict[Dof, Channel] = {}
    names = stated.names
    for channel in accelerations:
        along = _along(channel.direction)
        if names.anywhere:
            node = stated.response_at(record.source, channel.node)
            if not channel.direction:
                node, along = (channel.name if node == SENSOR else node) + NOT_STATED, AXES[0]
            if not along or Dof(node, along) in found:
                fault = "has its place and direction twice" if along else "is a rotation"
                raise InputError(
                    f"{record.source}: {channel.name} {fault}; state node and direction of each "
                    f"acceleration, or leave it out."
                )
        elif along:
            node = _axis_there(record.source, stated, channel.node, channel.direction)
        else:
            break
        found[Dof(node, along)] = channel
    if names.anywhere and not found:
        raise _lacking(record, "an acceleration", "export force and accelerations together")
    of_tool = {dof.direction for dof in found if dof.node == SENSOR}
    whole = not of_tool or of_tool >= set(names.axes_of(SENSOR))
    if not names.anywhere and not (whole and 0 < len(found) == len(accelerations)):
        needs = "one acceleration in each of x, y and z"
        raise _lacking(record, needs, "export all three with their directions")
    return found


def _axis(source: Path, force: Channel, axis: str | None, remarks: list[str]) -> str:
    """Along which axis it was hit, as the file and the table of recordings say it."""
    own = force.direction if _along(force.direction) else 0
    stated = hit_direction(axis) if axis else 0
    if axis and not stated:
        raise InputError(f'{source}: hit "{axis}" is no signed axis such as +x; correct it.')
    if not own and not stated:
        kind = source.name.lower().removesuffix(".gz").rpartition(".")[2]
        how = STATED_IN.get(kind, 'state it in the file (attribute hit, such as "+x")')
        raise AxisNotStatedError(
            f"{source} does not say along which axis it was hit; {how}, or list the file in "
            f"recordings.csv with its pose, joint angles and hit."
        )
    if own and stated and own != stated:
        if abs(own) != abs(stated) or own < 0:
            raise InputError(
                f"{source} says it was hit along {_name(own)}, the table says "
                f"{_name(stated)}; correct the one that is wrong."
            )
        remarks.append(f"The file names the axis without its sign; {_name(stated)} is used.")
    return _name(stated or own)


def _name(direction: int) -> str:
    return ("-" if direction < 0 else "+") + AXES[abs(direction) - 1]


def without_unit(record: TimeRecord) -> str:
    """Names of the channels of which neither unit nor type say what they are; "" where none."""
    return ", ".join(c.name for c in record.channels if c.quantity == "unknown")


def _lacking(record: TimeRecord, needs: str, remedy: str) -> InputError:
    """That a record is no hit, for which it `needs` something; units may be all that is missing."""
    if nameless := without_unit(record):
        remedy = f"the unit of {nameless} is not known: name columns such as Force [N] and Acc X "
        remedy += "[m/s²]"
    return InputError(f"{record.source} holds {describe(record)}: a hit needs {needs}; {remedy}.")


def describe(record: TimeRecord) -> str:
    """What a record holds, in words: "2 accelerations (m/s^2), 1 pressure (Pa)"."""
    counts = Counter(
        f"{c.quantity} ({c.unit})" if c.quantity != "unknown" else "channel without a known unit"
        for c in record.channels
    )
    return ", ".join(f"{n} × {text}" for text, n in counts.items())
