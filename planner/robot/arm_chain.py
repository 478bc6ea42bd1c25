"""Which joints of a URDF are the arm, where its tool is, and where all other joints stay.

Joints without a range stay, too.
"""

import xml.etree.ElementTree as ElementTree
from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.robot.urdf_elements import SLIDING, TURNING, limits_of

# Names of the frame where a tool is bolted on or hits, the likeliest first.
TOOLS = ("tcp", "tool_center_point", "tool0", "tool", "ee_link", "flange", "end_effector", "ee")
SENSORS = ("sensor", "accelerometer")  # of that where accelerations are measured


@dataclass(frozen=True)
class ArmChain:
    """The arm of a URDF: its joints from the base, the frames at its end where a tool and a sensor
    are, and where other joints stay, as robot.toml's [held] says it.
    """

    joints: tuple[str, ...]
    tcp: str
    sensor: str  # the tool's, where no other is named so
    held: dict[str, float]


def arm_chain(root: ElementTree.Element) -> ArmChain | None:
    """The longest chain of joints that move by themselves; None where there is none.

    Where the tree branches behind more of its joints than lie beyond, the arm ends: a hand's
    fingers are no part of it. Joints that follow others (<mimic>) do not count and stay free.
    """
    tree = _Tree(root)
    path = max(tree.paths, key=lambda links: (tree.depth(links), -len(links)), default=[])
    path = path[: tree.end(path) + 1]
    joints = [j for j in (tree.above[link] for link in path[1:]) if tree.moves(j)]
    if not joints:
        return None
    last = max(i for i, link in enumerate(path) if i and tree.moves(tree.above[link]))
    others = [j for j in tree.above.values() if _free(j) and j not in joints]
    return ArmChain(
        tuple(j.get("name", "") for j in joints),
        tree.tool(path[last]),
        tree.sensor(path[last]),
        dict(_held(j) for j in others),
    )


class _Tree:
    """Links and joints of a URDF: `above` is the joint that carries a link."""

    def __init__(self, root: ElementTree.Element):
        self.above: dict[str, ElementTree.Element] = {}
        links = root.findall("link")
        self._links = [link.get("name", "") for link in links]
        self._shaped = {
            link.get("name", "")
            for link in links
            if link.findall("visual") + link.findall("collision")
        }
        self._below: dict[str, list[str]] = defaultdict(list)
        for joint in root.findall("joint"):
            parent, child = joint.find("parent"), joint.find("child")
            if parent is not None and child is not None:
                self.above[child.get("link", "")] = joint
                self._below[parent.get("link", "")].append(child.get("link", ""))

    def moves(self, joint: ElementTree.Element) -> bool:
        """Whether a joint moves by itself."""
        return _free(joint) and float(np.ptp(_limits(joint))) > 0

    @cached_property
    def paths(self) -> list[list[str]]:
        """From a root to each link."""
        found = [[link] for link in self._links if link not in self.above]
        for path in found:  # which grows meanwhile
            found += [[*path, child] for child in self._below[path[-1]] if child not in path]
        return found

    def depth(self, path: list[str]) -> int:
        """How many joints of a path move by themselves."""
        return sum(self.moves(self.above[link]) for link in path if link in self.above)

    def end(self, path: list[str]) -> int:
        """Place in a path at which its arm ends and a hand begins, or the path."""
        whole = self.depth(path)
        for i in range(len(path)):
            before = self.depth(path[: i + 1])
            branches = [c for c in self._below[path[i]] if self._moving_below(c)]
            if before > whole - before > 0 and len(branches) > 1:
                return i
        return len(path) - 1

    def _moving_below(self, link: str) -> bool:
        moving = self.above[link].get("type") in (*TURNING, *SLIDING)
        return moving or any(self._moving_below(child) for child in self._below[link])

    def tool(self, link: str) -> str:
        """The frame fixed to a link that a tool is likeliest to be bolted to: by its name, then
        the farthest one, rather one without a shape.
        """
        depth = self._fixed_to(link)

        def unlikely(one: str) -> tuple[int, bool, int, bool]:
            return _rank(one, TOOLS), _is_sensor(one), -depth[one], one in self._shaped

        return min(depth, key=unlikely)

    def sensor(self, link: str) -> str:
        """The frame fixed to a link that is named as a sensor's; else that of the tool."""
        return next(filter(_is_sensor, self._fixed_to(link)), self.tool(link))

    def _fixed_to(self, link: str) -> dict[str, int]:
        """A link and all that are fixed to it, over how many joints."""
        found, depth = [link], {link: 0}
        for one in found:  # which grows meanwhile
            for child in self._below[one]:
                if self.above[child].get("type") == "fixed" and child not in depth:
                    depth[child] = depth[one] + 1
                    found.append(child)
        return depth


def _rank(link: str, names: tuple[str, ...]) -> int:
    """Which of the names a link has, by itself or after a prefix; their number: none."""
    own = link.lower()
    ranks = [i for i, name in enumerate(names) if own == name or own.endswith(f"_{name}")]
    return min(ranks, default=len(names))


def _is_sensor(link: str) -> bool:
    return _rank(link, SENSORS) < len(SENSORS)


def _free(joint: ElementTree.Element) -> bool:
    """Whether a joint turns or slides, and follows no other."""
    return joint.get("type") in (*TURNING, *SLIDING) and joint.find("mimic") is None


def _limits(joint: ElementTree.Element) -> tuple[float, float]:
    turns_on = joint.get("type") == "continuous"
    return limits_of(joint) or ((-np.pi, np.pi) if turns_on else (0.0, 0.0))


def _held(joint: ElementTree.Element) -> tuple[str, float]:
    """Entry and place of a joint in [held]: at 0, or at its limit nearest to that."""
    name, at = joint.get("name", ""), float(np.clip(0.0, *_limits(joint)))
    slides = joint.get("type") in SLIDING
    return (f"{name}_m", at) if slides else (f"{name}_deg", float(np.rad2deg(at)))
