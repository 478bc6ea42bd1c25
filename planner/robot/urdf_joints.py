"""A URDF's joints once it has been read: which stay, which follow others, and their ranges.

Joints that [held] of robot.toml names (rails, turntables) become fixed joints there, with all that
they carry, so that nothing else has to know of them. A follower (<mimic>: balancers,
parallelograms, fingers) stands at multiplier · its leader's coordinate + offset, in rad or m. What
it follows moves by itself, keeps to a range in which the follower can go with it, and carries it
along; what follows a joint that stays where it is stays too.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
import pinocchio as pin

from planner.errors import InputError
from planner.robot.urdf_elements import (
    SLIDING,
    TURNING,
    Joints,
    joint_axis,
    limits_of,
    place_of,
    replace_child,
)

# Of keys of [held]: types of joints, and how many of its units are one of rad or m.
UNITS = {"_deg": (TURNING, 180 / np.pi), "_m": (SLIDING, 1.0), "_mm": (SLIDING, 1e3)}
ROUNDING = 1e-9  # rad or m


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
    """What a joint that moves follows, as its <mimic> says; NaN of what is no number."""
    mimic = joint.find("mimic")
    if mimic is None or joint.get("type") == "fixed":
        return None
    try:
        factor, offset = float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))
    except ValueError:
        factor = offset = np.nan
    return Follow(mimic.get("joint", ""), factor, offset)


def settle_joints(root: ElementTree.Element, urdf: Path, held: Mapping[str, float]) -> int:
    """Hold, join and complete the joints; returns how many move."""
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    places = _held_places(joints, held, urdf)
    _join_followers(joints, places, urdf)
    for name, place in places.items():
        _fix(joints[name], place, urdf)
    moving = [joint for joint in joints.values() if joint.get("type") != "fixed"]
    for joint in (joint for joint in moving if follows(joint) is None):
        _complete(joint, urdf)
    _narrow_leaders(joints, urdf)
    for joint in (joint for joint in moving if follows(joint) is not None):
        _complete(joint, urdf)
    return len(moving)


def _held_places(joints: Joints, held: Mapping[str, float], urdf: Path) -> dict[str, float]:
    """Where joints stay, in rad or m, by name: keys of `held` end in _deg (turning), _m or _mm.

    Joints that are fixed are left out: a text that was made from a robot is read again. Raises
    InputError where a key names no such joint, or a place beyond its limits.
    """
    found = {}
    for key, value in held.items():
        unit = next((u for u in UNITS if key.endswith(u)), "")
        name = key.removesuffix(unit)
        if not unit or name not in joints:
            known = ", ".join(n for n, j in joints.items() if j.get("type") != "fixed")
            raise InputError(
                f"{urdf}: [held] {key} names no joint; give NAME_deg or NAME_m of {known}."
            )
        joint, (kinds, units) = joints[name], UNITS[unit]
        if joint.get("type") == "fixed":
            continue
        if joint.get("type") not in kinds:
            other = "_m" if unit == "_deg" else "_deg"
            raise InputError(
                f"{urdf}: joint {name} is {joint.get('type')}; give [held] {name}{other}."
            )
        own = limits_of(joint)
        if own and not own[0] - ROUNDING <= value / units <= own[1] + ROUNDING:
            raise InputError(
                f"{urdf}: [held] {key} lies outside the joint's limits of {own[0] * units:.4g} to "
                f"{own[1] * units:.4g}; correct it."
            )
        found[name] = value / units
    return found


def _fix(joint: ElementTree.Element, value: float, urdf: Path) -> None:
    """Make a joint fixed at its coordinate `value`, in rad or m."""
    place, axis = place_of(joint), joint_axis(joint)
    if not np.isfinite([*place.translation, *place.rotation.flat, *axis]).all():
        raise InputError(
            f"{urdf}: origin or axis of joint {joint.get('name')} is not three numbers; correct it."
        )
    if joint.get("type") in SLIDING:
        moved = place * pin.SE3(np.eye(3), value * axis)
    else:
        moved = place * pin.SE3(pin.AngleAxis(value, axis).matrix(), np.zeros(3))
    xyz, rpy = (
        " ".join(f"{v:.12g}" for v in values)
        for values in (moved.translation, pin.rpy.matrixToRpy(moved.rotation))
    )
    replace_child(joint, "origin", xyz=xyz, rpy=rpy)
    joint.set("type", "fixed")
    for name in ("axis", "limit", "mimic", "dynamics", "calibration", "safety_controller"):
        replace_child(joint, name)


def _join_followers(joints: Joints, held: Mapping[str, float], urdf: Path) -> None:
    """Make every <mimic> name a joint that moves by itself; fix what follows one that does not.

    `held` are places (rad, m) of joints that will be fixed there. Raises InputError where a joint
    follows none, or itself.
    """
    stated = {}
    for name, joint in joints.items():
        follow = None if name in held else follows(joint)
        if follow is not None:
            stated[name] = follow
            if not np.isfinite([follow.factor, follow.offset]).all():
                raise InputError(
                    f"{urdf}: <mimic> of joint {name} has a multiplier or offset that is no "
                    f"number; correct it."
                )
    for name in stated:
        follow, joint = _rooted(name, stated, joints, urdf), joints[name]
        leader = joints[follow.leader]
        if leader.get("type") == "fixed" or follow.leader in held or follow.factor == 0:
            place, own = follow.at(held.get(follow.leader, 0.0)), limits_of(joint)
            if own and not own[0] - ROUNDING <= place <= own[1] + ROUNDING:
                raise InputError(
                    f"{urdf}: joint {name} follows {follow.leader} (<mimic>), which stays where it "
                    f"is, to {place:.4g}, beyond its limits of {own[0]:.4g} to {own[1]:.4g} (rad, "
                    f"m); correct [held] of robot.toml or the <limit>."
                )
            _fix(joint, place, urdf)
        else:
            factor, offset = repr(follow.factor), repr(follow.offset)
            replace_child(joint, "mimic", joint=follow.leader, multiplier=factor, offset=offset)


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


def _narrow_leaders(joints: Joints, urdf: Path) -> None:
    """Leave leaders the range in which their followers keep to their own limits.

    Leaders have limits by now. Those of followers have done their work, and are taken off.
    """
    for name, joint in joints.items():
        follow = follows(joint)
        if follow is None:
            continue
        leader = joints[follow.leader]
        limit, free, own = leader.find("limit"), limits_of(leader), limits_of(joint)
        if limit is not None and free and own:
            low, high = sorted((end - follow.offset) / follow.factor for end in own)
            low, high = max(low, free[0]), min(high, free[1])
            if not low < high:
                raise InputError(
                    f"{urdf}: joint {name} follows {follow.leader} (<mimic>), but nowhere are both "
                    f"within their limits; correct its <limit>, multiplier or offset."
                )
            limit.set("lower", repr(low))
            limit.set("upper", repr(high))
        replace_child(joint, "limit")
        if joint.get("type") in TURNING:
            joint.set("type", "continuous")
        else:
            replace_child(joint, "limit", lower="0", upper="0", velocity="0", effort="0")


def _complete(joint: ElementTree.Element, urdf: Path) -> None:
    """Check a moving joint's type, axis and limits; give a continuous one limits of ±180°."""
    name, kind, limit = joint.get("name", "?"), joint.get("type"), joint.find("limit")
    if kind not in (*TURNING, *SLIDING):
        raise InputError(
            f"{urdf}: joint {name} is of type {kind}, but only revolute, continuous and prismatic "
            f"joints move here; make it a fixed joint."
        )
    if not np.isfinite(joint_axis(joint)).all():
        axis = joint.find("axis")
        text = "" if axis is None else axis.get("xyz", "")
        raise InputError(f'{urdf}: joint {name} has axis "{text}"; give 3 numbers, not all 0.')
    if kind == "continuous":
        speed = "3.14" if limit is None else limit.get("velocity", "3.14")
        joint.set("type", "revolute")
        low, high = str(-np.pi), str(np.pi)
        replace_child(joint, "limit", lower=low, upper=high, velocity=speed, effort="0")
    elif limit is None:
        unit = "m" if kind in SLIDING else "rad"
        raise InputError(f"{urdf}: {kind} joint {name} has no <limit>; add its range in {unit}.")


