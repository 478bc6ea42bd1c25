"""What a linearised fit is worth where the discrepancy has one size, by Laplace's method."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.inference.least_squares import within_box


@dataclass(frozen=True, eq=False)
class AtSize:
    """−ln evidence over u, x's free entries in prior sds around their means, as an objective.

    At each u the k numbers of the chain are as they fit best, and what is a pose's own is
    integrated out. `left` (n, 1 + k + free, …) are inner products of residual, chain and
    derivatives by u, and `volumes` (n,) the logarithms that integrating cost; `told` (n, l, …) of a
    pose's own. `lower` and `upper` (free,) are the sides of what is looked at.
    """

    left: np.ndarray
    volumes: np.ndarray
    told: np.ndarray
    temper: float
    u: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @cached_property
    def chain(self) -> int:
        """How many numbers the chain has."""
        return self.left.shape[1] - 1 - len(self.u)

    @cached_property
    def _whole(self) -> np.ndarray:
        """Products of all poses, the prior of chain and u included but for the residual's own."""
        whole = self.left.sum(axis=0)
        whole[1:, 1:] += np.eye(len(whole) - 1)
        whole[0, 1 + self.chain :] += self.u
        whole[1 + self.chain :, 0] += self.u
        return whole

    @cached_property
    def _follows(self) -> np.ndarray:
        """(k, 1 + free): the chain where u stays, and how it goes with u."""
        of_chain = slice(1, 1 + self.chain)
        rest = np.r_[0, 1 + self.chain : len(self._whole)]
        return -np.linalg.solve(self._whole[of_chain, of_chain], self._whole[of_chain][:, rest])

    @cached_property
    def _without_chain(self) -> np.ndarray:
        """(1 + free, 1 + free): products once the chain follows."""
        rest = np.r_[0, 1 + self.chain : len(self._whole)]
        onto = self._whole[rest][:, 1 : 1 + self.chain] @ self._follows
        return self._whole[np.ix_(rest, rest)] + onto

    @property
    def normal(self) -> np.ndarray:
        """(free, free): Gauss-Newton matrix of the value."""
        return self._without_chain[1:, 1:]

    @property
    def gradient(self) -> np.ndarray:
        """(free,): of the value."""
        return self._without_chain[1:, 0]

    @property
    def value(self) -> float:
        """−ln evidence where u stays."""
        return -self.stays

    @cached_property
    def _constant(self) -> float:
        return float(self.volumes.sum() + np.linalg.slogdet(self._whole[1:, 1:])[1])

    @cached_property
    def stays(self) -> float:
        """Log evidence where u stays."""
        return -float(self._without_chain[0, 0] + self.u @ self.u + self._constant) / 2

    @cached_property
    def best(self) -> np.ndarray:
        """(free,): u where the linearised objective is least, within what is looked at."""
        lower, upper = (
            np.minimum(self.lower - self.u, 0.0), np.maximum(self.upper - self.u, 0.0)
        )  # fmt: skip
        return self.u + within_box(self.normal, -self.gradient, lower, upper)

    @cached_property
    def _each(self) -> np.ndarray:
        """(n,): χ² of each pose where it is best, tempered."""
        there = self._there(self.best)
        return np.einsum("i,nij,j->n", there, self.left, there)

    @cached_property
    def evidence(self) -> float:
        """Log evidence where it is best."""
        return -float(self._each.sum() + self._prior(self.best) + self._constant) / 2

    @property
    def scores(self) -> np.ndarray:
        """(n,): −2 ln likelihood of each pose where it is best."""
        return self._each + self.volumes

    @property
    def chi2(self) -> float:
        """Of all poses where it is best, without temper."""
        return self.temper * float(self._each.sum())

    def open_at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is each pose's own (n, l), and the chain (k,), in sds, where u is so."""
        there = self._there(u)
        return -self.told @ there, there[1 : 1 + self.chain]

    def _there(self, u: np.ndarray) -> np.ndarray:
        step = np.append(1.0, u - self.u)
        return np.concatenate([[1.0], self._follows @ step, step[1:]])

    def _prior(self, u: np.ndarray) -> float:
        chain = self._there(u)[1 : 1 + self.chain]
        return float(u @ u + chain @ chain)
