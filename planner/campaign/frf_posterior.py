"""What simulation and measuring chain are believed to be after the FRFs of all measured poses.

A hit misses its axis and its point by itself; the measuring chain errs alike at every pose. So hits
are integrated out pose by pose, and the chain is estimated together with the simulation: what all
poses have in common may be a gain or a mass, and FRFs elsewhere are as uncertain as that.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.campaign.chain_misfit import CHAIN, ChainMisfit, FrfEvidence
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.predict import misfit_at
from planner.diagnosis.linear.problem import Grade, Problem
from planner.identification.objective import FARTHEST, NEARLY
from planner.inference.evidence import laplace
from planner.inference.least_squares import (
    LONGEST,
    Damping,
    Limits,
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
# Of all poses together, and of one at least and at most: by fewer than identify a simulation
# between hits, FRFs would be less exact than its own.
LINES, LEAST, MOST = 300, 20, 80
TOLERANCE, MOST_STEPS = 5e-5, 30  # of a fit: least gain of a step, and how many
# Of a fit's first step: a scale that mass and chain share has eigenvalues of 1e-5 of the diagonal.
LIGHT = Damping(first=1e-5)
# Model errors by which a fit that knows no place to begin at comes near, and steps at each: while
# FRFs count little, inertias and springs stay near their priors but for what matters most.
COARSE_ERRORS, COARSE_STEPS, COARSE_TOLERANCE = (0.5, 0.3, 0.1, 0.03), 20, 1e-3
FOLDS = 6  # that poses are left out in, at most
LEFT_STEPS = 3  # of a fit without a pose, from one with it


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
        prior = self.objective.prior(self.z).normal
        return (self.at.normal - prior) / temper + prior

    def log_evidence(self, temper: float) -> float:
        """By Laplace's method, χ² counting 1/temper."""
        away = np.sqrt(2 * self.objective.prior(self.z).value)[None]
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
    m, around, predicted = one.misfit.measured, one.around(z), one.shown(z)[0]
    weight = np.where(m.used[0], around.weight[0], np.inf)
    left = around.left(around.misses())[0] / weight
    assert around.slope is not None
    sd = _spread(_root(precision), around.slope[0] / weight)
    missed = np.where(m.used[0], m.accelerance[0] + left - predicted, 0.0)
    return LeftOutFrf(m.frequency_hz[0], m.accelerance[0], m.sd[0], predicted, sd, missed)


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


def fitted_afresh(problem: Problem, effect: Effect) -> FrfPosterior:
    """The same from the prior's mean, by FRFs that count more and more.

    As by deterministic annealing, this leads past minima where parts that the recordings do not
    tell make up for each other.
    """
    lines = closely(len(problem.q)).lines
    x = problem.misfit(effect, Grade(lines)).mean
    z = np.append(x, np.zeros(CHAIN))
    for error in COARSE_ERRORS:
        objective = ChainMisfit(problem.misfit(effect, Grade(lines, error)))
        z, _ = least(objective, z, COARSE_STEPS, COARSE_TOLERANCE)
    return fitted(problem, effect, z)


def least(
    objective: ChainMisfit, z: np.ndarray, most: int, tolerance: float = TOLERANCE
) -> tuple[np.ndarray, FrfEvidence]:
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
        if expected(state, trial) <= tolerance * state.at.value or state.stuck:
            break
        state = accept(state, trial, objective(trial))
    return state.x, state.at


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
