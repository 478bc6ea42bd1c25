"""Damped least squares (Levenberg-Marquardt): the one solver behind every fit.

The caller gives the objective with its gradient and Gauss-Newton matrix. `propose` and `accept`
take one step at a time, so that several fits can be advanced round by round and their points
evaluated together; `minimise` is the loop for a single fit.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

import numpy as np

from planner.inference import triangular

LONGEST = 1.5  # no parameter moves farther in one step: a factor of 4.5 for a logarithm


class GaussNewton(Protocol):
    """An objective at a point; ∞ as its value where the point cannot be."""

    @property
    def value(self) -> float:
        """−ln of the posterior density but for a constant, or χ²/2."""
        ...

    @property
    def gradient(self) -> np.ndarray:
        """(P,) of the value."""
        ...

    @property
    def normal(self) -> np.ndarray:
        """(P, P) Gauss-Newton matrix of the value: JᵀWJ, the prior's precision included."""
        ...


@dataclass(frozen=True, eq=False)
class Quadratic:
    """Objective at a point: value, gradient (P,), Gauss-Newton matrix (P, P), χ² of the data."""

    value: float
    gradient: np.ndarray
    normal: np.ndarray
    chi2: float


Q = TypeVar("Q", bound=GaussNewton)


@dataclass(frozen=True)
class Damping:
    """How the damping follows what the steps gain; it is relative to the matrix's diagonal.

    After Nielsen (1999) unless `lighter` and `heavier` give the factors after a step that gained
    and after one that did not. It never falls below `least`; beyond `most` the fit is stuck.
    """

    first: float = 1e-2
    least: float = 1e-9
    most: float = 1e12
    lighter: float | None = None
    heavier: float = 2.0

    def eased(self, damping: float, share: float) -> float:
        """The damping after a step that gained `share` of what the quadratic model expected."""
        factor = self.lighter
        if factor is None:
            factor = max(1 / 5, 1 - (2 * share - 1) ** 3)
        return max(self.least, damping * factor)


