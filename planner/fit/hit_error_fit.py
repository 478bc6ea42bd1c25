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
from planner.fit.linearised import At
from planner.fit.posterior import RobotPosterior
from planner.measurement.nuisances import AIM, OF_HIT, Tolerances, hit_basis
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
class VisitHitErrors:
    """Of n hits, for a force along +axis: `mean` (n, 4) and `covariance` (4n, 4n).

    Two angles in rad and two offsets in m, across the axis in cyclic order.
    """

    mean: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, eq=False)
class HitErrorFit:
    """Of all visits, and the `simulation` that told them.

    `discrepancy` is the share of the FRFs that it does not explain.
    """

    visits: tuple[VisitHitErrors, ...]
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

    def hit_error_columns(self, pose: int, lines: Lines, t: Tolerances) -> np.ndarray:
        """(3, 4, 3, F): changes of a hit along each axis by an sd of each number.

        As records that end would show them.
        """
        columns = unit(lines, self.poles[pose])
        flat = self.residues[pose].reshape(len(columns), -1)
        h = (flat.T @ columns).reshape(1, 6, 6, -1)
        return hit_basis(h[:, :3, :3], h[:, :3, 3:], t)[0]


def fit_hit_errors(posterior: RobotPosterior, visits: Sequence[VisitHits]) -> HitErrorFit:
    """Misses of the hits of visits with at least one each."""
    misfit, found = posterior.found.misfit, posterior.found.at
    at = misfit(found.x, found.own, keep=True)
    solved = SolvedPoses.of(posterior.simulation, np.array([visit.q for visit in visits]))
    first = AXES * misfit.data.measured.layout.hits.index(TCP)
    own = slice(OF_HIT * first, OF_HIT * (first + AXES))
    poses = [int(np.argmin(np.linalg.norm(misfit.data.q - v.q, axis=1))) for v in visits]
    counts = np.array([np.bincount(v.columns.axis, minlength=AXES) for v in visits])
    middle = _middle(at, poses, own, np.repeat(counts, OF_HIT, axis=1))
    t, told = posterior.tolerances, []
    for number, visit in enumerate(visits):
        columns = visit.columns
        lines = laplace(columns.frequency_hz, columns.rate_1_s, columns.tail_s)
        moved = solved.hit_error_columns(number, lines, t)
        mine = middle[0][number], middle[1][number, :, number]
        told.append(_told(columns, mine, moved, t, posterior.size))
    return HitErrorFit(tuple(told), posterior.simulation, posterior.size)


def _middle(
    at: At, poses: Sequence[int], own: slice, counts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (n, 12) and covariance (n, 12, n, 12) of what the averages of poses missed, in sds.

    The fit takes an average's misses for those of one hit. Here they are of as many as there are,
    `counts` (n, 12), with an aim in common that a hand keeps.
    """
    assert at.eliminated is not None
    inverse, onto = at.eliminated.inverses[poses][:, :, own], at.eliminated.onto[poses]
    n, size = counts.shape
    by_x = -(np.swapaxes(inverse, 1, 2) @ onto[:, :, : len(at.x)]).reshape(n * size, -1)
    fitted = by_x @ at.covariance @ by_x.T
    prior = np.kron(np.full((n, n), AIM**2), np.eye(size))
    prior += np.diag(1 / np.maximum(counts, 1).ravel())
    for k, one in enumerate(inverse):
        rows = slice(size * k, size * (k + 1))
        fitted[rows, rows] += one.T @ one
    precision = np.linalg.inv(fitted)
    covariance = np.linalg.inv(precision - np.eye(n * size) + np.linalg.inv(prior))
    mean = covariance @ (precision @ at.own[poses][:, own].ravel())
    return mean.reshape(n, size), covariance.reshape(n, size, n, size)


def _told(
    columns: HitColumns,
    middle: tuple[np.ndarray, np.ndarray],
    moved: np.ndarray,
    t: Tolerances,
    size: float,
) -> VisitHitErrors:
    count = len(columns.axis)
    mean, covariance = np.zeros((count, OF_HIT)), np.zeros((count, OF_HIT, count, OF_HIT))
    of_axis = middle[1].reshape(AXES, OF_HIT, AXES, OF_HIT)
    for axis in range(AXES):
        group = np.flatnonzero(columns.axis == axis)
        if not len(group):
            continue
        # As the average that was fitted has them, see `planner.frf.estimator`.
        strength = np.sum(1 / columns.variance[group], axis=(1, 2))
        share = strength / strength.sum()
        z, each = _beside(columns, group, share, moved[axis])
        apart = np.eye(len(group)) - share
        mean[group] = middle[0].reshape(AXES, OF_HIT)[axis] + apart @ z
        own = np.einsum("kj,lj,jab->kalb", apart, apart, each)
        numbers = np.arange(OF_HIT)
        covariance[np.ix_(group, numbers, group, numbers)] += own
    covariance += of_axis[columns.axis][:, :, columns.axis]
    scale = np.tile(np.repeat([t.angle_rad, t.offset_m], 2), count)
    # What a miss does is simulated too, and as wrong as the rest of the simulation.
    flat = covariance.reshape(len(scale), -1) + np.diag((size * mean.ravel()) ** 2)
    return VisitHitErrors((mean.ravel() * scale).reshape(-1, OF_HIT), flat * np.outer(scale, scale))


def _beside(
    columns: HitColumns, group: np.ndarray, share: np.ndarray, moved: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Of hits along an axis, in sds: what each missed beside their average (k, 4), (k, 4, 4)."""
    h = columns.accelerance[group]
    apart = h - np.einsum("k,krf->rf", share, h)
    weight = np.sqrt(2 / (columns.variance[group] + (RELATIVE * np.abs(h)) ** 2))
    rows = (weight[:, None] * moved).reshape(len(group), OF_HIT, -1).view(float)
    left = (weight * apart).reshape(len(group), 1, -1).view(float)
    # Not by normal equations: where the simulation is far off, these are singular to rounding.
    u, s, _ = np.linalg.svd(rows, full_matrices=False)
    covariance = (u / (1 + s[:, None] ** 2)) @ np.swapaxes(u, 1, 2)
    return (covariance @ (rows @ np.swapaxes(left, 1, 2)))[..., 0], covariance
