"""A robot with all its elastic parts, before it is put into a pose; effects change it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from planner.proof.tree.layouts import Robot
from planner.proof.tree.spatial import across, turn
from planner.proof.tree.system import System, Tie
from planner.proof.tree.tree import Body, Tree


@dataclass
class Bend:
    """Hinges along a link: `count` of them, each with two springs across the link (N m/rad).

    A beam of bending stiffness EI and length L has count x EI/L in each hinge.
    """

    count: int
    springs: tuple[Any, ...]


@dataclass
class Hanging:
    """A mass (kg) at `place` (m) in a link's frame, on springs (N/m) along directions."""

    link: int
    place: np.ndarray
    mass: float
    springs: tuple[tuple[np.ndarray, Any], ...]


@dataclass
class Blueprint:
    """`gears[j]`, `bearings[j]`: springs about the joint's axis and across it, in its child frame.

    `bends`, `hanging`, `base` (kind, world axis, spring), `masses` (link, body), `spin` (N m s in
    the last link's frame), `ties`: functions of the settled tree and its link nodes.
    """

    robot: Robot
    gears: list[Any]
    bearings: list[list[tuple[np.ndarray, Any]]]
    bends: dict[int, Bend] = field(default_factory=dict)
    hanging: list[Hanging] = field(default_factory=list)
    base: list[tuple[str, np.ndarray, Any]] = field(default_factory=list)
    masses: list[tuple[int, Body]] = field(default_factory=list)
    lighter: dict[int, float] = field(default_factory=dict)  # factor of a link's mass
    spin: np.ndarray | None = None
    ties: list[Callable[[Tree, list[int]], Tie]] = field(default_factory=list)


class _Builder:
    """Puts nodes, bodies and springs in order from the floor to the tool."""

    def __init__(self, plan: Blueprint) -> None:
        self.plan, self.tree = plan, Tree()
        self.springs: list[Any] = []
        self.links: list[int] = []

    def spring(self, parent: int, kind: str, axis, name: str, law, place=(0, 0, 0)) -> int:
        self.springs.append(law)
        return self.tree.moving(parent, kind, axis, name, place)

    def build(self, q: np.ndarray) -> int:
        """The node that carries the tool."""
        plan, tree = self.plan, self.tree
        node = 0
        for i, (kind, axis, law) in enumerate(plan.base):
            node = self.spring(node, kind, axis, f"base:{i}", law)
        tree.ride(node, plan.robot.base, "base")
        offset = np.zeros(3)
        for j, joint in enumerate(plan.robot.joints):
            rotation = joint.rotation @ turn(joint.axis, float(q[j]))
            node = tree.fixed(node, rotation, joint.place - offset)
            node = self.spring(node, "turn", joint.axis, f"{joint.name}:gear", plan.gears[j])
            for i, (axis, law) in enumerate(plan.bearings[j]):
                node = self.spring(node, "turn", axis, f"{joint.name}:across{i}", law)
            self.links.append(node)
            self._hang(j, node)
            node, offset = self._link(j, node)
        self.offset = offset
        return node

    def _hang(self, link: int, node: int) -> None:
        plan, tree = self.plan, self.tree
        for which, body in plan.masses:
            if which == link:
                tree.ride(node, body, f"extra_{link + 1}")
        for number, item in enumerate(plan.hanging):
            if item.link != link:
                continue
            at = tree.fixed(node, np.eye(3), item.place)
            for i, (axis, law) in enumerate(item.springs):
                at = self.spring(at, "slide", axis, f"hanging_{number}:{i}", law)
            tree.ride(at, Body(item.mass, np.zeros(3), np.eye(3) * item.mass * 1e-3), "hanging")

    def _link(self, link: int, node: int) -> tuple[int, np.ndarray]:
        """The link's body, in pieces where it bends; the last node and its place in the link."""
        plan, tree = self.plan, self.tree
        body, bend = plan.robot.links[link], plan.bends.get(link)
        body = body.scaled(plan.lighter.get(link, 1.0))
        label = f"link_{link + 1}"
        if bend is None:
            tree.ride(node, body, label)
            return node, np.zeros(3)
        way = link_way(plan.robot, link)
        hinges = (np.arange(bend.count) + 0.5) / bend.count
        pieces = _pieces(body, way, np.concatenate([[0.0], hinges, [1.0]]))
        place = np.zeros(3)
        first, second = across(way / np.linalg.norm(way))
        for i, piece in enumerate(pieces):
            if i:
                here = hinges[i - 1] * way
                for axis, law, name in zip((first, second), bend.springs, "ab", strict=True):
                    step = here - place
                    node = self.spring(node, "turn", axis, f"{label}:{i}{name}", law, step)
                    place = here
            tree.ride(node, Body(piece.mass, piece.centre - place, piece.second), label)
        return node, place


def link_way(robot: Robot, link: int) -> np.ndarray:
    """From a link's joint to the next joint, or to the tcp (m, link's frame)."""
    last = link == len(robot.joints) - 1
    return robot.tool[1] if last else robot.joints[link + 1].place


def _pieces(body: Body, way: np.ndarray, cuts: np.ndarray) -> list[Body]:
    """A body cut along `way`: mass, centre and second moment of the whole are kept."""
    shares = np.diff(cuts)
    middles = (cuts[1:] + cuts[:-1]) / 2
    offsets = middles - float(shares @ middles)
    spread = body.mass * float(shares @ offsets**2) * np.outer(way, way)
    limit = np.max(np.linalg.eigvals(np.linalg.solve(body.second, spread)).real)
    scale = min(1.0, np.sqrt(0.8 / limit))
    rest = body.second - scale**2 * spread
    return [
        Body(body.mass * share, body.centre + scale * off * way, rest * share)
        for share, off in zip(shares, offsets, strict=True)
    ]


def assemble(plan: Blueprint, q: np.ndarray) -> tuple[System, Tree]:
    """The linear system at true joint angles q (rad)."""
    builder = _Builder(plan)
    tip = builder.build(q)
    tree = builder.tree.settle()
    robot, links = plan.robot, builder.links
    rotation, place = robot.tool
    world = tree.turns[tip] @ rotation
    both = np.kron(np.eye(2), world)
    tcp = tree.jacobian(tip, tree.at(tip, place - builder.offset))
    sensor = tree.jacobian(tip, tree.at(tip, robot.sensor - builder.offset))
    size = len(tree.names)
    spin = np.zeros((size, size))
    if plan.spin is not None:
        spin = tree.spin_columns(tip, plan.spin)
    ties = [
        Tie(name, unit, unit, law)
        for name, unit, law in zip(tree.names, np.eye(size), builder.springs, strict=True)
    ]
    ties += [make(tree, links) for make in plan.ties]
    parts = {
        f"link_{i + 1}": np.kron(np.eye(2), tree.turns[n].T) @ tree.jacobian(n, tree.places[n])
        for i, n in enumerate(links)
    }
    system = System(
        tree.mass_matrix(), tree.gravity_stiffness(robot.gravity), spin, tuple(ties),
        tcp.T @ both, both.T @ sensor, tree.ground_columns(), world.T, parts,
        dict(zip(tree.names, tree.weight(robot.gravity), strict=True)),
    )  # fmt: skip
    return system, tree
