"""Misfit of a simulation with its measuring chain to the FRFs of a campaign, pose by pose."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.diagnosis.linear.objective import Misfit
from planner.diagnosis.linear.problem import tolerances_of
from planner.identification.feasible_inertias import Barrier
from planner.identification.measurement_model import (
    CHAIN_NUMBERS,
    HIT_NUMBERS,
    OPEN,
    Tolerances,
    basis,
    marginal,
    real_rows,
)
from planner.inference.least_squares import Quadratic

CHAIN = CHAIN_NUMBERS  # numbers of the chain, which are the same at all poses


@dataclass(frozen=True, eq=False)
class PoseData:
    """What one pose says of z: χ², half gradient (d,), normal (d, d), and how many values."""

    chi2: float
    gradient: np.ndarray
    normal: np.ndarray
    count: int


@dataclass(frozen=True, eq=False)
class FrfEvidence(Quadratic):
    """Data and prior at a z, and what each pose says there."""

    data: tuple[PoseData, ...]


@dataclass(frozen=True, eq=False)
class PriorAtPoint:
    """−ln of its density at a z but for a constant, its gradient (d,) and its normal (d, d)."""

    value: float
    gradient: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True, eq=False)
class ChainMisfit:
    """χ²/2 of data and prior over z = (x of a misfit (D,), the chain's deviations in sds (14,))."""

    misfit: Misfit

    @cached_property
    def mean(self) -> np.ndarray:
        """Prior mean of z."""
        return np.append(self.misfit.mean, np.zeros(CHAIN))

    @cached_property
    def sd(self) -> np.ndarray:
        """Prior sd of z."""
        return np.append(self.misfit.sd, np.ones(CHAIN))

    @cached_property
    def barrier(self) -> Barrier | None:
        """Keeps inertias from what no body can have."""
        elastic = self.misfit.setting.simulation.elastic
        return Barrier.around(elastic.inertia, self.misfit.parametrisation)

    def prior(self, z: np.ndarray) -> PriorAtPoint:
        """Of all that is known of z without the FRFs."""
        away, normal = (z - self.mean) / self.sd, np.diag(1 / self.sd**2)
        value, gradient = float(away @ away) / 2, away / self.sd
        if self.barrier is not None:
            a, b = self.misfit.split
            beyond, slope, curvature = self.barrier(z[a:b])
            value += beyond
            gradient[a:b] += slope
            normal[a:b, a:b] += curvature
        return PriorAtPoint(value, gradient, normal)

    def parts(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The robot's FRFs (n, 3, 3, F), derivatives by z, and what poses leave open (n, 18, …).

        Derivatives and misses are as the chain shows them: else the lighter robot under a lower
        gain would not look the same, and a fit would end where it began.
        """
        h, slope, turned = self.misfit.parts(z[:-CHAIN])
        s, tolerances = self.misfit.setting.s, tolerances_of(self.misfit.setting.simulation)
        open_ = basis(h, turned, s, tolerances)
        chain = open_[:, HIT_NUMBERS:OPEN]
        own = np.concatenate([open_[:, :HIT_NUMBERS], open_[:, OPEN:]], axis=1)
        own, slope = (v + through_chain(v, z[-CHAIN:], s, tolerances) for v in (own, slope))
        return h, np.concatenate([slope, chain], axis=1), own

    def __call__(self, z: np.ndarray) -> FrfEvidence:
        """∞ where z cannot be."""
        prior = self.prior(z)
        if not np.isfinite(prior.value) or not self.misfit.possible(z[:-CHAIN]):
            nothing = np.zeros(len(z))
            return FrfEvidence(np.inf, nothing, np.diag(nothing), np.inf, ())
        h, slope, hits = self.parts(z)
        data = []
        for i, weight in enumerate(self.misfit.weight):
            off = shown(h[i], slope[i], z) - self.misfit.measured.accelerance[i]
            found = marginal(
                real_rows((weight * off)[None])[0],
                real_rows(weight * slope[i]),
                real_rows(weight * hits[i]),
            )
            count = 2 * int(np.count_nonzero(weight))
            data.append(PoseData(found.chi2, found.gradient, found.normal, count))
        chi2 = sum(d.chi2 for d in data)
        return FrfEvidence(
            chi2 / 2 + prior.value,
            sum(d.gradient for d in data) + prior.gradient,
            sum(d.normal for d in data) + prior.normal,
            chi2,
            tuple(data),
        )

    def of(self, poses: np.ndarray) -> "ChainMisfit":
        """Of some of the poses, by their numbers."""
        m, s, inertias = self.misfit.measured, self.misfit.setting, self.misfit.inertias
        matrices = self.misfit.matrices
        some = replace(
            self.misfit,
            measured=m.at(poses),
            setting=replace(s, q=s.q[poses], s=s.s[poses], jacobians=s.jacobians[poses]),
            inertias=replace(inertias, jacobians=inertias.jacobians[poses]),
            matrices=matrices.at(poses),
        )
        return ChainMisfit(some)


def shown(h: np.ndarray, slope: np.ndarray, z: np.ndarray) -> np.ndarray:
    """FRFs (3, 3, F) as the chain shows them; `slope` (d, 3, 3, F) by z, the chain's last."""
    return h + np.tensordot(z[-CHAIN:], slope[-CHAIN:], axes=1)


def through_chain(
    values: np.ndarray, chain: np.ndarray, s: np.ndarray, t: Tolerances
) -> np.ndarray:
    """What a chain (CHAIN,) in sds adds to accelerations (n, k, 3, c, F); its place aside."""
    by_axis = chain[:9].reshape(3, 3) * np.where(np.eye(3) > 0, t.gain, t.across)
    alike = t.force_gain * chain[-2] - t.delay_s * chain[-1] * s
    return np.einsum("ij,nkjcf->nkicf", by_axis, values) + alike[:, None, None, None] * values
