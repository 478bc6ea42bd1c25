"""All joints of a robot's model, those that follow others among them, and where they stand."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from planner.robot.urdf_elements import SLIDING, joint_axis
from planner.robot.urdf_joints import follows

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