T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Linkage:
    """The n joints of the model in its order; dof of them move by themselves, the others follow.

    Where all stand is x = spread · q + offset, in rad or m: `spread` (n, dof), `offset` (n,).
    """

    names: tuple[str, ...]
    axes: tuple[np.ndarray, ...]  # unit vectors in the joints' own frames
    slides: tuple[bool, ...]
    leads: tuple[int, ...]  # places in x of the joints of q
    spread: np.ndarray
    offset: np.ndarray

    @classmethod
    def of(cls, root: ElementTree.Element, names: tuple[str, ...]) -> "Linkage":
        """The named joints of a URDF that has been read."""
        joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
        following = [follows(joints[name]) for name in names]
        leads = tuple(place for place, follow in enumerate(following) if follow is None)
        spread, offset = np.zeros((len(names), len(leads))), np.zeros(len(names))
        for place, follow in enumerate(following):
            if follow is None:
                spread[place, leads.index(place)] = 1.0
            else:
                spread[place, leads.index(names.index(follow.leader))] = follow.factor
                offset[place] = follow.offset
        axes = tuple(joint_axis(joints[name]) for name in names)
        slides = tuple(joints[name].get("type") in SLIDING for name in names)
        return cls(names, axes, slides, leads, spread, offset)

    def leading(self, of_all: Sequence[T]) -> tuple[T, ...]:
        """Of something of all joints, that of the joints of q."""
        return tuple(of_all[k] for k in self.leads)

    def at(self, q: np.ndarray) -> np.ndarray:
        """Where all joints stand (n,) at q (dof,)."""
        return self.spread @ np.asarray(q, dtype=float) + self.offset

    def comes_round(self, chain: Sequence[int]) -> np.ndarray:
        """Which joints of q (dof,) bring a chain of joints back to where it was by a whole turn."""
        spread, slides = self.spread[list(chain)], np.array(self.slides)[list(chain), None]
        return np.all((spread == 0) | ((spread == np.round(spread)) & ~slides), axis=0)
