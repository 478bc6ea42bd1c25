"""Two levels of fidelity of one output: a cheap one, known everywhere, and expensive samples."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from planner.errors import InputError


@dataclass(frozen=True, eq=False)
class Samples:
    """n values of one output: x (n, d), scaled to about [0, 1], y (n,) and its sd (n,)."""

    x: np.ndarray
    y: np.ndarray
    sd: np.ndarray

    @classmethod
    def of(cls, x: np.ndarray, y: np.ndarray, sd: np.ndarray | float = 0.0) -> "Samples":
        """The finite ones; an sd of 0 (or NaN) leaves all noise to the nugget."""
        x = np.atleast_2d(np.asarray(x, dtype=float))
        y = np.asarray(y, dtype=float)
        if x.shape[0] != len(y):
            raise InputError(f"{len(y)} values at {x.shape[0]} poses: give one value per pose.")
        sd = np.broadcast_to(np.nan_to_num(np.asarray(sd, dtype=float)), y.shape)
        known = np.isfinite(y) & np.isfinite(x).all(axis=1)
        return cls(x[known], y[known], sd[known])


class FidelityLevel(Protocol):
    """What predicts one output with its uncertainty: a simulation or a fitted model."""

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Best estimate and sd (q,) of the noise-free output at x (q, d)."""
        ...


@dataclass(frozen=True)
class Exact:
    """A simulation that can be evaluated at every pose: values (q,) of x (q, d)."""

    function: Callable[[np.ndarray], np.ndarray]

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Its value (q,), with sd 0."""
        value = np.asarray(self.function(x), dtype=float)
        return value, np.zeros_like(value)


def spread(y: np.ndarray) -> float:
    """Sd of y, 1 where it is unknown (fewer than two values) or 0."""
    sd = float(np.std(y)) if len(y) > 1 else 0.0
    size = float(np.max(np.abs(y), initial=0.0))
    return sd if sd > 1e-12 * max(size, 1e-300) else 1.0
