"""FRFs of a simulation, linear in what its hits, chain and readback leave open, around a guess.

A hit that misses under a sensor that errs is bilinear in both, and in every spring and inertia:
around the stated ports, derivatives are off by as much as hands miss, and where a parameter acts
nearly as misses do, that is all there is to see. So what is left open is told first around the
stated ports, and the derivatives are taken around what was told (Gauss-Newton over all of them
together; the misses, which are of one pose, are eliminated, as points are in bundle adjustment).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.dynamics.motion import Turned
from planner.measurement.nuisances import (
    Block,
    Marginal,
    Part,
    Tolerances,
    blocks,
    marginal_of,
    real_rows,
)


@dataclass(frozen=True, eq=False)
class AroundMisses:
    """Of n poses, in units of the noise: what is left if nothing missed, and how that changes.

    `residual` (n, r, c, F) with its derivatives `slope` (n, d, r, c, F), None where those were not
    asked for, and with `open` by the numbers that are left open; all around `eta` (n, l) of those,
    in sds. `loose` (P,) are sds by which the first P parameters differ from pose to pose.
    """

    residual: np.ndarray
    slope: np.ndarray | None
    open: tuple[Block, ...]
    weight: np.ndarray
    eta: np.ndarray
    loose: np.ndarray

    @classmethod
    def of(
        cls,
        off: np.ndarray,
        slope: np.ndarray | None,
        turned: Turned,
        h: np.ndarray,
        s: np.ndarray,
        weight: np.ndarray,
        tolerances: Tolerances,
        eta: np.ndarray | None = None,
        loose: np.ndarray | None = None,
    ) -> "AroundMisses":
        """Of accelerances h (n, r, c, F) at s (n, F) that are `off` what was measured.

        `slope` is written over.
        """
        open_ = blocks(h, turned, s, tolerances)
        for one in open_:
            one.basis[:] *= weight[:, None, one.rows, one.columns]
        count = 1 + max(int(one.numbers.max()) for one in open_)
        residual = weight * off
        if eta is None:
            eta = np.zeros((len(h), count))
        else:
            for one in open_:
                part = residual[:, one.rows, one.columns]
                part -= np.einsum("nl,nlijf->nijf", eta[:, one.numbers], one.basis)
        if slope is not None:
            slope *= weight[:, None]
        loose = np.zeros(0) if loose is None or slope is None else loose
        return cls(residual, slope, open_, weight, eta, loose)

    def marginal(self, pose: int) -> Marginal:
        """Misfit of a pose, its misses being integrated out; E[η] is absolute."""
        size, d = self.eta.shape[1], 0 if self.slope is None else self.slope.shape[1]
        return marginal_of(self._parts(pose), size + len(self.loose), d)

    def misses(self) -> np.ndarray:
        """The likeliest numbers (n, l) that are left open, in sds."""
        n, size = self.eta.shape
        if len(self.loose):
            return np.array([-self.marginal(i).eta[:size] for i in range(n)])
        inner, onto = np.tile(np.eye(size), (n, 1, 1)), np.zeros((n, size))
        for one in self.open:
            b = one.basis.reshape(n, len(one.numbers), -1).view(float)
            r = np.ascontiguousarray(self.residual[:, one.rows, one.columns])
            inner[:, one.numbers[:, None], one.numbers] += b @ np.swapaxes(b, 1, 2)
            onto[:, one.numbers] += (b @ r.reshape(n, -1).view(float)[..., None])[..., 0]
        return -np.linalg.solve(inner, onto[..., None])[..., 0]

    def left(self, eta: np.ndarray) -> np.ndarray:
        """(n, r, c, F): residuals where what is left open is eta (n, l)."""
        out = self.residual.copy()
        for one in self.open:
            out[:, one.rows, one.columns] += np.einsum(
                "nl,nlijf->nijf", eta[:, one.numbers], one.basis
            )
        return out

    def net(self, values: np.ndarray) -> np.ndarray:
        """Of changes (n, k, r, c, F) in units of the noise what misses would leave of them."""
        out = np.empty_like(values)
        for i, (one, opened) in enumerate(zip(values, self.opened(), strict=True)):
            b, rows = real_rows(opened), real_rows(one)
            taken = np.linalg.solve(np.eye(len(b)) + b @ b.T, b @ rows.T)
            out[i] = (rows - taken.T @ b).view(complex).reshape(one.shape)
        return out

    def opened(self) -> np.ndarray:
        """(n, l, r, c, F): how residuals change by each of the numbers, per sd."""
        n, *shape = self.residual.shape
        out = np.zeros((n, self.eta.shape[1], *shape), dtype=complex)
        for one in self.open:
            out[:, one.numbers, one.rows, one.columns] = one.basis
        return out

    def _parts(self, pose: int) -> Sequence[Part]:
        parts, size = [], self.eta.shape[1]
        for one in self.open:
            seen = self.weight[pose, one.rows, one.columns].any()
            if len(self.open) > 1 and not seen:
                continue
            r = one.of(self.residual[pose][None])[0]
            j = np.zeros((0, len(r))) if self.slope is None else one.of(self.slope[pose])
            b, numbers = real_rows(one.basis[pose]), one.numbers
            if len(self.loose):
                b = np.concatenate([b, self.loose[:, None] * j[: len(self.loose)]])
                numbers = np.concatenate([numbers, size + np.arange(len(self.loose))])
            parts.append(Part(r, j, b, numbers))
        return parts
