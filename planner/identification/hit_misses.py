"""How each hit missed its axis and its point, told from all hits of all poses at once.

Every hit's column of the FRF matrix is, to first order, linear in what is not known: four numbers
of its own (`measurement_model`), an aim common to all hits along an axis, the measuring chain, the
readback of its pose, the simulation's parameters, and a discrepancy of the simulation at its pose
whose size is inferred. All have normal priors. What belongs to one pose is eliminated pose by
pose; what is common remains: parameters and chain are linearised again where they moved.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.dataset.hit_columns import HitColumns
from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.identification.measurement_model import AIM, CHAIN_NUMBERS, Tolerances
from planner.identification.objective import TOO_SOFT
from planner.identification.parameters import Parametrisation
from planner.identification.simulated_visit import SimulatedPoses
from planner.identification.visit_equations import (
    AIMED,
    OWN,
    VisitEquations,
    normal_equations,
)
from planner.modal.residues import laplace

UNSTABLE = 1e-6  # of a pole, that its real part is above 0: rounding is less
SIZES = (1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3)  # of the discrepancy, relative to modal shapes
FEWEST_LINES, LINES = 16, 192  # a pose, and of all poses that tell the common numbers together
STEPS = 4  # linearisations
STRIDE = 0.3  # prior sd of a step, in logarithms of springs and sds of inertias: it is damped
SHORTER = 0.3  # of the stride, after a step that led uphill
# Nats that a step gains, from which a further one is worth its time. From a simulation that was
# identified with hits and chain left open, one of 35 to 56 moved no hit by 0.2 of its sd, the
# next none by 0.03.
SETTLED = 100.0


@dataclass(frozen=True, eq=False)
class VisitHits:
    """The hits of a pose at q (dof,) in rad."""

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

    `discrepancy` is the inferred relative size of what it gets wrong in modal shapes.
    """

    visits: tuple[VisitMisses, ...]
    simulation: Simulation
    discrepancy: float


@dataclass(frozen=True, eq=False)
class Known:
    """A simulation's parameters: their priors' mean and sd (D,), and where they are."""

    nominal: Simulation
    parametrisation: Parametrisation
    x: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        """Prior mean (D,)."""
        p = self.parametrisation
        return np.concatenate([p.mean, np.zeros(len(p.nuisances))])

    @property
    def sd(self) -> np.ndarray:
        """Prior sd (D,)."""
        p = self.parametrisation
        return np.concatenate([p.log_sd, np.ones(len(p.nuisances))])

    def simulation(self, x: np.ndarray) -> Simulation:
        """At parameters x (D,)."""
        p, count = self.parametrisation, len(self.parametrisation.parameters)
        change = p.inertia_change(x[count:]) if p.nuisances else None
        return self.nominal.changed(p.elasticity(x[:count]), change)

    def near(self, x: np.ndarray) -> np.ndarray:
        """x where a prior still speaks of it."""
        count = len(self.parametrisation.parameters)
        return np.concatenate([self.parametrisation.near(x[:count]), np.clip(x[count:], -3, 3)])


