"""What measurements of a campaign leave open, integrated out where an identification is.

What belongs to a pose (hits, readback) is eliminated pose by pose; the measuring chain is one for
all of them.
"""

from dataclasses import dataclass

import numpy as np

from planner.dynamics.motion import ActualPorts, Turned
from planner.measurement.nuisances import OpenNumbers, Tolerances, basis, real_rows


@dataclass(frozen=True, eq=False)
class Integrated:
    """χ² with all η integrated out, in all and of each pose (n,); half gradient, and normal."""

    chi2: float
    gradient: np.ndarray
    normal: np.ndarray
    by_pose: np.ndarray


@dataclass(frozen=True, eq=False)
class Estimated:
    """Estimates, in sds: `own` (n, 4c + dof) of each pose's hits and joints, `chain` (k,)."""

    own: np.ndarray
    chain: np.ndarray
    hits: int

    @property
    def numbers(self) -> np.ndarray:
        """(n, l) of all, as `OpenNumbers` counts them."""
        chain = np.tile(self.chain, (len(self.own), 1))
        return np.hstack([self.own[:, : self.hits], chain, self.own[:, self.hits :]])


@dataclass(frozen=True, eq=False)
class LeftOpen:
    """B of n poses, weighted, evaluated at one point and constant from there on.

    B grows with the simulated FRFs, and with B the error that is allowed: were it to change with
    the parameters, a fit would prefer those that make FRFs large. Simulated FRFs are those between
    the `actual` ports, so that they contain the misses found so far; `crossed` (n, r, c, F),
    weighted, subtracts these to first order, because `told` counts misses from zero.
    """

    poses: tuple["_PoseNumbers", ...]
    crossed: np.ndarray
    hits: int
    actual: ActualPorts | None = None

    @classmethod
    def at(
        cls,
        h: np.ndarray,
        turned: Turned,
        s: np.ndarray,
        weight: np.ndarray,
        tolerances: Tolerances,
        eta: np.ndarray | None = None,
    ) -> "LeftOpen":
        """Of accelerances h (n, r, c, F), around eta (n, l) if given, and the residuals' weight."""
        made = basis(h, turned, s, tolerances)
        made *= weight[:, None]
        crossed = np.zeros_like(h) if eta is None else -np.einsum("nl,nlijf->nijf", eta, made)
        numbers, used = OpenNumbers.of(h), np.repeat(weight > 0, 2, axis=-1)
        poses = (
            _PoseNumbers.of(
                real_rows(numbers.own(pose)), real_rows(numbers.shared(pose)), there.ravel()
            )
            for pose, there in zip(made, used, strict=True)
        )
        return cls(tuple(poses), crossed, numbers.hits, turned.actual)

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

    def told(self, residual: np.ndarray) -> Estimated:
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
        return Estimated(np.array(left), chain, self.hits)


@dataclass(frozen=True, eq=False)
class _PoseNumbers:
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
    def of(cls, mine: np.ndarray, shared: np.ndarray, used: np.ndarray) -> "_PoseNumbers":
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
