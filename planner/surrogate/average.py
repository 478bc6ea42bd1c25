"""AR1s (or GPs) averaged by their evidence, output by output (Hoeting et al. 1999).

A simulation whose modes are in another order, or that lacks physics, makes AR1 several times worse
than a GP that ignores it (`fit_hedged`). Where values scatter, a discrepancy that is free to depend
on the pose takes some of the scatter for itself (`fit_plain_or_free`). Damping of one robot is the
same everywhere, of another a smooth function of the pose; Busch et al. 2022 (section 3.2) choose
its kernel by hand (`fit_shapes`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.inference.log_space import log_sum, shares
from planner.surrogate.ar1 import AR1, FusionData, fit_ar1
from planner.surrogate.gp import Posterior

PRIOR_BELIEF = 0.5  # in the simulation, before anything is measured
NEGLIGIBLE_WEIGHT = 1e-3  # up to which a model is not evaluated for an output
GENTLE_SLOPE_SD = 0.05  # of ρ': a simulation of the same robot; chosen on generated cells
NO_DISCREPANCY = 1e-9  # amplitude, in the outputs' own unit
PLAIN_SAMPLES = 64  # of a nugget alone
GOLDEN_RATIO = (5**0.5 - 1) / 2  # multiples of it, less their integers, fill [0, 1) evenly


@dataclass(frozen=True, eq=False)
class Average:
    """Models of the same data, and their weights (models, m), whose columns sum to one.

    `log_evidence` (m,) is that of all together.
    """

    models: tuple[AR1, ...]
    weights: np.ndarray
    log_evidence: np.ndarray

    @property
    def counted(self) -> list[int]:
        """Which of the models are not negligible for every output."""
        return np.flatnonzero(self.weights.max(axis=1) > NEGLIGIBLE_WEIGHT).tolist()

    @cached_property
    def most_probable(self) -> AR1:
        """Of every output the likeliest model, the first of equals; all have one kernel."""
        best = [self.models[i] for i in np.argmax(self.weights, axis=0)]
        given = [(m.uses_low[j], m.centre[j], m.unknown_sd[j]) for j, m in enumerate(best)]
        uses_low, centre, unknown_sd = np.array(given).reshape(-1, 3).T
        outputs = tuple(model.outputs[j] for j, model in enumerate(best))
        return AR1(outputs, uses_low.astype(bool), centre, unknown_sd)

    @property
    def nugget_variance(self) -> np.ndarray:
        """Mean nugget variance (m,) of the likeliest models."""
        return np.array([one.nugget_variance for one in self.most_probable.outputs])

    def predict(
        self, x: np.ndarray, low: np.ndarray, nugget: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, m) at x (q, d), simulation low (q, m) (NaN: unknown there).

        For `nugget` see `Posterior.predict`.
        """
        counted = np.where(self.weights > NEGLIGIBLE_WEIGHT, self.weights, 0.0)
        means, sds = np.zeros((2, len(self.models), len(x), self.weights.shape[1]))
        for model, weight, mean, sd in zip(self.models, counted, means, sds, strict=True):
            some = np.flatnonzero(weight)
            if len(some):
                mean[:, some], sd[:, some] = model.predict(x, low, some, nugget)
        return mixed(counted, means, sds)


def mixed(weights: np.ndarray, means: np.ndarray, sds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and sd (q, m) of mixtures of means and sds (a, q, m) with weights (a, m)."""
    w = weights[:, None, :] / weights.sum(axis=0)
    mean = np.sum(w * means, axis=0)
    return mean, np.sqrt(np.sum(w * (sds**2 + (means - mean) ** 2), axis=0))


def fit_hedged(
    given: FusionData,
    samples: int = 256,
    kept: int = 32,
    belief: float = PRIOR_BELIEF,
    fit_fused: Callable[..., AR1] = fit_ar1,
    kernel: str = "matern52",
) -> Average:
    """AR1, and a GP that ignores the simulation; arguments as of `fit_ar1`.

    `belief` is the simulation's probability before these data.
    `fit_fused` fits with the simulation, arguments as of `fit_ar1`.
    """
    how = samples, kept, kernel
    fused, alone = fit_fused(given, *how), fit_ar1(given.alone, *how)
    evidence = np.array([m.log_evidence for m in (fused, alone)])
    odds = evidence + np.log([[belief], [1 - belief]])
    odds[1, ~fused.asked] = -np.inf
    return Average((fused, alone), shares(odds, axis=0), log_sum(evidence, axis=0))


def fit_shapes(given: FusionData, kernels: tuple[str, ...], blind: bool = False) -> Average:
    """A fit with every kernel.

    With `blind` those that ignore the simulation stand beside them, as likely before the data.
    """
    sides = (given, given.alone) if blind else (given,)
    models = tuple(fit_ar1(side, 64, 16, kernel) for side in sides for kernel in kernels)
    evidence = np.array([m.log_evidence for m in models])
    whole = log_sum(evidence, axis=0) - np.log(len(models))
    return Average(models, shares(evidence, axis=0), whole)


def fit_plain_or_free(given: FusionData, samples: int, kept: int, kernel: str) -> AR1:
    """AR1 averaged over how plain the discrepancy is; arguments as of `fit_ar1`.

    A simulation that is off by an offset alone needs no discrepancy that depends on the pose and no
    slope. Outputs without simulation are GPs as ever.
    """
    how, with_low = (samples, kept, kernel), given.with_low
    free = fit_ar1(given, *how)
    if not free.asked.any():
        return free
    plain = tuple(
        replace(p, slope_sd=0.0, amplitude=NO_DISCREPANCY, spread=0.0,
                nugget_spread=p.spread if p.nugget_spread is None else p.nugget_spread)
        for p in with_low
    )  # fmt: skip
    models = [free, fit_ar1(replace(given, with_low=plain), PLAIN_SAMPLES, kept, "bias")]
    if max(prior.slope_sd for prior in with_low) > GENTLE_SLOPE_SD:
        gentle = tuple(replace(p, slope_sd=min(p.slope_sd, GENTLE_SLOPE_SD)) for p in with_low)
        models.append(fit_ar1(replace(given, with_low=gentle), *how))
    each = zip(free.asked, *(model.outputs for model in models), strict=True)
    outputs = tuple(_samples_of_all(of) if asked else of[0] for asked, *of in each)
    return replace(free, outputs=outputs)


def _samples_of_all(each: Sequence[Posterior]) -> Posterior:
    """Samples of all fits of an output, of each as many as its weight says."""
    kept, size = each[0].theta.shape
    evidence = np.array([one.log_evidence for one in each])
    # Samples stand in an order; those that stay of each model are spread over it.
    place = (np.argsort(np.argsort((np.arange(kept) * GOLDEN_RATIO) % 1.0)) + 0.5) / kept
    chosen = np.searchsorted(np.cumsum(shares(evidence, axis=0))[:-1], place)  # (kept,)
    # Length scales of no discrepancy mean nothing.
    thetas = [np.pad(one.theta, [(0, 0), (0, size - one.theta.shape[1])]) for one in each]
    return replace(
        each[0],
        theta=np.choose(chosen[:, None], thetas),
        slope_sd=np.choose(chosen, [one.slope_sd for one in each]),
        # Each is believed as much as a GP that ignores the simulation, with which this is compared.
        log_evidence=float(log_sum(evidence, axis=0)),
        jitter=max(one.jitter for one in each),
    )
