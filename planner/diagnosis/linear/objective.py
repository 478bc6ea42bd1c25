"""Misfit of a simulation with one effect to measured FRFs, pose by pose, with its gradient."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.diagnosis.effects.effect import Effect, Setting
from planner.diagnosis.linear.around_misses import AroundMisses
from planner.dynamics.gradient import Impedance, Inertias, motion_slopes, moved
from planner.dynamics.motion import ActualPorts, Motion, Turned, recorded
from planner.effects.parameters import Parametrisation
from planner.identification.objective import (
    FARTHEST,
    LOG_PRIOR,
    positive,
    stands,
    weight_of,
)
from planner.inference.least_squares import LONGEST, Quadratic
from planner.measurement.measured_frfs import Measured
from planner.measurement.missed_ports import actual_ports, guess
from planner.measurement.nuisances import Tolerances
from planner.robot.elastic_model import Matrices

# Lines at least by which misses are guessed, around which all lines are taken then: misses are few
# numbers, and what a guess is off counts in second order only.
GUESSED_BY = 16
STRIDE = 1.5  # sds by which an effect's own parameters may move in one step


@dataclass(frozen=True, eq=False)
class ByPose:
    """χ² (n,), its half gradients (n, D) and Gauss-Newton matrices (n, D, D), data only."""

    chi2: np.ndarray
    gradient: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True, eq=False)
class MisfitAtPoint(Quadratic):
    """Data and prior at a point, and what the data of each pose say; None where x cannot be."""

    data: ByPose | None


def own_names(effect: Effect) -> list[str]:
    """Of an effect's ψ: what, of which effect, where."""
    return [f"{q.name} of {p.name} at {p.at}" for p in effect.parts() for q in p.quantities]


