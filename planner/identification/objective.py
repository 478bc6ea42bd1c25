"""Misfit of simulated to measured FRFs, with gradient and Gauss-Newton matrix.

Two residuals. The logarithm of the ratio (as in the logarithmic least squares of van der Auweraer
et al. 1992, Guillaume et al. 1995) grows slowly with a shift of a resonance and so leads to the
right one from afar; the plain one, in units of the noise, is what has the least variance in the
end.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.dynamics.gradient import Inertias, motion_slopes, moved
from planner.dynamics.motion import ActualPorts, Motion, Turned
from planner.effects.parameters import Parametrisation
from planner.identification.feasible_inertias import Barrier
from planner.identification.left_open import Integrated, LeftOpen
from planner.inference.block_diagonal import block_diagonal
from planner.inference.least_squares import Quadratic
from planner.measurement.measured_frfs import Measured
from planner.measurement.missed_ports import actual_ports, guess
from planner.measurement.nuisances import Tolerances
from planner.measurement.truncated_decay import Completion, completion
from planner.robot.elastic_model import Matrices

LOG_FLOOR = 0.3  # relative sd that no logarithmic residual falls below: far-off models err by more
FARTHEST = 8.0  # sds of the prior beyond which nothing is looked for
NEARLY = 0.999  # of these, where a parameter stays that goes as far as it may
# Far from the truth the data err by bias, not noise, and neighbouring lines alike: the prior counts
# for more. Without this, dampers that lock a joint where a spring should give are traps.
LOG_PRIOR = 10.0
LOG_DROP = 0.3  # relative noise above which a value has no logarithm worth fitting


def weight_of(m: Measured, logarithmic: bool) -> np.ndarray:
    """(n, 3, 3, F): one over the sd of a residual's real (and imaginary) part, 0 where unused.

    In N·s²/m, accelerance being in m/s²/N; of logarithms without a unit.
    """
    if not logarithmic:
        return np.sqrt(2) / m.sd
    relative = m.sd / np.abs(m.accelerance)
    kept = relative < LOG_DROP
    return np.where(kept, np.sqrt(2) / np.hypot(np.where(kept, relative, 1), LOG_FLOOR), 0.0)


@dataclass(frozen=True, eq=False)
class Objective:
    """χ²/2 of the data plus that of the prior, over θ (P springs), then φ (R nuisances in sds).

    The prior weighs LOG_PRIOR times as much beside logarithms. What the measurement leaves open, as
    it was `opened`, is integrated out; unless it was, hits and measuring chain are exact.
    """

    measured: Measured
    matrices: Matrices
    inertias: Inertias
    parametrisation: Parametrisation
    logarithmic: bool
    free_inertia: bool
    completion: Completion | None = None  # what the records lack, around `completed_at`
    completed_at: np.ndarray | None = None
    barrier: Barrier | None = None  # keeps inertias from what no body can have
    left_open: LeftOpen | None = None

    def completed(self, x: np.ndarray, sloped: bool = True) -> "Objective":
        """With the decays that the records cut off, as they are at x and to first order near.

        Not `sloped`: as they are at x everywhere, which is quicker.
        """
        count = len(self.parametrisation.parameters)
        springs, mass = self.parametrisation.elasticity(x[:count]), self._mass(x[count:])
        m = self.measured
        slope = None
        if self.free_inertia and sloped:
            slope = np.array([self.inertias.mass_change(one) for one in np.eye(len(x) - count)])
        made = completion(self.matrices, springs, mass, m.s, m.tail_s, m.sd, slope, sloped)
        return replace(self, completion=made, completed_at=x)

    def opened(self, x: np.ndarray, tolerances: Tolerances) -> "Objective":
        """With what these tolerances of hits, chain and readback leave open, as it is at x.

        Around what the data tell of it there, if it was opened before.
        """
        s, weight, eta = self.measured.s, weight_of(self.measured, False), None
        if self.left_open is not None:
            lost = 0.0 if self.completion is None else self.completion.values
            off = self._motion(x).accelerance - lost - self.measured.accelerance
            told = self.left_open.told(weight * off).numbers
            eta = guess(told)
        actual = None if eta is None else actual_ports(eta, s, tolerances, weight.shape[1:3])
        motion = self._motion(x, actual)
        turned = Turned((motion,))
        opened = LeftOpen.at(motion.accelerance, turned, s, weight, tolerances, eta)
        return replace(self, left_open=opened)

    def _motion(self, x: np.ndarray, actual: ActualPorts | None = None) -> Motion:
        """At x, between the ports that are known unless others are given."""
        p, count = self.parametrisation, len(self.parametrisation.parameters)
        if actual is None and self.left_open is not None:
            actual = self.left_open.actual
        springs = p.elasticity(x[:count])
        s, mass = self.measured.s, self._mass(x[count:])
        return moved(self.matrices, springs, s, mass, actual=actual)

    def by_pose(self, x: np.ndarray) -> np.ndarray:
        """χ² per real value (n,) of each pose at x, where that can be."""
        counts = 2 * np.count_nonzero(weight_of(self.measured, self.logarithmic), axis=(1, 2, 3))
        return self._data(x).by_pose / np.maximum(counts, 1)

    def _mass(self, phi: np.ndarray) -> np.ndarray:
        if not self.free_inertia:
            return self.matrices.mass
        return self.matrices.mass + self.inertias.mass_change(phi)

    @property
    def count(self) -> int:
        """Number of real residuals that carry weight."""
        return 2 * int(np.count_nonzero(weight_of(self.measured, self.logarithmic)))

    def box(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest values (D,) that are looked at; x is among them."""
        p, inertias = self.parametrisation, np.zeros(len(x) - len(self.parametrisation.parameters))
        mean, sd = np.append(p.mean, inertias), np.append(p.log_sd, inertias + 1)
        reach = NEARLY * FARTHEST * sd
        most = np.append(p.most, np.full(len(inertias), np.inf))
        return np.minimum(mean - reach, x), np.maximum(np.minimum(mean + reach, most), x)

    def __call__(self, x: np.ndarray) -> Quadratic:
        """At x = (θ, φ) or, where inertias are not free, at x = θ; ∞ where that cannot be."""
        p = self.parametrisation
        count = len(p.parameters)
        theta, phi = x[:count], x[count:]
        away = np.concatenate([(theta - p.mean) / p.log_sd, phi])
        pull, precision = self._prior(theta, phi)
        beyond = self._beyond(phi)
        possible = not self.free_inertia or positive(self._mass(phi))
        possible = possible and stands(self.matrices, p.elasticity(theta).stiffness)
        if not possible or not np.isfinite(beyond[0]) or np.abs(away).max() > FARTHEST:
            nothing = np.zeros(len(x))
            return Quadratic(np.inf, nothing, np.diag(nothing), np.inf)
        data = self._data(x)
        spread = np.zeros((len(data.gradient), len(x)))
        springs = len(p.held)
        spread[:springs, :count] = p.spread
        spread[springs:, count:] = np.eye(len(phi))
        gradient = spread.T @ data.gradient + precision @ pull
        normal = spread.T @ data.normal @ spread + precision
        value = (data.chi2 + float(pull @ precision @ pull)) / 2 + beyond[0]
        gradient[count:] += beyond[1]
        normal[count:, count:] += beyond[2]
        return Quadratic(value, gradient, normal, data.chi2)

    def _data(self, x: np.ndarray) -> Integrated:
        """Misfit at x by all springs' logarithms and φ."""
        p = self.parametrisation
        count = len(p.parameters)
        inertias = self.inertias if self.free_inertia else None
        motion = self._motion(x)
        slope = motion_slopes(motion, p.elasticity(x[:count]), inertias)
        h = motion.accelerance
        if self.completion is not None:
            lost, since = self.completion, x - self.completed_at
            h = h - lost.values
            if lost.slope is not None:
                moved = np.concatenate([p.spread @ since[:count], since[count:]])
                h -= np.einsum("npijf,p->nijf", lost.slope, moved)
                slope[:, : len(moved)] -= lost.slope
        residual, slope = self._residual(h, slope)
        if self.left_open is not None:
            return self.left_open.integrated(residual, slope)
        by_pose = np.sum(residual.real**2 + residual.imag**2, axis=(1, 2, 3))
        return Integrated(float(by_pose.sum()), *_normal_equations(residual, slope), by_pose)

    def _prior(self, theta: np.ndarray, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far x is from the prior's mean, and the prior's precision."""
        p = self.parametrisation
        weight = LOG_PRIOR if self.logarithmic else 1.0
        precision = weight * block_diagonal(p.precision, np.eye(len(phi)))
        return np.concatenate([theta - p.mean, phi]), precision

    def _beyond(self, phi: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        if self.barrier is None or not self.free_inertia:
            return 0.0, np.zeros(len(phi)), np.zeros((len(phi), len(phi)))
        return self.barrier(phi)

    def _residual(self, h: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Weighted residual (n, 3, 3, F) and its derivatives, written over `slope`."""
        weight = weight_of(self.measured, self.logarithmic)
        measured = self.measured.accelerance
        if not self.logarithmic:
            slope *= weight[:, None]
            return weight * (h - measured), slope
        size = np.maximum(np.abs(h), 1e-9 * np.abs(measured) + 1e-300)
        safe = np.where(np.abs(h) >= size, h, size)
        slope *= (weight / safe)[:, None]
        return weight * np.log(safe / measured), slope


def _normal_equations(residual: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Jᵀr and JᵀJ of real and imaginary parts."""
    n, p = slope.shape[:2]
    j = slope.reshape(n, p, -1).view(float)
    r = np.ascontiguousarray(residual).reshape(n, -1).view(float)
    gradient = np.sum(j @ r[..., None], axis=0)[:, 0]
    normal = np.zeros((p, p))
    for block in j:
        normal += block @ block.T
    return gradient, normal


def stands(matrices: Matrices, stiffness: np.ndarray) -> bool:
    """Whether springs of stiffness (e,) in N·m/rad carry the robot's weight at every pose."""
    return positive(np.diag(stiffness) + matrices.geometric)


def positive(matrix: np.ndarray) -> bool:
    """Whether all of the symmetric matrices (n, e, e) are positive definite."""
    try:
        return bool(np.isfinite(np.linalg.cholesky(matrix)).all())
    except np.linalg.LinAlgError:
        return False
