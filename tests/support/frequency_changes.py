"""Which change of a model explains natural frequencies, where responses alone were recorded.

The same reckoning as with FRFs: every change, and every few together, is fitted beside nuisances,
weighed by its evidence (Laplace), and set against "unknown", which stands for any misfit that
would be as small as the noise.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np
from scipy.optimize import least_squares

from planner.diagnosis.effects.effect import Quantity
from planner.diagnosis.thresholds import ODDS_OF_NOTHING, SECOND_EFFECT

TOLERATED = 1.2  # misfit that nuisances leave where the physics is right; chosen
UNKNOWN_PARAMETERS = 10  # what an unknown effect is charged for, half a ln(count) each; chosen

Model = Callable[[Mapping[str, float]], np.ndarray]  # values by name to frequencies (n, m) in Hz
STARTS = (-1.0, 0.0, 1.0)  # of a change's own value, in sds of its prior
MOST = 2  # changes at once
STEP = 1e-3  # prior sds, of differences


@dataclass(frozen=True)
class Change:
    """A value of the model that may differ from what is `stated`: an effect at a place."""

    effect: str
    at: str | None
    quantity: Quantity
    stated: float = 0.0


@dataclass(frozen=True, eq=False)
class Explanation:
    """Changes that are there together (none: nothing is), their values and sds by name."""

    changes: tuple[Change, ...]
    probability: float
    misfit: float  # χ² per value
    values: dict[str, tuple[float, float, str]]


@dataclass(frozen=True, eq=False)
class Explained:
    """All explanations, most probable first, and the probability that it is none of them."""

    explanations: tuple[Explanation, ...]
    unknown: float

    @property
    def verdict(self) -> str:
        """As of a diagnosis: "consistent", "explained" or "unexplained"."""
        best = self.explanations[0]
        if self.unknown > best.probability:
            return "unexplained"
        return "explained" if best.changes else "consistent"


def explain(
    measured_hz: np.ndarray,
    sd_hz: np.ndarray,
    model: Model,
    nuisances: Sequence[Quantity],
    changes: Sequence[Change],
) -> Explained:
    """Explain natural frequencies (n, m), NaN where none was found, with sds (n, m) in Hz.

    `model` is given all values by the quantities' names; `nuisances` are free beside any change,
    changes are as stated unless they are looked at.
    """
    known = np.isfinite(measured_hz)
    sd = sd_hz[known] / measured_hz[known]
    seen = np.log(measured_hz[known])

    def error(values: Mapping[str, float]) -> np.ndarray:
        return (np.log(model(values)[known]) - seen) / sd

    sets = [c for size in range(MOST + 1) for c in combinations(changes, size)]
    fits = [_fit(error, tuple(nuisances), chosen, tuple(changes)) for chosen in sets]
    count = int(known.sum())
    temper = max(1.0, min(f.chi2 for f in fits) / count)
    evidence = np.array([f.log_evidence(temper) + _log_prior(f.changes) for f in fits])
    charge = UNKNOWN_PARAMETERS / 2 * np.log(max(count / temper, 2.0))
    unknown = -TOLERATED * count / (2 * temper) - charge
    top = max(float(evidence.max()), unknown)
    weights = np.exp(np.append(evidence, unknown) - top)
    weights /= weights.sum()
    told = [
        Explanation(f.changes, float(w), f.chi2 / count, f.values(temper))
        for f, w in zip(fits, weights[:-1], strict=True)
    ]
    return Explained(tuple(sorted(told, key=lambda e: -e.probability)), float(weights[-1]))


def _log_prior(changes: tuple[Change, ...]) -> float:
    """As of effects in FRFs: nothing is as likely as all single ones, a second one less."""
    return -len(changes) * np.log(ODDS_OF_NOTHING) + max(len(changes) - 1, 0) * np.log(
        SECOND_EFFECT
    )


@dataclass(frozen=True, eq=False)
class _Fit:
    """A set of changes at its best: coordinates in prior sds, χ² and the data's precision."""

    changes: tuple[Change, ...]
    free: tuple[Quantity, ...]
    z: np.ndarray
    chi2: float
    normal: np.ndarray

    def log_evidence(self, temper: float) -> float:
        precision = self.normal / temper + np.eye(len(self.z))
        volume = np.linalg.slogdet(precision)[1]
        return -self.chi2 / (2 * temper) - float(self.z @ self.z) / 2 - volume / 2

    def values(self, temper: float) -> dict[str, tuple[float, float, str]]:
        sd = np.sqrt(np.diagonal(np.linalg.inv(self.normal / temper + np.eye(len(self.z)))))
        out = {}
        for q, z, s in zip(self.free, self.z, sd, strict=True):
            at = q.mean + q.sd * float(z)
            out[q.name] = (q.value(at), q.value_sd(at, q.sd * float(s)), q.unit)
        return out


def _fit(
    error: Callable[[Mapping[str, float]], np.ndarray],
    nuisances: tuple[Quantity, ...],
    chosen: tuple[Change, ...],
    changes: tuple[Change, ...],
) -> _Fit:
    free = (*nuisances, *(c.quantity for c in chosen))
    stated = {c.quantity.name: c.stated for c in changes}

    def residual(z: np.ndarray) -> np.ndarray:
        moved = {q.name: q.value(q.mean + q.sd * float(v)) for q, v in zip(free, z, strict=True)}
        return np.concatenate([error(stated | moved), z])

    if not free:
        data = error(stated)
        return _Fit((), (), np.zeros(0), float(data @ data), np.zeros((0, 0)))
    starts = [np.zeros(len(free))]
    starts += [np.append(np.zeros(len(free) - len(chosen)), np.full(len(chosen), s))
               for s in STARTS if s and chosen]  # fmt: skip

    def slope(z: np.ndarray) -> np.ndarray:
        moved = STEP * np.eye(len(z))
        return np.stack([residual(z + d) - residual(z - d) for d in moved], axis=1) / (2 * STEP)

    solve = partial(least_squares, residual, jac=slope)  # pyright: ignore[reportArgumentType]
    ends = [solve(start) for start in starts]
    best = min(ends, key=lambda end: end.cost)
    data, jacobian = best.fun[: -len(free)], best.jac[: -len(free)]
    return _Fit(chosen, free, best.x, float(data @ data), jacobian.T @ jacobian)
