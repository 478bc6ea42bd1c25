"""MFDGP and the multi-task GP as a campaign can choose them (`surrogate.frequency_models`)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.surrogate.ar1 import AR1
from planner.surrogate.frequency_models import FEWEST, FrequencyData
from planner.surrogate.models.fidelity_levels import Samples
from planner.surrogate.models.mfdgp import MFDGP, Training, fit_mfdgp
from planner.surrogate.models.multitask import MultiTaskGP, fit_multitask

# Few measured poses, and a simulation without noise: fewer steps than published do.
TRAINING = Training(held_steps=500, free_steps=1500, inducing=60)


@dataclass(frozen=True, eq=False)
class TaskedDeviations:
    """One GP of how far all outputs are off what `ar1` says of the simulation with a factor 1."""

    ar1: AR1
    gp: MultiTaskGP

    def predict(self, x: np.ndarray, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, m) at x (q, d), simulation low (q, m)."""
        mean, sd = self.gp.predict(x)
        unknown = (self.ar1.uses_low & ~np.isfinite(low)) * self.ar1.unknown_sd
        return mean + self.ar1.split(low)[0], np.hypot(sd, unknown)


def fit_tasks(seen: FrequencyData, ar1: AR1) -> TaskedDeviations | None:
    """At poses where every output is known; None where these are fewer than FEWEST."""
    data = seen.data
    off = data.y - ar1.split(data.low)[0]
    blind = (ar1.uses_low & ~np.isfinite(data.low)).any(axis=1)
    whole = np.isfinite(off).all(axis=1) & ~blind
    if whole.sum() < FEWEST:
        return None
    return TaskedDeviations(ar1, fit_multitask(data.x[whole], off[whole], seen.kernel))


@dataclass(frozen=True, eq=False)
class DeepOutputs:
    """A deep GP of each output."""

    each: Sequence[MFDGP]

    def predict(self, x: np.ndarray, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, m) at x (q, d)."""
        found = [one.predict(x) for one in self.each]
        return np.stack([m for m, _ in found], axis=1), np.stack([s for _, s in found], axis=1)


def fit_deep(seen: FrequencyData, ar1: AR1) -> DeepOutputs | None:
    """None where an output has too few values, or the simulation none of it."""
    if seen.elsewhere is None:
        return None
    data, (x, low) = seen.data, seen.elsewhere
    cheap = [Samples.of(x, column) for column in low.T]
    measured = [Samples.of(data.x, y, sd) for y, sd in zip(data.y.T, data.sd.T, strict=True)]
    if min(len(s.y) for s in (*cheap, *measured)) < FEWEST:
        return None
    pairs = zip(cheap, measured, strict=True)
    return DeepOutputs([fit_mfdgp(few, high, TRAINING) for few, high in pairs])
