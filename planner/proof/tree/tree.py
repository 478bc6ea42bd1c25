"""A tree of frames with small coordinates; mass matrix and gravity's stiffness from it.

Every node sits at a fixed transform from its parent and may then move by one coordinate: turn about
an axis (rad) or slide along it (m). Bodies are rigid and ride on nodes. At rest all coordinates are
zero; the springs' preload holds the weight there.

    M   = sum over bodies of Jv' m Jv + Jw' I Jw
    Kg  = second derivatives of V = -sum m g.c at rest, with d2c/dxi dxj = zi x (dc/dxj), i inboard
"""

from dataclasses import dataclass, field

import numpy as np

from planner.proof.tree.spatial import cross_matrix, inertia_of, turn


@dataclass(frozen=True)
class Body:
    """Mass (kg), centre (m) and second moment about it (kg m2), in the frame of its node."""

    mass: float
    centre: np.ndarray
    second: np.ndarray

    def scaled(self, factor: float) -> "Body":
        """The same shape with `factor` times the mass."""
        return Body(self.mass * factor, self.centre, self.second * factor)


@dataclass
class Node:
    """Frame: parent's number, fixed rotation and place, and how it moves (`turn`, `slide`, "")."""

    parent: int
    rotation: np.ndarray
    place: np.ndarray
    kind: str = ""
    axis: np.ndarray = field(default_factory=lambda: np.zeros(3))
    coordinate: int = -1


class Tree:
    """Nodes in order from the ground (node 0), coordinates in the order in which they came."""

    def __init__(self) -> None:
        self.nodes = [Node(-1, np.eye(3), np.zeros(3))]
        self.names: list[str] = []
        self.bodies: list[tuple[int, Body, str]] = []

    def fixed(self, parent: int, rotation: np.ndarray, place: np.ndarray) -> int:
        """A frame that does not move against its parent."""
        self.nodes.append(Node(parent, np.asarray(rotation), np.asarray(place, float)))
        return len(self.nodes) - 1

    def moving(self, parent: int, kind: str, axis: np.ndarray, name: str, place=(0, 0, 0)) -> int:
        """A frame at `place` (m) in its parent that moves by a new coordinate `name`."""
        node = Node(parent, np.eye(3), np.asarray(place, float), kind, np.asarray(axis, float))
        node.coordinate = len(self.names)
        self.names.append(name)
        self.nodes.append(node)
        return len(self.nodes) - 1

    def ride(self, node: int, body: Body, label: str = "") -> None:
        """Put a body on a node."""
        self.bodies.append((node, body, label))

    def settle(self, x: np.ndarray | None = None) -> "Tree":
        """Compute where all frames are at coordinates `x`; needed before anything below."""
        self.turns, self.places = [np.eye(3)], [np.zeros(3)]
        for node in self.nodes[1:]:
            rotation = self.turns[node.parent] @ node.rotation
            place = self.places[node.parent] + self.turns[node.parent] @ node.place
            value = 0.0 if x is None or node.coordinate < 0 else float(x[node.coordinate])
            if node.kind == "slide":
                place = place + rotation @ node.axis * value
            elif node.kind == "turn" and value:
                rotation = rotation @ turn(node.axis, value)
            self.turns.append(rotation)
            self.places.append(place)
        moving = [i for i, node in enumerate(self.nodes) if node.coordinate >= 0]
        self.axes = np.array([self.turns[i] @ self.nodes[i].axis for i in moving]).reshape(-1, 3)
        self.origins = np.array([self.places[i] for i in moving]).reshape(-1, 3)
        self.turning = np.array([self.nodes[i].kind == "turn" for i in moving], bool)
        self.paths = self._paths()
        return self

    def _paths(self) -> np.ndarray:
        """Which coordinates (columns) move which node (rows)."""
        paths = np.zeros((len(self.nodes), len(self.names)), bool)
        for i, node in enumerate(self.nodes[1:], 1):
            paths[i] = paths[node.parent]
            if node.coordinate >= 0:
                paths[i, node.coordinate] = True
        return paths

    def at(self, node: int, local: np.ndarray) -> np.ndarray:
        """World place (m) of a point given in a node's frame."""
        return self.places[node] + self.turns[node] @ np.asarray(local, float)

    def jacobian(self, node: int, place: np.ndarray) -> np.ndarray:
        """(6, n): velocity (m/s) of a world place riding on `node`, and the node's turning rate."""
        linear = np.where(
            self.turning[:, None], np.cross(self.axes, place - self.origins), self.axes
        )
        angular = np.where(self.turning[:, None], self.axes, 0.0)
        return np.hstack([linear, angular]).T * self.paths[node]

    def mass_matrix(self) -> np.ndarray:
        """M (n, n) in kg, kg m, kg m2."""
        total = np.zeros((len(self.names), len(self.names)))
        for node, body, _ in self.bodies:
            jacobian = self.jacobian(node, self.at(node, body.centre))
            inertia = self.turns[node] @ inertia_of(body.second) @ self.turns[node].T
            total += body.mass * jacobian[:3].T @ jacobian[:3]
            total += jacobian[3:].T @ inertia @ jacobian[3:]
        return total

    def gravity_stiffness(self, gravity: np.ndarray) -> np.ndarray:
        """Kg (n, n) in N m/rad, N, N/m."""
        lever = np.where(self.turning[:, None], np.cross(gravity, self.axes), 0.0)
        upper = np.zeros((len(self.names), len(self.names)))
        for node, body, _ in self.bodies:
            jacobian = self.jacobian(node, self.at(node, body.centre))[:3]
            upper -= body.mass * (lever * self.paths[node][:, None]) @ jacobian
        upper = np.triu(upper)
        return upper + np.triu(upper, 1).T

    def weight(self, gravity: np.ndarray) -> np.ndarray:
        """Generalised force (n) of gravity at rest."""
        total = np.zeros(len(self.names))
        for node, body, _ in self.bodies:
            jacobian = self.jacobian(node, self.at(node, body.centre))[:3]
            total += body.mass * jacobian.T @ gravity
        return total

    def potential(self, gravity: np.ndarray) -> float:
        """-sum m g.c in J at the coordinates of the last `settle`."""
        return -sum(b.mass * float(gravity @ self.at(n, b.centre)) for n, b, _ in self.bodies)

    def ground_columns(self) -> np.ndarray:
        """(n, 3): -sum Jv' m, the load per m/s2 of the floor's acceleration."""
        total = np.zeros((len(self.names), 3))
        for node, body, _ in self.bodies:
            total -= body.mass * self.jacobian(node, self.at(node, body.centre))[:3].T
        return total

    def spin_columns(self, node: int, momentum: np.ndarray) -> np.ndarray:
        """Skew (n, n), N m s/rad: a rotor of angular momentum (N m s, node's frame) on `node`.

        The rotor's torque on the link is -w x h, so the left side has -Jw' [h]x Jw.
        """
        jacobian = self.jacobian(node, self.places[node])[3:]
        return -jacobian.T @ cross_matrix(self.turns[node] @ momentum) @ jacobian
