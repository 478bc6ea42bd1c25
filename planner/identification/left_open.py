"""What measurements of a campaign leave open, integrated out where an identification is.

What belongs to a pose (hits, readback) is eliminated pose by pose; the measuring chain is one for
all of them.
"""

from dataclasses import dataclass

import numpy as np

from planner.dynamics.gradient import Turned
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

    `own` (l, m) of each pose is whitened (by `factor`), so that integrating out subtracts the
    square of what is projected on it; `common` (k, m) is of numbers that all poses share: the
    chain of a campaign. `crossed` (n, r, c, F), weighted, is what goes beyond first order. Were B
    to follow the parameters, larger FRFs would seem to fit better, having larger B.
    """

    own: tuple[np.ndarray, ...]
    factor: tuple[np.ndarray, ...]
    common: tuple[np.ndarray, ...]
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
        numbers = OpenNumbers.of(h)
        own, factors, common = [], [], []
        for pose in made:
            mine = real_rows(numbers.own(pose))
            factor = np.linalg.cholesky(np.eye(len(mine)) + mine @ mine.T)
            own.append(np.linalg.solve(factor, mine))
            factors.append(factor)
            common.append(real_rows(numbers.shared(pose)))
        return cls(tuple(own), tuple(factors), tuple(common), weight * crossed)

    def integrated(self, residual: np.ndarray, slope: np.ndarray) -> Integrated:
        """Of residuals (n, r, c, F) and their derivatives (n, d, r, c, F), both weighted."""
        residual = residual + self.crossed
        d, k = slope.shape[1], len(self.common[0])
        chi2, gradients = np.empty(len(residual)), np.empty((len(residual), d + k))
        whole, shared = np.zeros((d + k, d + k)), np.empty((len(residual), k, k))
        for i, (own, common) in enumerate(zip(self.own, self.common, strict=True)):
            r, j = real_rows(residual[i, None])[0], np.concatenate([real_rows(slope[i]), common])
            onto, moved = own @ r, own @ j.T
            chi2[i] = r @ r - onto @ onto
            gradients[i] = j @ r - moved.T @ onto
            normal = j @ j.T - moved.T @ moved
            shared[i] = normal[d:, d:]
            whole += normal
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
        flat, k = real_rows(residual + self.crossed), len(self.common[0])
        whole, pull = np.eye(k), np.zeros(k)
        for own, common, r in zip(self.own, self.common, flat, strict=True):
            moved = own @ common.T
            whole += common @ common.T - moved.T @ moved
            pull += common @ r - moved.T @ (own @ r)
        chain = -np.linalg.solve(whole, pull)
        left = [
            -np.linalg.solve(factor.T, own @ (r + chain @ common))
            for own, factor, common, r in zip(self.own, self.factor, self.common, flat, strict=True)
        ]
        return Told(np.array(left), chain)


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
