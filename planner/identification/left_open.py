"""What measurements of a campaign leave open, integrated out where an identification is.

What belongs to a pose (hits, readback) is eliminated pose by pose; the measuring chain is one for
all of them.
"""

from dataclasses import dataclass

import numpy as np

from planner.dynamics.motion import Turned
from planner.identification.measurement_model import (
    OF_HIT,
    OpenNumbers,
    Tolerances,
    basis,
    chain_basis,
    hit_basis,
    real_rows,
)


@dataclass(frozen=True, eq=False)
class Integrated:
    """χ² with all η integrated out, in all and of each pose (n,); half gradient, and normal."""

    chi2: float
    gradient: np.ndarray
    normal: np.ndarray
    by_pose: np.ndarray


@dataclass(frozen=True, eq=False)
class Told:
    """Estimates, in sds: `own` (n, 4c + dof) of each pose's hits and joints, `chain` (k,)."""

    own: np.ndarray
    chain: np.ndarray


@dataclass(frozen=True, eq=False)
class LeftOpen:
    """B of n poses, weighted, as it is somewhere and held there.

    `crossed` (n, r, c, F), weighted, is what goes beyond first order. Were B to follow the
    parameters, larger FRFs would seem to fit better, having larger B.
    """

    poses: tuple["_Pose", ...]
    crossed: np.ndarray

    @classmethod
    def at(
        cls,
        h: np.ndarray,
        turned: Turned,
        s: np.ndarray,
        weight: np.ndarray,
        tolerances: Tolerances,
        told: Told | None = None,
    ) -> "LeftOpen":
        """Of accelerances h (n, r, c, F) and the weight of residuals.

        With `told`, what the chain makes of hits that miss, of second order, is that of these
        estimates. (B itself must not follow them: it would then be fitted to the same noise.)
        """
        made = basis(h, turned, s, tolerances)
        crossed = np.zeros_like(h) if told is None else _crossed(made, turned, s, tolerances, told)
        made *= weight[:, None]
        numbers, used = OpenNumbers.of(h), np.repeat(weight > 0, 2, axis=-1)
        poses = (
            _Pose.of(real_rows(numbers.own(pose)), real_rows(numbers.shared(pose)), there.ravel())
            for pose, there in zip(made, used, strict=True)
        )
        return cls(tuple(poses), weight * crossed)

    def integrated(self, residual: np.ndarray, slope: np.ndarray) -> Integrated:
        """Of residuals (n, r, c, F) and their derivatives (n, d, r, c, F), both weighted."""
        residual = residual + self.crossed
        d, k = slope.shape[1], len(self.poses[0].common)
        chi2, gradients = np.empty(len(residual)), np.empty((len(residual), d + k))
        whole, shared = np.zeros((d + k, d + k)), np.array([pose.normal for pose in self.poses])
        for i, pose in enumerate(self.poses):
            r, j = pose.values(residual[i, None])[0], pose.values(slope[i])
            onto, moved = pose.own @ r, pose.own @ j.T
            chi2[i] = r @ r - onto @ onto
            gradients[i, :d] = j @ r - moved.T @ onto
            gradients[i, d:] = pose.common @ r
            whole[:d, :d] += j @ j.T - moved.T @ moved
            whole[:d, d:] += j @ pose.common.T
        whole[d:, :d], whole[d:, d:] = whole[:d, d:].T, shared.sum(axis=0)
        pull = gradients.sum(axis=0)
        # The common numbers at their best, and what that takes from all else.
        right = np.column_stack([pull[d:], whole[d:, :d]])
        solved = np.linalg.solve(whole[d:, d:] + np.eye(k), right)
        eta, across = -solved[:, 0], solved[:, 1:]
        by_pose = chi2 + 2 * gradients[:, d:] @ eta + np.einsum("nij,i,j->n", shared, eta, eta)
        return Integrated(
            float(chi2.sum() + pull[d:] @ eta),
            pull[:d] + whole[:d, d:] @ eta,
            whole[:d, :d] - whole[:d, d:] @ across,
            by_pose,
        )

    def told(self, residual: np.ndarray) -> Told:
        """What weighted residuals (n, r, c, F) tell of the numbers."""
        off = residual + self.crossed
        flat = [pose.values(one[None])[0] for pose, one in zip(self.poses, off, strict=True)]
        whole, pull = np.eye(len(self.poses[0].common)), np.zeros(len(self.poses[0].common))
        for pose, r in zip(self.poses, flat, strict=True):
            whole += pose.normal
            pull += pose.common @ r
        chain = -np.linalg.solve(whole, pull)
        left = [
            -np.linalg.solve(pose.factor.T, pose.own @ r + pose.across @ chain)
            for pose, r in zip(self.poses, flat, strict=True)
        ]
        return Told(np.array(left), chain)


@dataclass(frozen=True, eq=False)
class _Pose:
    """B of one pose on the m real values that were measured there, which `used` marks.

    `own` (l, m) is whitened (by `factor`), so that integrating out subtracts the square of what is
    projected on it. Of the chain's numbers, which all poses share, `common` (k, m) is what is left
    where the pose's own take their part, `across` (l, k) that part, and `normal` (k, k).
    """

    used: np.ndarray
    own: np.ndarray
    factor: np.ndarray
    common: np.ndarray
    across: np.ndarray
    normal: np.ndarray

    @classmethod
    def of(cls, mine: np.ndarray, shared: np.ndarray, used: np.ndarray) -> "_Pose":
        if not used.all():
            mine, shared = mine[:, used], shared[:, used]
        factor = np.linalg.cholesky(np.eye(len(mine)) + mine @ mine.T)
        own = np.linalg.solve(factor, mine)
        across = own @ shared.T
        normal = shared @ shared.T - across.T @ across
        return cls(used, own, factor, shared - across.T @ own, across, normal)

    def values(self, some: np.ndarray) -> np.ndarray:
        """Of values (d, r, c, F) those that were measured, as real rows (d, m)."""
        rows = real_rows(some)
        return rows if self.used.all() else rows[:, self.used]


def _crossed(
    made: np.ndarray, turned: Turned, s: np.ndarray, t: Tolerances, told: Told
) -> np.ndarray:
    """Of second order (n, r, c, F): what the chain makes of the misses, both as they are told."""
    count = OpenNumbers.of(made)
    hits, joints = made[:, : count.hits], made[:, count.known :]
    missed = np.einsum("nl,nlijf->nijf", told.own[:, : count.hits], hits)
    missed += np.einsum("nl,nlijf->nijf", told.own[:, count.hits :], joints)
    turns = hit_basis(turned.turning, turned.twisting, t)
    numbers = told.own[:, : count.hits].reshape(len(made), -1, OF_HIT)
    turning = np.einsum("nam,namif->niaf", numbers, turns)
    return np.einsum("k,nkijf->nijf", told.chain, chain_basis(missed, turning, s, t))
