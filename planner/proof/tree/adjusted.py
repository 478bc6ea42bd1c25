"""A system with its springs, dampers, loss factors and inertias moved within what may err anyway.

All unknowns are in units of their prior sd. Gravity's stiffness stays.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.proof.tree.laws import Spring
from planner.proof.tree.layouts import Robot
from planner.proof.tree.spatial import cross_matrix
from planner.proof.tree.system import System, Tie
from planner.proof.tree.tree import Body

GEAR_SD, SLIGHT_SD, OTHER_SD, DAMPING_SD, LOSS_SD = 0.25, 0.5, 1.0, 0.5, 0.02
MASS_SD, CENTRE_SD, SECOND_SD = 0.06, 0.03, 0.08


@dataclass(frozen=True)
class Adjusted:
    """A spring's law with stiffness and damper times factors e^(sd x), and a loss factor added."""

    spring: Spring
    sd: float
    moves: np.ndarray  # (3) stiffness, damper, loss factor, in sds

    @property
    def stiffness(self) -> float:
        """As moved."""
        return self.spring.stiffness * float(np.exp(self.sd * self.moves[0]))

    def changes(self, s: np.ndarray) -> list[np.ndarray]:
        """Derivatives of the law (lines) by the three moves."""
        spring = self.spring
        elastic = np.exp(self.sd * self.moves[0]) * (spring(s) - spring.damping * s)
        viscous = spring.damping + spring.loss * spring.stiffness / (2 * np.pi * 15)
        loss = Spring(spring.stiffness, 0, LOSS_SD)(s) - spring.stiffness
        return [
            self.sd * elastic,
            DAMPING_SD * np.exp(DAMPING_SD * self.moves[1]) * viscous * s,
            loss,
        ]

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """Dynamic stiffness at `s`."""
        elastic, viscous, loss = self.changes(s)
        before = self.spring.damping - viscous / s / np.exp(DAMPING_SD * self.moves[1]) / DAMPING_SD
        return elastic / self.sd + viscous / DAMPING_SD + before * s + self.moves[2] * loss


def _sd(tie: Tie, robot: Robot) -> float:
    """Prior sd of a stiffness's logarithm: stated, slightly soft, or of another effect."""
    where, what = tie.name.split(":") if ":" in tie.name else (tie.name, "")
    if what == "gear" or where in _listed(robot):
        return GEAR_SD
    return SLIGHT_SD if where.startswith(("joint", "link")) else OTHER_SD


def _listed(robot: Robot) -> list[str]:
    return [f"joint_{j + 1}" for j in robot.cross or {}]


def movable(tie: Tie) -> bool:
    """Stated springs can be moved, those of other effects, and bearings that are slightly soft."""
    return tie.mutual and isinstance(tie.law, Spring)


def gear_moves(system: System, other: System, robot: Robot) -> np.ndarray:
    """Moves at which the gears of `system` are as stiff at rest as those of `other`."""
    moves, at = np.zeros(count(system, robot)), 0
    stiffness = {tie.name: tie.law.stiffness for tie in other.ties}
    for tie in system.ties:
        if movable(tie):
            ratio = stiffness.get(tie.name, tie.law.stiffness) / tie.law.stiffness
            moves[at] = np.log(ratio) / _sd(tie, robot)
            at += 3
    return moves


def _spatial(mass: float, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(6, 6) inertia about a link's origin from mass, first and second moment."""
    c = cross_matrix(first)
    inertia = np.trace(second) * np.eye(3) - second
    return np.block([[mass * np.eye(3), -c], [c, inertia]])


def _of_body(body: Body, length: float) -> list[np.ndarray]:
    """Changes of a link's spatial inertia by one sd: mass, centre (3), second moment (6)."""
    m, c, inner = body.mass, body.centre, body.second
    changes = [MASS_SD * _spatial(m, m * c, inner + m * np.outer(c, c))]
    for unit in np.eye(3) * CENTRE_SD * length:
        changes.append(_spatial(0, m * unit, m * (np.outer(c, unit) + np.outer(unit, c))))
    for i in range(3):
        for j in range(i, 3):
            change = np.zeros((3, 3))
            change[i, j] = change[j, i] = SECOND_SD * np.sqrt(inner[i, i] * inner[j, j])
            changes.append(_spatial(0, np.zeros(3), change))
    return changes


def inertia_changes(robot: Robot) -> list[tuple[str, np.ndarray]]:
    """(link, change of its spatial inertia by one sd) of all unknowns of inertia."""
    return [
        (f"link_{i + 1}", change)
        for i, body in enumerate(robot.links)
        for change in _of_body(body, 0.3 * robot.reach)
    ]


def adjusted(system: System, robot: Robot, moves: np.ndarray) -> System:
    """The system at `moves`: three for every movable tie, then those of inertia."""
    ties, at = [], 0
    for tie in system.ties:
        if movable(tie):
            law = Adjusted(tie.law, _sd(tie, robot), moves[at : at + 3])
            tie = Tie(tie.name, tie.left, tie.right, law)
            at += 3
        ties.append(tie)
    # Left and right must stay one object: that marks a mutual tie.
    ties = [Tie(t.name, t.left, t.left, t.law) if t.left is t.right else t for t in ties]
    mass = system.mass.copy()
    for value, (link, change) in zip(moves[at:], inertia_changes(robot), strict=True):
        mass += value * system.parts[link].T @ change @ system.parts[link]
    return replace(system, ties=tuple(ties), mass=mass)


def count(system: System, robot: Robot) -> int:
    """How many moves there are."""
    return 3 * sum(movable(t) for t in system.ties) + 10 * len(robot.links)


def columns(system: System, robot: Robot, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of an adjusted system: FRF changes (moves, lines, 3, 3) by each move, and H (lines, 6, 6)."""
    z = system.dynamic_stiffness(s)
    right = np.linalg.solve(z, system.load[None].astype(complex))
    left = np.linalg.solve(np.swapaxes(z, 1, 2), system.sense[:3].T[None].astype(complex))
    left, s2 = np.swapaxes(left, 1, 2), (s**2)[:, None, None]
    frf, right = s2 * (system.sense @ right), right[..., :3]
    found = []
    for tie in system.ties:
        if isinstance(tie.law, Adjusted):
            both = (left @ tie.left)[:, :, None] * (right.transpose(0, 2, 1) @ tie.right)[:, None]
            found += [-s2 * change[:, None, None] * both for change in tie.law.changes(s)]
    parts = {name: (left @ part.T, part @ right) for name, part in system.parts.items()}
    for link, change in inertia_changes(robot):
        felt, moved = parts[link]
        found.append(-(s2**2) * (felt @ change @ moved))
    return np.array(found), frf