def tell_misses(visits: Sequence[VisitHits], known: Known, t: Tolerances, tell_by: int) -> Misses:
    """Misses of the hits of all visits.

    Args:
        visits: With at least one hit each.
        known: The simulation, as it was identified from the hits' averages.
        t: Priors of hits and measuring chain.
        tell_by: How many of the visits, the last ones, tell what is common to all.
    """
    few = range(max(0, len(visits) - tell_by), len(visits))
    lines = int(np.clip(LINES // max(len(few), 1), FEWEST_LINES, LINES))
    common, stride = _Common(known, t), STRIDE
    best = common.at(known.x, np.zeros(CHAIN_NUMBERS), [visits[i] for i in few], lines)
    solved = best.likeliest()
    size = solved.size
    for _ in range(STEPS - 1):
        chain, step = solved.step(stride)
        x, heard = known.near(best.x + step), best.chain + chain
        try:
            tried = common.at(x, heard, [visits[i] for i in few], lines)
        except (np.linalg.LinAlgError, InputError):
            tried = None  # no robot can have such inertias
        there = None if tried is None else tried.solved(size)
        gain = -np.inf if there is None else there.here - solved.here
        if tried is None or there is None or gain < 0:
            stride *= SHORTER
            continue
        best, solved = tried, there
        if gain < SETTLED:
            break
    solved = best.likeliest()
    size = solved.size
    others = common.visits(best.simulation, best.chain, visits[: few.start], lines)
    told = [solved.misses(one) for one in (*others, *best.visits)]
    scale = np.repeat([t.angle_rad, t.offset_m], 2)
    found = tuple(_in_units(mean, covariance, scale, size) for mean, covariance in told)
    return Misses(found, best.simulation, size)


def _in_units(
    mean: np.ndarray, covariance: np.ndarray, scale: np.ndarray, size: float
) -> VisitMisses:
    # What a miss does is simulated too, and as wrong as the rest of the simulation.
    covariance = covariance + np.diag((size * mean) ** 2)
    every = np.tile(scale, len(mean) // OWN)
    return VisitMisses((mean * every).reshape(-1, OWN), covariance * np.outer(every, every))


@dataclass(frozen=True, eq=False)
class _Common:
    """What stays the same from linearisation to linearisation."""

    known: Known
    t: Tolerances

    def at(
        self, x: np.ndarray, chain: np.ndarray, visits: Sequence[VisitHits], lines: int
    ) -> "_Point":
        simulation = self.known.simulation(x)
        made = self.visits(simulation, chain, visits, lines)
        mean = np.concatenate([np.zeros(AIMED), -chain, self.known.mean - x])
        sd = np.concatenate([np.ones(AIMED + CHAIN_NUMBERS), self.known.sd])
        return _Point(x, chain, simulation, made, mean, sd)

    def visits(
        self, simulation: Simulation, chain: np.ndarray, visits: Sequence[VisitHits], most: int
    ) -> tuple[VisitEquations, ...]:
        if not visits:
            return ()
        q = np.array([visit.q for visit in visits])
        poses = SimulatedPoses.of(simulation, self.known.parametrisation, q)
        if np.any(poses.solved.poles.real > UNSTABLE * np.abs(poses.solved.poles)):
            raise InputError(TOO_SOFT)
        found = []
        for i, visit in enumerate(visits):
            columns = visit.columns
            count = len(columns.frequency_hz)
            kept = np.arange(count)
            if count > most:
                kept = np.linspace(0, count - 1, most).round().astype(int)
            lines = laplace(columns.frequency_hz[kept], columns.rate_1_s, columns.tail_s)
            h, variance = columns.accelerance[:, :, kept], columns.variance[:, :, kept]
            made = poses.visit(i, lines, self.t, chain)
            found.append(normal_equations(columns.axis, h, variance, made))
        return tuple(found)


@dataclass(frozen=True, eq=False)
class _Point:
    """All visits linearised at parameters x (D,) and `chain` (14,).

    Prior `mean` and `sd` of what is common to all are counted from there.
    """

    x: np.ndarray
    chain: np.ndarray
    simulation: Simulation
    visits: tuple[VisitEquations, ...]
    mean: np.ndarray
    sd: np.ndarray

    def likeliest(self) -> "_Solved":
        """With a discrepancy of the likeliest size."""
        return max(map(self.solved, SIZES), key=lambda solved: solved.evidence)

    def solved(self, size: float) -> "_Solved":
        """With a discrepancy of that size."""
        normal, right = np.diag(1 / self.sd**2), self.mean / self.sd**2
        evidence = -float(np.sum(np.log(self.sd)) + np.sum((self.mean / self.sd) ** 2) / 2)
        for visit in self.visits:
            eliminated = visit.eliminated(size)
            onto, own = eliminated.rest[:, :-1], eliminated.rest[:, -1]
            normal = normal + visit.normal[visit.local :, visit.local :] - onto.T @ onto
            right = right + visit.right[visit.local :] - onto.T @ own
            evidence += float(own @ own) / 2 - eliminated.volume - visit.chi2 / 2
        return _Solved(normal, right, evidence, size)


@dataclass(frozen=True, eq=False)
class _Solved:
    """Normal equations of what is common to all visits, the rest integrated out."""

    normal: np.ndarray
    right: np.ndarray
    rest: float
    size: float

    def _gain(self, chosen: slice) -> float:
        half = np.linalg.cholesky(self.normal[chosen, chosen])
        onto = np.linalg.solve(half, self.right[chosen])
        return float(onto @ onto) / 2

    @property
    def here(self) -> float:
        """Log likelihood and prior with chain and parameters where they are, aims at their best."""
        return self.rest + self._gain(slice(AIMED))

    @property
    def evidence(self) -> float:
        """Log marginal likelihood of the model linearised there."""
        return self.rest + self._gain(slice(None)) - float(np.linalg.slogdet(self.normal)[1]) / 2

    def step(self, stride: float) -> tuple[np.ndarray, np.ndarray]:
        """Change of the chain (14,) and of the parameters (D,), damped."""
        damping = np.zeros(len(self.right))
        damping[AIMED + CHAIN_NUMBERS :] = 1 / stride**2
        moved = np.linalg.solve(self.normal + np.diag(damping), self.right)[AIMED:]
        return moved[:CHAIN_NUMBERS], moved[CHAIN_NUMBERS:]

    @cached_property
    def _common(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean and covariance of what is common to all visits."""
        return np.linalg.solve(self.normal, self.right), np.linalg.inv(self.normal)

    def misses(self, visit: VisitEquations) -> tuple[np.ndarray, np.ndarray]:
        """Mean (4n,) and covariance (4n, 4n) of the hits' whole misses, in prior sds."""
        common, covariance = self._common
        eliminated, n = visit.eliminated(self.size), OWN * len(visit.axis)
        inverse, onto = eliminated.inverse[:, :n], eliminated.rest[:, :-1]
        own = inverse.T @ (eliminated.rest[:, -1] - onto @ common)
        by_common = -inverse.T @ onto
        for hit, axis in enumerate(visit.axis):
            at, aim = OWN * hit + np.arange(OWN), OWN * axis + np.arange(OWN)
            by_common[at, aim] += AIM
            own[at] += AIM * common[aim]
        return own, inverse.T @ inverse + by_common @ covariance @ by_common.T
