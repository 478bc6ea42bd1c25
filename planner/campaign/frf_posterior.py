"""What simulation and measuring chain are believed to be after the FRFs of all measured poses.

A hit misses its axis and its point by itself; the measuring chain errs alike at every pose. So hits
are integrated out pose by pose, and the chain is estimated together with the simulation: what all
poses have in common may be a gain or a mass, and FRFs elsewhere are as uncertain as that.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.objective import Misfit
from planner.diagnosis.linear.predict import misfit_at
from planner.diagnosis.linear.problem import Grade, Problem, tolerances_of
from planner.identification.measurement_model import (
    CHAIN_NUMBERS,
    HIT_NUMBERS,
    OPEN,
    Tolerances,
    basis,
    marginal,
)
from planner.identification.objective import FARTHEST
from planner.inference.evidence import laplace
from planner.inference.least_squares import (
    LONGEST,
    Damping,
    Limits,
    Quadratic,
    accept,
    begin,
    expected,
    inverse,
    propose,
)

# The relative sd of what no simulation follows beside hits and chain: small
# imperfections, readback. Of generated cases those that lack nothing are predicted as well by 0.003
# to 0.03, those that lack something better the larger it is.
MODEL_ERROR = 0.01
LINES, LEAST, MOST = 240, 16, 72  # of all poses together, and of one at least and at most
CHAIN = CHAIN_NUMBERS  # numbers of the chain, which are the same at all poses
NEARLY = 0.999  # of the farthest that is possible
TOLERANCE, MOST_STEPS = 5e-5, 30  # of a fit: least gain of a step, and how many
# Of a fit's first step: a scale that mass and chain share has eigenvalues of 1e-5 of the diagonal.
LIGHT = Damping(first=1e-5)
FOLDS = 6  # that poses are left out in, at most
LEFT_STEPS = 3  # of a fit without a pose, from one with it


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
        if not self.misfit.possible(z[:-CHAIN]):
            nothing = np.zeros(len(z))
            return FrfEvidence(np.inf, nothing, np.diag(nothing), np.inf, ())
        h, slope, hits = self.parts(z)
        data = []
        for i, weight in enumerate(self.misfit.weight):
            off = shown(h[i], slope[i], z) - self.misfit.measured.accelerance[i]
            found = marginal(
                _real(weight * off)[0], _real(weight * slope[i]), _real(weight * hits[i])
            )
            count = 2 * int(np.count_nonzero(weight))
            data.append(PoseData(found.chi2, found.gradient, found.normal, count))
        chi2 = sum(d.chi2 for d in data)
        away = (z - self.mean) / self.sd
        return FrfEvidence(
            (chi2 + float(away @ away)) / 2,
            sum(d.gradient for d in data) + away / self.sd,
            sum(d.normal for d in data) + np.diag(1 / self.sd**2),
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


@dataclass(frozen=True, eq=False)
class LeftOutFrf:
    """FRFs (3, 3, F) of a measured pose beside what the others say of it.

    `measured`, its `noise_sd` (∞ where there is none), `predicted` as the chain would show it,
    `sd` of the prediction from parameters, and `missed`: what the pose's own hits explain of the
    difference, as far as hands miss.
    """

    frequency_hz: np.ndarray
    measured: np.ndarray
    noise_sd: np.ndarray
    predicted: np.ndarray
    sd: np.ndarray
    missed: np.ndarray


@dataclass(frozen=True, eq=False)
class FrfPosterior:
    """z at its best, and its covariance; `problem` and `effect` say of which simulation."""

    problem: Problem
    effect: Effect
    objective: ChainMisfit
    z: np.ndarray
    at: FrfEvidence

    @property
    def misfit(self) -> float:
        """χ² per real value, 1 at the noise; what hits and chain may be is counted in."""
        return self.at.chi2 / max(sum(d.count for d in self.at.data), 1)

    @property
    def temper(self) -> float:
        """By what χ² is divided: where the simulation is off, its parameters are less certain."""
        return max(self.misfit, 1.0)

    def precision(self, temper: float) -> np.ndarray:
        """(d, d) of z."""
        prior = np.diag(1 / self.objective.sd**2)
        return (self.at.normal - prior) / temper + prior

    def log_evidence(self, temper: float) -> float:
        """By Laplace's method, χ² counting 1/temper."""
        away = (self.z - self.objective.mean) / self.objective.sd
        return laplace(self.at.chi2, away, self.precision(temper), self.objective.sd, temper)

    def response(self, q: np.ndarray, frequency_hz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The robot's FRFs (n, 3, 3, F) in m/s²/N at q (n, dof) in rad; sd from what z leaves."""
        x = self.z[:-CHAIN]
        root = _root(self.precision(self.temper))[: len(x)]
        means, sds = [], []
        for row in np.atleast_2d(q):
            there = misfit_at(self.problem, self.effect, row[None], frequency_hz)
            h, slope, _ = there.parts(x)
            means.append(h[0])
            sds.append(_spread(root, slope[0]))
        return np.array(means), np.array(sds)

    def left_out(self) -> tuple[LeftOutFrf, ...]:
        """Every pose as the others predict it; they are fitted from where all of them led.

        Nothing of a single pose.
        """
        poses = np.arange(len(self.at.data))
        found: dict[int, LeftOutFrf] = {}
        folds = min(len(poses), FOLDS)
        for fold in range(folds if folds > 1 else 0):
            away = poses % folds == fold
            others = self.objective.of(poses[~away])
            z, at = least(others, self.z, LEFT_STEPS)
            rest = replace(self, objective=others, z=z, at=at)
            precision = rest.precision(rest.temper)
            for i in poses[away]:
                found[int(i)] = _beside(self.objective.of(poses[[i]]), z, precision)
        return tuple(found[i] for i in sorted(found))


def _beside(one: ChainMisfit, z: np.ndarray, precision: np.ndarray) -> LeftOutFrf:
    h, slope, hits = one.parts(z)
    m, weight = one.misfit.measured, one.misfit.weight[0]
    predicted = shown(h[0], slope[0], z)
    off = np.where(m.used[0], m.accelerance[0] - predicted, 0.0)
    b, r = _real(weight * hits[0]), _real(weight * off)[0]
    eta = np.linalg.solve(np.eye(len(b)) + b @ b.T, b @ r)
    return LeftOutFrf(
        m.frequency_hz[0], m.accelerance[0], m.sd[0], predicted,
        _spread(_root(precision), slope[0]), np.tensordot(eta, hits[0], axes=1),
    )  # fmt: skip


def closely(poses: int) -> Grade:
    """How closely so many poses are looked at: in about the same time however many they are."""
    return Grade(int(np.clip(LINES // poses, LEAST, MOST)), MODEL_ERROR)


def fitted(problem: Problem, effect: Effect, z: np.ndarray, most: int = MOST_STEPS) -> FrfPosterior:
    """The simulation of a problem with an effect, from z or x (the chain then exact) on."""
    objective = ChainMisfit(problem.misfit(effect, closely(len(problem.q))))
    size = len(objective.misfit.mean)
    z = z if len(z) > size else np.append(z, np.zeros(CHAIN))
    z, at = least(objective, z, most)
    return FrfPosterior(problem, effect, objective, z, at)


def least(objective: ChainMisfit, z: np.ndarray, most: int) -> tuple[np.ndarray, FrfEvidence]:
    """Where at most so many steps from z lead, and what is there; nothing leaves its bounds.

    Where the simulation lacks physics, inertias go as far as they may: the others go on.
    """
    reach = NEARLY * FARTHEST * objective.sd
    longest = np.append(objective.misfit.longest, np.full(CHAIN, LONGEST))
    limits = Limits(longest, objective.mean - reach, objective.mean + reach)
    z = np.clip(z, limits.lower, limits.upper)
    state = begin(z, objective(z), LIGHT, limits)
    for _ in range(most):
        trial = propose(state)
        if expected(state, trial) <= TOLERANCE * state.at.value or state.stuck:
            break
        state = accept(state, trial, objective(trial))
    return state.x, state.at


def _real(values: np.ndarray) -> np.ndarray:
    """(…, 3, 3, F) complex to (k, m) real."""
    shaped = values.reshape(-1, *values.shape[-3:])
    return np.ascontiguousarray(shaped).reshape(len(shaped), -1).view(float)


def _root(precision: np.ndarray) -> np.ndarray:
    """R with R Rᵀ the covariance."""
    covariance = inverse(precision)
    unit = np.sqrt(np.diagonal(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
    return unit[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))


def _spread(root: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Sd (3, 3, F) from derivatives (d, 3, 3, F) by parameters of covariance root rootᵀ."""
    moved = root.T @ slope.reshape(len(slope), -1)
    return np.sqrt(np.sum(moved.real**2 + moved.imag**2, axis=0)).reshape(slope.shape[1:])
