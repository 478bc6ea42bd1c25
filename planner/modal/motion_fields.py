"""How points move like their neighbours: Gaussian fields over a structure's geometry.

Between neighbours a structure moves smoothly: Matérn fields over the places, each direction by
itself, and, where trace lines join the points, slender beams of one cross-section along the lines:
their flexibility is the covariance, so that a motion is the likelier the less it bends them, and
points on a straight line move alike along it.
"""

from collections.abc import Sequence

import numpy as np

from planner.recording.dof import DIRECTIONS, Dof
from planner.recording.geometry import Geometry

# Correlation lengths in spacings of the points, and likewise how far a beam carries on a bed that
# holds its points and lets them turn.
LENGTHS = (1.0, 1.5, 2.2, 3.3, 5.0, 8.0)
CARRIES = (2.0, 4.0, 8.0, 16.0)
# Of a beam one spacing long, over its bending stiffness: along itself and in torsion. Tubes and
# bars ten times as long as wide; torsion as of closed sections.
AXIAL, TORSION = 600.0, 0.8
BED_TURNS = 1e-6  # of its bending stiffness: holds turns that no beam holds
NUGGET = 0.03  # of the motion: rows err by this


def motion_fields(dofs: Sequence[Dof], geometry: Geometry) -> list[np.ndarray]:
    """Covariances (n, n) of motions at degrees of freedom of known place, one on average."""
    place = np.array([geometry.at(dof.node) for dof in dofs])
    direction = np.array([DIRECTIONS.index(dof.positive.direction) for dof in dofs])
    nodes = np.array(list({dof.node: place[k] for k, dof in enumerate(dofs)}.values()))
    spacing = float(np.median(_nearest(nodes)))
    same = direction[:, None] == direction
    apart = np.linalg.norm(place[:, None] - place, axis=-1)
    fields = []
    for length in LENGTHS:
        scaled = np.sqrt(5) * apart / (length * spacing)
        fields.append(same * (1 + scaled + scaled**2 / 3) * np.exp(-scaled))
    ends = {node for line in geometry.lines for node in line}
    if ends.issuperset(dof.node for dof in dofs) and np.all(direction > 0):
        fields += _of_beams(dofs, direction, geometry)
    return [field / np.mean(np.diag(field)) for field in fields]


def _nearest(place: np.ndarray) -> np.ndarray:
    """(n,) distance of each point to the next."""
    apart = np.linalg.norm(place[:, None] - place, axis=-1)
    return np.min(apart + np.diag(np.full(len(place), np.inf)), axis=1)


def _of_beams(dofs: Sequence[Dof], direction: np.ndarray, geometry: Geometry) -> list[np.ndarray]:
    """Flexibilities (n, n) of beams along the trace lines on beds of several stiffnesses."""
    every = list(dict.fromkeys(node for line in geometry.lines for node in line))
    index = {node: k for k, node in enumerate(every)}
    place = np.array([geometry.at(node) for node in every])
    along = np.array([place[index[b]] - place[index[a]] for a, b in geometry.lines])
    along /= np.median(np.linalg.norm(along, axis=1))
    stiffness = np.zeros((6 * len(every), 6 * len(every)))
    for (a, b), vector in zip(geometry.lines, along, strict=True):
        if np.any(vector):
            at = np.r_[6 * index[a] : 6 * index[a] + 6, 6 * index[b] : 6 * index[b] + 6]
            stiffness[np.ix_(at, at)] += _beam(vector)
    chosen = np.array([6 * index[dof.node] for dof in dofs]) + direction - 1
    moves = np.arange(len(stiffness)) % 6 < 3
    fields = []
    for reach in CARRIES:
        held = stiffness + np.diag(np.where(moves, 12 / reach**4, BED_TURNS))
        fields.append(np.linalg.inv(held)[np.ix_(chosen, chosen)])
    return fields


def _beam(vector: np.ndarray) -> np.ndarray:
    """(12, 12) stiffness of a slender beam (Euler and Bernoulli) between the ends of a vector."""
    length = float(np.linalg.norm(vector))
    axis = vector / length
    other = np.eye(3)[np.argmin(np.abs(axis))]
    side = np.cross(other, axis)
    side /= np.linalg.norm(side)
    turn = np.kron(np.eye(4), np.stack([axis, side, np.cross(axis, side)]))
    stiffness = np.zeros((12, 12))
    for at, value in (((0, 6), AXIAL / length), ((3, 9), TORSION / length)):
        stiffness[np.ix_(at, at)] += value * np.array([[1, -1], [-1, 1]])
    for at, sign in (((1, 5, 7, 11), 1), ((2, 4, 8, 10), -1)):
        b, c = 6 * length * sign, length**2
        bent = [[12, b, -12, b], [b, 4 * c, -b, 2 * c], [-12, -b, 12, -b], [b, 2 * c, -b, 4 * c]]
        stiffness[np.ix_(at, at)] += np.array(bent) / length**3
    return turn.T @ stiffness @ turn
