"""How each hit missed its axis and its point, by a fit of the hits' averages.

The fit's own numbers of a pose say how its hits along each axis missed in the middle. By what each
missed beside that its FRFs differ from the average, whatever the simulation lacks.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.dataset.hit_columns import HitColumns
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import solve_poles
from planner.fit.misfit import At
from planner.fit.posterior import RobotPosterior
from planner.measurement.nuisances import OF_HIT, Tolerances, hit_basis
from planner.modal.residues import Lines, laplace, unit
from planner.recording.points import TCP

AXES = 3
# Of an FRF: what no column describes, such as terms of second order. On generated cells (708 hits)
# intervals of 95 % then cover 97 % of tilts and 95 % of offsets.
RELATIVE = 0.005


@dataclass(frozen=True, eq=False)
class VisitHits:
    """The hits of a pose at q (dof,) in rad, that was among those fitted."""

    q: np.ndarray
    columns: HitColumns


@dataclass(frozen=True, eq=False)
class VisitMisses:
    """Of n hits, for a force along +axis: `mean` (n, 4) and `covariance` (4n, 4n).

    Two angles in rad and two offsets in m, across the axis in cyclic order.
    """

    mean: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, eq=False)
class Misses:
    """Of all visits, and the `simulation` that told them.

    `discrepancy` is the share of the FRFs that it does not explain.
    """

    visits: tuple[VisitMisses, ...]
    simulation: Simulation
    discrepancy: float


@dataclass(frozen=True, eq=False)
class SolvedPoses:
    """Poles (n, 2e) of n poses, residues (n, 2e, 6, 6): forces, moments to motion, turning."""

    poles: np.ndarray
    residues: np.ndarray

    @classmethod
    def of(cls, simulation: Simulation, q: np.ndarray) -> "SolvedPoses":
        """At q (n, dof) in rad."""
        m = simulation.elastic.matrices(q)
        stiffness = simulation.stiffness + m.geometric
        hit = np.concatenate([m.hit, m.hit_turn], axis=1)
        sensor = np.concatenate([m.sensor, m.sensor_turn], axis=1)
        solved = solve_poles(m.mass, simulation.damping, stiffness, hit, sensor)
        return cls(solved.poles, solved.residues)

    def misses(self, pose: int, lines: Lines, t: Tolerances) -> np.ndarray:
        """(3, 4, 3, F): changes of a hit along each axis by an sd of each number.

        As records that end would show them.
        """
        columns = unit(lines, self.poles[pose])
        flat = self.residues[pose].reshape(len(columns), -1)
        h = (flat.T @ columns).reshape(1, 6, 6, -1)
        return hit_basis(h[:, :3, :3], h[:, :3, 3:], t)[0]


def tell_misses(posterior: RobotPosterior, visits: Sequence[VisitHits]) -> Misses:
    """Misses of the hits of visits with at least one each."""
    misfit, found = posterior.found.misfit, posterior.found.at
    at = misfit(found.x, found.own, keep=True)
    solved = SolvedPoses.of(posterior.simulation, np.array([visit.q for visit in visits]))
    first = AXES * misfit.data.measured.layout.hits.index(TCP)
    own = slice(OF_HIT * first, OF_HIT * (first + AXES))
    t, told = posterior.tolerances, []
    for number, visit in enumerate(visits):
        pose = int(np.argmin(np.linalg.norm(misfit.data.q - visit.q, axis=1)))
        columns = visit.columns
        lines = laplace(columns.frequency_hz, columns.rate_1_s, columns.tail_s)
        moved = solved.misses(number, lines, t)
        told.append(_told(columns, _middle(at, pose, own), moved, t, posterior.size))
    return Misses(tuple(told), posterior.simulation, posterior.size)


def _middle(at: At, pose: int, own: slice) -> tuple[np.ndarray, np.ndarray]:
    """Mean (12,) and covariance (12, 12) of what the averages of a pose missed, in sds."""
    assert at.eliminated is not None
    inverse = at.eliminated.inverses[pose][:, own]
    by_x = -inverse.T @ at.eliminated.onto[pose][:, : len(at.x)]
    return at.own[pose, own], inverse.T @ inverse + by_x @ at.covariance @ by_x.T


def _told(
    columns: HitColumns,
    middle: tuple[np.ndarray, np.ndarray],
    moved: np.ndarray,
    t: Tolerances,
    size: float,
) -> VisitMisses:
    count = len(columns.axis)
    mean, covariance = np.zeros((count, OF_HIT)), np.zeros((count, OF_HIT, count, OF_HIT))
    of_axis = middle[1].reshape(AXES, OF_HIT, AXES, OF_HIT)
    for axis in range(AXES):
        group = np.flatnonzero(columns.axis == axis)
        if not len(group):
            continue
        z, each = _beside(columns, group, moved[axis])
        apart = np.eye(len(group)) - columns.share[group].mean(axis=1)
        mean[group] = middle[0].reshape(AXES, OF_HIT)[axis] + apart @ z
        own = np.einsum("kj,lj,jab->kalb", apart, apart, each)
        covariance[np.ix_(group, range(OF_HIT), group, range(OF_HIT))] += own
    covariance += of_axis[columns.axis][:, :, columns.axis]
    scale = np.tile(np.repeat([t.angle_rad, t.offset_m], 2), count)
    # What a miss does is simulated too, and as wrong as the rest of the simulation.
    flat = covariance.reshape(len(scale), -1) + np.diag((size * mean.ravel()) ** 2)
    return VisitMisses((mean.ravel() * scale).reshape(-1, OF_HIT), flat * np.outer(scale, scale))


def _beside(
    columns: HitColumns, group: np.ndarray, moved: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Of hits along an axis, in sds: what each missed beside their average (k, 4), (k, 4, 4)."""
    h = columns.accelerance[group]
    apart = h - np.sum(columns.share[group][:, None] * h, axis=0)
    weight = np.sqrt(2 / (columns.variance[group] + (RELATIVE * np.abs(h)) ** 2))
    rows = (weight[:, None] * moved).reshape(len(group), OF_HIT, -1).view(float)
    left = (weight * apart).reshape(len(group), 1, -1).view(float)
    normal = rows @ np.swapaxes(rows, 1, 2) + np.eye(OF_HIT)
    covariance = np.linalg.inv(normal)
    return (covariance @ (rows @ np.swapaxes(left, 1, 2)))[..., 0], covariance
