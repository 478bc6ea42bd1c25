"""Inertias that a body can have: a barrier between them and those that no matter can form.

A rigid body's mass, first moments and moments of inertia form the pseudo-inertia P (4, 4), which is
positive definite for every body of finite density (Wensing, Kim & Slotine 2018, eq. 20). The
Bregman divergence of -log det P from the nominal body's is 0 there, grows as a square nearby and
to infinity where P ceases to be positive definite (Lee, Wensing & Park 2020, eq. 24).
"""

from dataclasses import dataclass

import numpy as np

from planner.effects.parameters import Parametrisation
from planner.fit.inertias import pseudo_inertia


@dataclass(frozen=True, eq=False)
class Barrier:
    """Divergence of bodies from the nominal ones; bodies that are nominally nothing are free.

    `slope` (B, p, 4, 4) is that of P by one sd of each of p parameters, in coordinates in which the
    nominal P is one.
    """

    slope: np.ndarray

    @classmethod
    def around(cls, nominal: np.ndarray, parametrisation: Parametrisation) -> "Barrier | None":
        """For bodies of inertia `nominal` (B, 10); None where inertias are taken for exact."""
        if not parametrisation.nuisances:
            return None
        change = pseudo_inertia(parametrisation.inertia)
        out = np.zeros_like(change)
        for b, at in enumerate(pseudo_inertia(nominal)):
            if np.all(np.linalg.eigvalsh(at) > 0):
                root = np.linalg.inv(np.linalg.cholesky(at))
                out[b] = root @ change[b] @ root.T
        return cls(out)

    def __call__(self, phi: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """Value, gradient (R,) and Hessian (R, R) at φ (R,) in sds; ∞ where a body cannot be."""
        bodies, p = self.slope.shape[:2]
        at = np.eye(4) + np.einsum("bp,bpij->bij", phi.reshape(bodies, p), self.slope)
        gradient, hessian = np.zeros(bodies * p), np.zeros((bodies * p, bodies * p))
        values, vectors = np.linalg.eigh(at)
        if values.min() <= 0:
            return np.inf, gradient, hessian
        inverse = (vectors / values[:, None]) @ np.swapaxes(vectors, 1, 2)
        moved = inverse[:, None] @ self.slope
        trace = np.trace(self.slope, axis1=2, axis2=3)
        gradient = (trace - np.trace(moved, axis1=2, axis2=3)).ravel()
        for b in range(bodies):
            own = slice(b * p, (b + 1) * p)
            hessian[own, own] = np.einsum("iab,jba->ij", moved[b], moved[b])
        return float(np.sum(values - 1 - np.log(values))), gradient, hessian
