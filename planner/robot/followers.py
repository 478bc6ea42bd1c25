"""Joints that follow others (<mimic>) in a URDF: balancers, parallelograms, fingers.

A follower stands at multiplier · its leader's coordinate + offset, in rad or m. Once a URDF has
been read, what it follows moves by itself, keeps to a range in which the follower can go with it,
and carries it along; what follows a joint that stays where it is stays too.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.robot.held_joints import TURNING, fix

Joints = Mapping[str, ElementTree.Element]


@dataclass(frozen=True)
class Follow:
    """Coordinate = factor · the leader's + offset, in rad or m."""

    leader: str
    factor: float
    offset: float

    def at(self, place: float) -> float:
        """Where the follower is when its leader is at `place`."""
        return self.factor * place + self.offset


def follows(joint: ElementTree.Element) -> Follow | None:
    """What a joint that moves follows, as its <mimic> says."""
    mimic = joint.find("mimic")
    if mimic is None or joint.get("type") == "fixed":
        return None
    factor, offset = mimic.get("multiplier", "1"), mimic.get("offset", "0")
    return Follow(mimic.get("joint", ""), float(factor), float(offset))


def join_followers(joints: Joints, held: Mapping[str, float], urdf: Path) -> None:
    """Make every <mimic> name a joint that moves by itself; fix what follows one that does not.

    `held` are places (rad, m) of joints that will be fixed there. Raises InputError where a joint
    follows none, or itself.
    """
    stated = {
        name: follow
        for name, joint in joints.items()
        if name not in held and (follow := _read(joint, urdf)) is not None
    }
    for name in stated:
        follow, joint = _rooted(name, stated, joints, urdf), joints[name]
        leader = joints[follow.leader]
        if leader.get("type") == "fixed" or follow.leader in held or follow.factor == 0:
            place = follow.at(held.get(follow.leader, 0.0))
            _check_place(joint, place, follow.leader, urdf)
            fix(joint, place, urdf)
            continue
        for old in joint.findall("mimic"):
            joint.remove(old)
        mimic = ElementTree.SubElement(joint, "mimic", joint=follow.leader)
        mimic.set("multiplier", repr(follow.factor))
        mimic.set("offset", repr(follow.offset))


def narrow_leaders(joints: Joints, urdf: Path) -> None:
    """Leave leaders the range in which their followers keep to their own limits.

    Leaders have limits by now. Those of followers have done their work, and are taken off.
    """
    for name, joint in joints.items():
        follow = follows(joint)
        if follow is None:
            continue
        leader = joints[follow.leader]
        limit, free, own = leader.find("limit"), _range(leader), _range(joint)
        if limit is not None and free is not None and own is not None:
            low, high = sorted((end - follow.offset) / follow.factor for end in own)
            low, high = max(low, free[0]), min(high, free[1])
            if not low < high:
                raise InputError(
                    f"{urdf}: joint {name} follows {follow.leader} (<mimic>), but nowhere are both "
                    f"within their limits; correct its <limit>, multiplier or offset."
                )
            limit.set("lower", repr(low))
            limit.set("upper", repr(high))
        for old in joint.findall("limit"):
            joint.remove(old)
        if joint.get("type") in TURNING:
            joint.set("type", "continuous")
        else:
            ElementTree.SubElement(joint, "limit", lower="0", upper="0", velocity="0", effort="0")


def _read(joint: ElementTree.Element, urdf: Path) -> Follow | None:
    try:
        follow = follows(joint)
    except ValueError:
        follow = Follow("", np.nan, np.nan)
    if follow is not None and not np.isfinite([follow.factor, follow.offset]).all():
        raise InputError(
            f"{urdf}: <mimic> of joint {joint.get('name')} has a multiplier or offset that is no "
            f"number; correct it."
        )
    return follow


def _rooted(name: str, stated: Mapping[str, Follow], joints: Joints, urdf: Path) -> Follow:
    """What a joint follows in the end: a joint that follows none."""
    follow, passed = stated[name], {name}
    while follow.leader in stated and follow.leader not in passed:
        passed.add(follow.leader)
        on = stated[follow.leader]
        follow = Follow(on.leader, follow.factor * on.factor, follow.at(on.offset))
    if follow.leader in passed:
        raise InputError(f"{urdf}: joint {name} follows itself (<mimic>); name the one that leads.")
    if follow.leader not in joints:
        raise InputError(
            f'{urdf}: joint {name} follows "{follow.leader}" (<mimic>), which is no joint; correct '
            f"the name, or leave <mimic> out."
        )
    return follow


def _range(joint: ElementTree.Element) -> tuple[float, float] | None:
    """A joint's own limits; None where it states none: 0 to 0 is what is left out."""
    limit = joint.find("limit")
    if limit is None or joint.get("type") == "continuous":
        return None
    try:
        low, high = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
    except ValueError:
        return None
    return (low, high) if low < high else None


def _check_place(joint: ElementTree.Element, place: float, leader: str, urdf: Path) -> None:
    own = _range(joint)
    if own is not None and not own[0] - 1e-9 <= place <= own[1] + 1e-9:
        raise InputError(
            f"{urdf}: joint {joint.get('name')} follows {leader} (<mimic>), which stays where it "
            f"is, to {place:.4g}, beyond its limits of {own[0]:.4g} to {own[1]:.4g} (rad, m); "
            f"correct [held] of robot.toml or the <limit>."
        )
