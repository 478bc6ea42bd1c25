"""AR1 and a GP that ignores the simulation, each output weighted by the evidence of either.

A simulation whose modes are in another order, or that lacks physics, makes AR1 several times worse
than a GP. So the two are averaged with their evidence as weights (Hoeting et al. 1999).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from planner.surrogate.ar1 import AR1, OutputPrior, fit_ar1
from planner.surrogate.gp import Posterior, Prior
from planner.surrogate.training_data import TrainingData

PRIOR_BELIEF = 0.5  # in the simulation, before anything is measured
NEARLY_CERTAIN = 0.999  # weight from which the other model is not evaluated


@dataclass(frozen=True, eq=False)
class HedgedAR1:
    """For every output the likelier model, the other one, and the likelier one's weight (m,)."""

    likelier: AR1
    other: AR1
    weight: np.ndarray
    log_evidence: np.ndarray  # (m,) of the two together

    @property
    def posterior(self) -> Posterior:
        """The likelier models' posterior."""
        return self.likelier.posterior

    @property
    def uses_low(self) -> np.ndarray:
        """Which outputs (m,) stand on the simulation."""
        return self.likelier.uses_low

    def split(self, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `AR1.split`; of the likelier models."""
        return self.likelier.split(low)

    def predict(
        self, x: np.ndarray, low: np.ndarray, nugget: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, m) at x (q, d), simulation low (q, m) (NaN: unknown there).

        For `nugget` see `Posterior.predict`.
        """
        mean, sd = self.likelier.predict(x, low, nugget=nugget)
        unsure = np.flatnonzero(self.weight < NEARLY_CERTAIN)
        if not len(unsure):
            return mean, sd
        other, other_sd = self.other.predict(x, low, unsure, nugget)
        w, apart = self.weight[unsure], other - mean[:, unsure]
        variance = w * sd[:, unsure] ** 2 + (1 - w) * (other_sd**2 + w * apart**2)
        mean[:, unsure] += (1 - w) * apart
        sd[:, unsure] = np.sqrt(variance)
        return mean, sd


def fit_hedged(
    data: TrainingData,
    with_low: tuple[OutputPrior, ...],
    without_low: tuple[OutputPrior, ...],
    centre: np.ndarray,
    samples: int = 256,
    kept: int = 32,
    belief: float = PRIOR_BELIEF,
    fit_fused: Callable[..., AR1] = fit_ar1,
) -> HedgedAR1:
    """Fit m outputs; arguments as of `fit_ar1`.

    `belief` is the simulation's probability before these data.
    `fit_fused` fits with the simulation, arguments as of `fit_ar1`.
    """
    fused = fit_fused(data, with_low, without_low, centre, samples, kept)
    nothing = np.full(len(centre), np.nan)
    ignored = replace(data, low=np.full_like(data.low, np.nan))
    alone = fit_ar1(ignored, with_low, without_low, nothing, samples, kept)
    gap = fused.posterior.log_evidence - alone.posterior.log_evidence
    gap = np.where(fused.uses_low, gap + np.log(belief / (1 - belief)), np.inf)
    # Without a measurement there is nothing to doubt the simulation by.
    gap = np.where(fused.posterior.mask.any(axis=1), gap, np.inf)
    trust = gap >= 0
    weight = 1 / (1 + np.exp(-np.minimum(np.abs(gap), 700.0)))
    evidence = np.logaddexp(fused.posterior.log_evidence, alone.posterior.log_evidence)
    return HedgedAR1(_choose(trust, fused, alone), _choose(~trust, fused, alone), weight, evidence)


def _choose(first: np.ndarray, a: AR1, b: AR1) -> AR1:
    """Outputs of `a` where `first` (m,), of `b` elsewhere."""

    def pick(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.where(first.reshape(-1, *[1] * (u.ndim - 1)), u, v)

    p, q = a.posterior, b.posterior
    pairs = zip(vars(p.prior).values(), vars(q.prior).values(), strict=True)
    prior = Prior(*(pick(u, v) for u, v in pairs))
    names = ("y", "variance", "low", "mask", "theta", "slope_sd", "log_evidence")
    picked = {name: pick(getattr(p, name), getattr(q, name)) for name in names}
    posterior = replace(p, prior=prior, jitter=max(p.jitter, q.jitter), **picked)
    return AR1(
        posterior, pick(a.uses_low, b.uses_low), pick(a.centre, b.centre),
        pick(a.unknown_sd, b.unknown_sd),
    )  # fmt: skip
