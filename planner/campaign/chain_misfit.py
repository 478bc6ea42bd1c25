"""Misfit of a simulation with its measuring chain to the FRFs of a campaign, pose by pose."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.diagnosis.linear.around_misses import AroundMisses
from planner.diagnosis.linear.objective import Misfit
from planner.diagnosis.linear.problem import tolerances_of
from planner.dynamics.motion import ActualPorts, Turned
from planner.identification.feasible_inertias import Barrier
from planner.identification.measurement_model import (
    CHAIN_NUMBERS,
    HIT_NUMBERS,
    OPEN,
    Block,
    basis,
)
from planner.identification.missed_ports import actual_ports, guess
from planner.inference.least_squares import Quadratic

CHAIN = CHAIN_NUMBERS  # numbers of the chain, which are the same at all poses
OF_CHAIN = slice(HIT_NUMBERS, OPEN)  # where they are among all that a pose leaves open


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

    def around(self, z: np.ndarray) -> AroundMisses:
        """FRFs at z and what hits and readback of each pose leave open, around its likeliest.

        The chain is as z says: else the lighter robot under a lower gain would not look the same,
        and a fit would end where it began.
        """
        eta, few = self._of_chain(z), ChainMisfit(self.misfit.few_lines)
        h, turned = few.misfit.values(z[:-CHAIN], few._ports(eta))
        told = guess(few._around(h, turned, eta).misses())
        eta[:, own_numbers(eta.shape[1])] = told
        h, slope, turned = self.misfit.parts(z[:-CHAIN], self._ports(eta))
        return self._around(h, turned, eta, slope)

    def shown(self, z: np.ndarray) -> np.ndarray:
        """FRFs (n, 3, 3, F) in m/s²/N at z as the chain shows them; no hit misses."""
        return self.misfit.values(z[:-CHAIN], self._ports(self._of_chain(z)))[0]

    def _of_chain(self, z: np.ndarray) -> np.ndarray:
        """Open numbers (n, l) where the chain is as z says, and nothing else is off."""
        q, known = self.misfit.setting.q, self.misfit.matrices.by_angle is not None
        eta = np.zeros((len(q), OPEN + (q.shape[1] if known else 0)))
        eta[:, OF_CHAIN] = z[-CHAIN:]
        return eta

    def _ports(self, eta: np.ndarray) -> ActualPorts:
        setting, shape = self.misfit.setting, self.misfit.measured.accelerance.shape[1:3]
        return actual_ports(eta, setting.s, tolerances_of(setting.simulation), shape)

    def _around(
        self, h: np.ndarray, turned: Turned, eta: np.ndarray, slope: np.ndarray | None = None
    ) -> AroundMisses:
        m, setting, weight = self.misfit.measured, self.misfit.setting, self.misfit.weight
        open_ = basis(h, turned, setting.s, tolerances_of(setting.simulation))
        open_ *= weight[:, None]
        own = own_numbers(open_.shape[1])
        hits, missed = open_[:, own], eta[:, own]
        residual = weight * (h - m.accelerance) - np.einsum("nl,nlijf->nijf", missed, hits)
        if slope is not None:
            slope = np.concatenate([weight[:, None] * slope, open_[:, OF_CHAIN]], axis=1)
        block = Block(slice(3), slice(3), np.arange(len(own)), hits)
        return AroundMisses(residual, slope, (block,), weight, missed, np.zeros(0))

    def __call__(self, z: np.ndarray) -> FrfEvidence:
        """∞ where z cannot be."""
        prior = self.prior(z)
        if not np.isfinite(prior.value) or not self.misfit.possible(z[:-CHAIN]):
            nothing = np.zeros(len(z))
            return FrfEvidence(np.inf, nothing, np.diag(nothing), np.inf, ())
        around, data = self.around(z), []
        for i, weight in enumerate(self.misfit.weight):
            found = around.marginal(i)
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


def own_numbers(count: int) -> np.ndarray:
    """Of a pose's open numbers those that are its own: of its hits, and of its joints' readback."""
    return np.append(np.arange(HIT_NUMBERS), np.arange(OPEN, count))