@dataclass(frozen=True, eq=False)
class Limits:
    """How far one step goes, and the box that it stays in; (P,) each, or one for all entries.

    A step that would exceed `longest` is shortened as a whole, with `entrywise` entry by entry.
    """

    longest: float | np.ndarray = LONGEST
    lower: float | np.ndarray = -np.inf
    upper: float | np.ndarray = np.inf
    entrywise: bool = False

    def within(self, x: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Where a step from x leads."""
        if self.entrywise:
            step = np.clip(step, -1.0 * self.longest, self.longest)
        else:
            step = step * min(1.0, 1 / max(float(np.max(np.abs(step) / self.longest)), 1e-300))
        return np.clip(x + step, self.lower, self.upper)


@dataclass(frozen=True, eq=False)
class Iterate(Generic[Q]):
    """A fit between two steps: where it is, the objective there, and what the next step takes.

    `gained` is by how much the last step lowered the value, 0 where it was not taken.
    """

    x: np.ndarray
    at: Q
    damping: float
    rule: Damping
    limits: Limits
    heavier: float
    gained: float = 0.0

    @property
    def stuck(self) -> bool:
        """Whether no step, however short, has gained anything."""
        return self.damping > self.rule.most


def begin(
    x: np.ndarray, at: Q, rule: Damping | None = None, limits: Limits | None = None
) -> Iterate[Q]:
    """The fit at x (P,), where the objective is `at`."""
    rule = rule or Damping()
    return Iterate(x, at, rule.first, rule, limits or Limits(), rule.heavier)


def propose(state: Iterate[Q]) -> np.ndarray:
    """The point (P,) that the damped Gauss-Newton step leads to.

    What it would lead out of the box goes to its side, and the others to where they are best then;
    not where each entry is cut by itself, far from where the objective is quadratic.
    """
    # In units in which the diagonal is 1: parameters of any size are solved for as well.
    scale = np.diagonal(state.at.normal)
    unit = 1 / np.sqrt(np.where(scale > 0, scale, 1.0))
    damped = state.at.normal * np.outer(unit, unit) + state.damping * np.eye(len(unit))
    downhill, limits = -unit * state.at.gradient, state.limits
    if limits.entrywise:
        return limits.within(state.x, unit * _solved(damped, downhill))
    lower, upper = (
        np.broadcast_to(side - state.x, unit.shape) for side in (limits.lower, limits.upper)
    )
    step = unit * within_box(damped, downhill, lower / unit, upper / unit)
    return limits.within(state.x, step)


def within_box(
    normal: np.ndarray, downhill: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """Where ½ xᵀ N x − dᵀ x is least for x (P,) within sides; which of them hold is tried in turn.

    After Stark and Parker (1995), bounded-variable least squares.
    """
    root = _inverse_root(normal)
    start = root.T @ (root @ downhill)
    x, free, push = start.copy(), np.ones(len(start), dtype=bool), np.zeros(len(start))
    for _ in range(3 * len(x)):
        beyond = np.where(free, np.maximum(lower - x, x - upper), 0.0)
        if beyond[worst := int(np.argmax(beyond))] > 0:
            free[worst] = False
            x[worst] = lower[worst] if x[worst] < lower[worst] else upper[worst]
        else:
            inward = np.where(x <= lower, -push, push)
            if inward.max(initial=0.0) <= 1e-9 * np.abs(downhill).max(initial=0.0):
                break
            free[int(np.argmax(inward))] = True
        # Of the one inverse: forces on what is held bring it from where all were free to its sides.
        held, push = ~free, np.zeros(len(x))
        columns = root.T @ root[:, held]
        push[held] = _solved(columns[held], x[held] - start[held])
        x = np.where(held, x, start + columns @ push[held])
    return x


def _inverse_root(normal: np.ndarray) -> np.ndarray:
    """R with Rᵀ R the inverse of a matrix (P, P), of what has curvature at all."""
    try:
        return triangular.inverse(np.linalg.cholesky(normal))
    except np.linalg.LinAlgError:  # rounding has left a direction without curvature
        values, vectors = np.linalg.eigh(normal)
        kept = values > len(values) * np.finfo(float).eps * values[-1]
        return vectors.T[kept] / np.sqrt(values[kept])[:, None]


def _solved(damped: np.ndarray, downhill: np.ndarray) -> np.ndarray:
    try:
        return triangular.solve(np.linalg.cholesky(damped), downhill)
    except np.linalg.LinAlgError:  # rounding has left a direction without curvature
        return np.linalg.lstsq(damped, downhill, rcond=None)[0]


def expected(state: Iterate[Q], x: np.ndarray) -> float:
    """By how much the quadratic model says that the value is lower at x (P,)."""
    step = x - state.x
    return -float(state.at.gradient @ step + step @ state.at.normal @ step / 2)


def accept(state: Iterate[Q], x: np.ndarray, at: Q | None) -> Iterate[Q]:
    """The fit once the objective at the proposed x (P,) is known: moved there if that is better.

    `at` is None, or its value not finite, where x cannot be; the next step is shorter then.
    """
    rule = state.rule
    gained = state.at.value - at.value if at is not None and np.isfinite(at.value) else -np.inf
    if at is not None and gained > 0:
        share = gained / max(expected(state, x), 1e-300) if rule.lighter is None else 1.0
        eased = rule.eased(state.damping, share)
        return replace(state, x=x, at=at, damping=eased, heavier=rule.heavier, gained=gained)
    heavier = state.heavier * (2.0 if rule.lighter is None else 1.0)
    return replace(state, damping=state.damping * state.heavier, heavier=heavier, gained=0.0)


@dataclass(frozen=True, eq=False)
class Minimum(Generic[Q]):
    """Where the iteration ended, and whether it had come to rest."""

    x: np.ndarray
    at: Q
    converged: bool


def minimise(
    objective: Callable[[np.ndarray], Q | None],
    start: np.ndarray,
    tolerance: float,
    most: int,
    progress: Callable[[int, float], None] | None = None,
    longest: float | np.ndarray = LONGEST,
    at: Q | None = None,
    rule: Damping | None = None,
    box: tuple[np.ndarray, np.ndarray] | None = None,
    settled: Callable[[Iterate[Q], np.ndarray, Q], bool] | None = None,
) -> Minimum[Q]:
    """Least value from `start`, until a step would gain less than `tolerance` of it.

    Args:
        objective: the objective at x (P,); None, or a value that is not finite, where x cannot be.
        start: x (P,) to begin at, where the objective is finite.
        tolerance: share of the value that a step must be expected to gain.
        most: steps at most, those included that gained nothing.
        progress: is told each step's number and the value before it.
        longest: by how much an entry may move in one step, one for all or (P,).
        at: the objective at `start`, where that is known.
        rule: of the damping, Nielsen's unless given.
        box: least and largest values (P,) that are looked at.
        settled: a further rule to stop by: told the fit before a step, the proposed x and the
            objective there.
    """
    here = at if at is not None else objective(start)
    assert here is not None, "the objective is not defined where the fit begins"
    lower, upper = box or (-np.inf, np.inf)
    state = begin(start, here, rule, Limits(longest, lower, upper))
    for iteration in range(1, most + 1):
        if progress:
            progress(iteration, state.at.value)
        x = propose(state)
        if expected(state, x) <= tolerance * state.at.value:
            return Minimum(state.x, state.at, True)
        trial, before = objective(x), state
        state = accept(state, x, trial)
        if trial is not None and settled is not None and settled(before, x, trial):
            return Minimum(state.x, state.at, True)
        if state.stuck:
            return Minimum(state.x, state.at, False)
    return Minimum(state.x, state.at, False)


def inverse(precision: np.ndarray) -> np.ndarray:
    """Covariance (p, p) of a precision that is positive, but for rounding: so is the answer.

    Where a barrier stands close, entries differ by so many decades that a plain inverse loses it.
    """
    unit = 1 / np.sqrt(np.diagonal(precision))
    values, vectors = np.linalg.eigh(precision * np.outer(unit, unit))
    values = np.maximum(values, np.finfo(float).eps * len(unit) * values[-1])
    return np.outer(unit, unit) * ((vectors / values) @ vectors.T)