@dataclass(frozen=True, eq=False)
class Misfit:
    """χ²/2 of data and prior over x: springs θ (P), inertial nuisances φ (R), the effect's ψ (p).

    With `logarithmic` the data are the logarithms of the FRFs, as in `identification.objective`.
    Unless `inertial`, φ stays where it is.
    """

    measured: Measured
    setting: Setting
    matrices: Matrices
    inertias: Inertias
    parametrisation: Parametrisation
    effect: Effect
    logarithmic: bool = False
    inertial: bool = True
    tolerances: Tolerances | None = None  # of hits and chain, integrated out; None: all are exact
    discrepancy: np.ndarray | None = None  # (P,) sds by which ln θ differs from pose to pose

    @cached_property
    def split(self) -> tuple[int, int]:
        """Where φ and ψ begin in x."""
        count = len(self.parametrisation.parameters)
        return count, count + len(self.parametrisation.nuisances)

    @cached_property
    def names(self) -> list[str]:
        """Of the entries of x."""
        p = self.parametrisation
        return [*(s.name for s in p.parameters), *p.nuisances, *own_names(self.effect)]

    @cached_property
    def mean(self) -> np.ndarray:
        """Prior mean of x."""
        p = self.parametrisation
        own = [q.mean for q in self.effect.quantities]
        return np.concatenate([p.mean, np.zeros(len(p.nuisances)), own])

    @cached_property
    def sd(self) -> np.ndarray:
        """Prior sd of x."""
        p = self.parametrisation
        own = [q.sd for q in self.effect.quantities]
        return np.concatenate([p.log_sd, np.ones(len(p.nuisances)), own])

    @cached_property
    def longest(self) -> np.ndarray:
        """(D,) by how much an entry of x may move in one step."""
        b = self.split[1]
        return np.concatenate([np.full(b, LONGEST), STRIDE * self.sd[b:]])

    @cached_property
    def sides(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest x (D,) that is looked at."""
        reach, springs = FARTHEST * self.sd, self.split[0]
        lower, upper = self.mean - reach, self.mean + reach
        lower[:springs] = np.maximum(lower[:springs], self.parametrisation.least)
        upper[:springs] = np.minimum(upper[:springs], self.parametrisation.most)
        return lower, upper

    @cached_property
    def weight(self) -> np.ndarray:
        """See `weight_of`."""
        return weight_of(self.measured, self.logarithmic)

    @cached_property
    def counts(self) -> np.ndarray:
        """(n,) numbers of real residuals."""
        return 2 * np.count_nonzero(self.weight, axis=(1, 2, 3))

    @cached_property
    def free(self) -> np.ndarray:
        """(D,) bool: which entries of x may move."""
        a, b = self.split
        out = np.ones(b + len(self.effect.quantities), dtype=bool)
        out[a:b] = self.inertial
        return out

    def response(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """FRFs as they would be measured (n, 3, 3, F), and derivatives (n, free, 3, 3, F)."""
        h, slope, _ = self.parts(x)
        return h, slope

    def values(self, x: np.ndarray, actual: ActualPorts | None = None) -> tuple[np.ndarray, Turned]:
        """As `parts`, without derivatives."""
        motion, _ = self._motion(x, actual)
        seen = self.effect.transfer(self.setting, x[self.split[1] :])
        h, left = motion.accelerance, None if seen is None else seen.left
        return h if left is None else recorded(left, h), Turned((motion,), left)

    def _motion(
        self, x: np.ndarray, actual: ActualPorts | None = None
    ) -> tuple[Motion, tuple[Impedance, ...]]:
        """At x, between `actual` ports where those are known; what the effect adds to Z."""
        a, b = self.split
        psi, setting = x[b:], self.setting
        rate = self.effect.rate(psi)
        if rate is not None:
            setting = replace(setting, s=setting.s + rate)
        added = self.effect.impedance(setting, psi)
        if rate is not None:
            added = (*added, _weight(self.matrices, setting.s.shape[1]))
        mass = self.matrices.mass + self.inertias.mass_change(x[a:b])
        springs = self.parametrisation.elasticity(x[:a])
        return moved(self.matrices, springs, setting.s, mass, added, actual), added

    def parts(
        self, x: np.ndarray, actual: ActualPorts | None = None
    ) -> tuple[np.ndarray, np.ndarray, Turned]:
        """As `response`, and what goes with it; between `actual` ports where those are known."""
        p, (a, b) = self.parametrisation, self.split
        psi = x[b:]
        rate, (motion, added) = self.effect.rate(psi), self._motion(x, actual)
        inertias = self.inertias if self.inertial else None
        full = motion_slopes(motion, p.elasticity(x[:a]), inertias, added)
        h, s = motion.accelerance, motion.s
        by_weight = full[:, -1]
        if rate is not None:
            full = full[:, :-1]
        held, slope = len(p.held), full
        if not np.array_equal(p.spread, np.eye(held)):
            slope = _by_theta(full, p.spread)
        if rate is not None:
            # Z is of second order in s, so that H'(s) follows from the springs' derivatives.
            e = p.size
            down = 2 * (full[:, :e].sum(axis=1) + by_weight) + full[:, e : 2 * e].sum(axis=1)
            along = -rate * down / s[:, None, None]
            slope = np.concatenate([slope, along[:, None]], axis=1)
        seen = self.effect.transfer(self.setting, psi)
        if seen is not None:
            own = np.einsum("npijf,njkf->npikf", seen.slope, h)
            slope = np.concatenate([recorded(seen.left, slope), own], axis=1)
            h = recorded(seen.left, h)
        return h, slope, Turned((motion,), None if seen is None else seen.left)

    def by_pose(self, x: np.ndarray) -> ByPose:
        """Misfit of each pose, and its derivatives; what is left open is integrated out."""
        if self.tolerances is not None and not self.logarithmic:
            return self._marginal(x)
        h, slope, _ = self.parts(x)
        residual, slope = self._residual(h, slope)
        n, d = slope.shape[:2]
        j = np.ascontiguousarray(slope).reshape(n, d, -1).view(float)
        r = np.ascontiguousarray(residual).reshape(n, -1).view(float)
        free, size = np.flatnonzero(self.free), len(x)
        gradient, normal = np.zeros((n, size)), np.zeros((n, size, size))
        gradient[:, free] = (j @ r[..., None])[..., 0]
        normal[:, free[:, None], free] = j @ np.swapaxes(j, 1, 2)
        return ByPose(np.sum(r**2, axis=1), gradient, normal)

    def around_misses(self, x: np.ndarray) -> AroundMisses:
        """FRFs at x and what hits, chain and readback leave open, around its likeliest."""
        few = self.few_lines
        if self.discrepancy is None:
            h, turned = few.values(x)
            first = few._around(h, None, turned)
        else:
            first = few._around(*few.parts(x))
        return self.around_these(x, guess(first.misses()))

    @cached_property
    def few_lines(self) -> "Misfit":
        """Of as many lines as tell a guess of the misses."""
        step = max(1, self.setting.s.shape[1] // GUESSED_BY)
        setting = replace(self.setting, s=self.setting.s[:, ::step])
        return replace(self, measured=self.measured.thinned(step), setting=setting)

    def around_these(self, x: np.ndarray, eta: np.ndarray) -> AroundMisses:
        """The same around these numbers (n, l)."""
        assert self.tolerances is not None
        shape = self.measured.accelerance.shape[1:3]
        actual = actual_ports(eta, self.setting.s, self.tolerances, shape)
        return self._around(*self.parts(x, actual), eta=eta)

    def _around(
        self, h: np.ndarray, slope: np.ndarray | None, turned: Turned, eta: np.ndarray | None = None
    ) -> AroundMisses:
        assert self.tolerances is not None
        off = h - self.measured.accelerance
        s, loose = self.setting.s, self.discrepancy
        return AroundMisses.of(off, slope, turned, h, s, self.weight, self.tolerances, eta, loose)

    def _marginal(self, x: np.ndarray) -> ByPose:
        around = self.around_misses(x)
        free, size, n = np.flatnonzero(self.free), len(x), len(around.residual)
        chi2, gradient, normal = np.empty(n), np.zeros((n, size)), np.zeros((n, size, size))
        for i in range(n):
            found = around.marginal(i)
            chi2[i] = found.chi2
            gradient[i, free] = found.gradient
            normal[i][np.ix_(free, free)] = found.normal
        return ByPose(chi2, gradient, normal)

    def possible(self, x: np.ndarray) -> bool:
        """Whether a robot may be so at x, and nothing is farther off than is looked for.

        Masses are positive, and the springs carry the weight.
        """
        a, b = self.split
        if np.abs((x - self.mean) / self.sd).max() > FARTHEST:
            return False
        mass = self.matrices.mass + self.inertias.mass_change(x[a:b])
        springs = self.parametrisation.elasticity(x[:a])
        return positive(mass) and stands(self.matrices, springs.stiffness)

    def value(self, x: np.ndarray, data: ByPose) -> float:
        """Data and prior together at x, of which the data say so much."""
        away = (x - self.mean) / self.sd
        prior = float(away @ away) * (LOG_PRIOR if self.logarithmic else 1.0)
        return (float(data.chi2.sum()) + prior) / 2

    def __call__(self, x: np.ndarray) -> MisfitAtPoint:
        """Data and prior together; ∞ where x cannot be."""
        away, scale = (x - self.mean) / self.sd, 1 / self.sd
        if not self.possible(x):
            nothing = np.zeros(len(x))
            return MisfitAtPoint(np.inf, nothing, np.diag(nothing), np.inf, None)
        data = self.by_pose(x)
        if self.logarithmic:
            away, scale = away * np.sqrt(LOG_PRIOR), scale * np.sqrt(LOG_PRIOR)
        chi2 = float(data.chi2.sum())
        return MisfitAtPoint(
            self.value(x, data),
            data.gradient.sum(axis=0) + np.where(self.free, scale * away, 0.0),
            data.normal.sum(axis=0) + np.diag(scale**2),
            chi2,
            data,
        )

    def _residual(self, h: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        weight, measured = self.weight, self.measured.accelerance
        if not self.logarithmic:
            slope *= weight[:, None]
            return weight * (h - measured), slope
        least = 1e-9 * np.abs(measured) + 1e-300
        safe = np.where(np.abs(h) >= least, h, least)
        return weight * np.log(safe / measured), slope * (weight / safe)[:, None]


def _by_theta(full: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Derivatives (n, d, r, c, F), the first of which are by held numbers, by θ in their place."""
    n, (held, free) = len(full), spread.shape
    if np.all(spread.sum(axis=0) == 1):
        return full[:, [*spread.argmax(axis=0), *range(held, full.shape[1])]]
    out = np.empty((n, full.shape[1] - held + free, *full.shape[2:]), dtype=complex)
    by_held, by_theta = (
        part.reshape(n, part.shape[1], -1).view(float) for part in (full[:, :held], out[:, :free])
    )
    np.matmul(spread.T, by_held, out=by_theta)
    out[:, free:] = full[:, held:]
    return out


def _weight(matrices: Matrices, lines: int) -> Impedance:
    """Adds nothing to Z; its one derivative is that by the stiffness that goes with the pose."""
    values, vectors = np.linalg.eigh(matrices.geometric)
    ports = np.sqrt(np.abs(values))[..., None] * np.swapaxes(vectors, 1, 2)
    shapes = np.eye(values.shape[1])[:, :, None] * np.eye(values.shape[1])[:, None]
    signs = np.repeat(np.sign(values)[..., None], lines, axis=2)
    return Impedance(ports, shapes, (), (tuple((j, signs[:, j]) for j in range(len(shapes))),))
