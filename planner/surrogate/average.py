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
from planner.surrogate.ar1 import AR1, OutputPrior, fit_ar1
from planner.surrogate.gp import Posterior
from planner.surrogate.training_data import Prior, TrainingData

PRIOR_BELIEF = 0.5  # in the simulation, before anything is measured
NEGLIGIBLE_WEIGHT = 1e-3  # up to which a model is not evaluated for an output
GENTLE_SLOPE_SD = 0.05  # of ρ': a simulation of the same robot; chosen on generated cells
NO_DISCREPANCY = 1e-9  # amplitude, in the outputs' own unit
PLAIN_SAMPLES = 64  # of a nugget alone
GOLDEN_RATIO = (5**0.5 - 1) / 2  # multiples of it, less their integers, fill [0, 1) evenly

Priors = tuple[OutputPrior, ...]


@dataclass(frozen=True, eq=False)
class Average:
    """Models of the same data, and their weights (models, m), whose columns sum to one.

    `log_evidence` (m,) is that of all together.
    """

    models: tuple[AR1, ...]
    weights: np.ndarray
    log_evidence: np.ndarray

    @property
    def posterior(self) -> Posterior:
        """Of the likeliest models."""
        return self.likeliest.posterior

    @property
    def counted(self) -> list[int]:
        """Which of the models are not negligible for every output."""
        return np.flatnonzero(self.weights.max(axis=1) > NEGLIGIBLE_WEIGHT).tolist()

    @property
    def posteriors(self) -> tuple[Posterior, ...]:
        """Of the models that count."""
        return tuple(self.models[i].posterior for i in self.counted)

    @cached_property
    def likeliest(self) -> AR1:
        """Of every output the likeliest model, the first of equals; all have one kernel."""
        chosen = np.argmax(self.weights, axis=0)

        def pick(arrays: Sequence[np.ndarray]) -> np.ndarray:
            return np.choose(chosen.reshape(-1, *[1] * (arrays[0].ndim - 1)), arrays)

        def picked(names: Sequence[str], owners: Sequence[object]) -> dict[str, np.ndarray]:
            return {name: pick([getattr(one, name) for one in owners]) for name in names}

        each = [model.posterior for model in self.models]
        names = ("y", "variance", "low", "mask", "theta", "slope_sd", "log_evidence")
        posterior = replace(
            each[0],
            prior=Prior(**picked(tuple(vars(each[0].prior)), [p.prior for p in each])),
            jitter=max(p.jitter for p in each),
            **picked(names, each),
        )
        return AR1(posterior, **picked(("uses_low", "centre", "unknown_sd"), self.models))

    def predict(
        self, x: np.ndarray, low: np.ndarray, nugget: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, m) at x (q, d), simulation low (q, m) (NaN: unknown there).

        For `nugget` see `Posterior.predict`.
        """
        counted = np.where(self.weights > NEGLIGIBLE_WEIGHT, self.weights, 0.0)
        shape = len(self.models), len(x), self.weights.shape[1]
        means, sds = np.zeros(shape), np.zeros(shape)
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
    data: TrainingData,
    with_low: Priors,
    without_low: Priors,
    centre: np.ndarray,
    samples: int = 256,
    kept: int = 32,
    belief: float = PRIOR_BELIEF,
    fit_fused: Callable[..., AR1] = fit_ar1,
) -> Average:
    """AR1, and a GP that ignores the simulation; arguments as of `fit_ar1`.

    `belief` is the simulation's probability before these data.
    `fit_fused` fits with the simulation, arguments as of `fit_ar1`.
    """
    fused = fit_fused(data, with_low, without_low, centre, samples, kept)
    nothing = np.full(len(centre), np.nan)
    alone = fit_ar1(_blind(data), with_low, without_low, nothing, samples, kept)
    evidence = np.array([m.posterior.log_evidence for m in (fused, alone)])
    odds = evidence + np.log([[belief], [1 - belief]])
    # Without a measurement there is nothing to doubt the simulation by.
    odds[1, ~(fused.uses_low & fused.posterior.mask.any(axis=1))] = -np.inf
    return Average((fused, alone), shares(odds, axis=0), log_sum(evidence, axis=0))


def fit_shapes(
    data: TrainingData,
    with_low: Priors,
    without_low: Priors,
    centre: np.ndarray,
    kernels: tuple[str, ...],
    blind: bool = False,
) -> Average:
    """A fit with every kernel; the other arguments as of `fit_ar1`.

    With `blind` those that ignore the simulation stand beside them, as likely before the data.
    """
    sides = [(data, centre)]
    sides += [(_blind(data), np.full(len(centre), np.nan))] if blind else []
    models = tuple(
        fit_ar1(seen, with_low, without_low, there, 64, 16, kernel)
        for seen, there in sides
        for kernel in kernels
    )
    evidence = np.array([m.posterior.log_evidence for m in models])
    whole = log_sum(evidence, axis=0) - np.log(len(models))
    return Average(models, shares(evidence, axis=0), whole)


def _blind(data: TrainingData) -> TrainingData:
    """The data without the simulation."""
    return replace(data, low=np.full_like(data.low, np.nan))


def fit_plain_or_free(
    data: TrainingData,
    with_low: Priors,
    without_low: Priors,
    centre: np.ndarray,
    samples: int = 256,
    kept: int = 32,
) -> AR1:
    """AR1 averaged over how plain the discrepancy is; arguments as of `fit_ar1`.

    A simulation that is off by an offset alone needs no discrepancy that depends on the pose and no
    slope. Outputs without simulation are GPs as ever.
    """
    free = fit_ar1(data, with_low, without_low, centre, samples, kept)
    asked = free.uses_low & free.posterior.mask.any(axis=1)
    if not asked.any():
        return free
    plain = tuple(map(_plain, with_low))
    models = [free, fit_ar1(data, plain, without_low, centre, PLAIN_SAMPLES, kept, "bias")]
    if max(prior.slope_sd for prior in with_low) > GENTLE_SLOPE_SD:
        gentle = tuple(replace(p, slope_sd=min(p.slope_sd, GENTLE_SLOPE_SD)) for p in with_low)
        models.append(fit_ar1(data, gentle, without_low, centre, samples, kept))
    return _samples_of_all(models, asked)


def _plain(prior: OutputPrior) -> OutputPrior:
    nugget_spread = prior.spread if prior.nugget_spread is None else prior.nugget_spread
    return replace(
        prior, slope_sd=0.0, amplitude=NO_DISCREPANCY, spread=0.0, nugget_spread=nugget_spread
    )


def _samples_of_all(models: list[AR1], asked: np.ndarray) -> AR1:
    """Samples of all models, of each as many as its weight says; of the first where not `asked`."""
    posteriors = [model.posterior for model in models]
    first = posteriors[0]
    _, kept, size = first.theta.shape
    evidence = np.array([p.log_evidence for p in posteriors])
    evidence[1:, ~asked] = -np.inf
    edges = np.cumsum(shares(evidence, axis=0), axis=0)[:-1]  # (models − 1, m)
    # Samples stand in an order; those that stay of each model are spread over it.
    place = (np.argsort(np.argsort((np.arange(kept) * GOLDEN_RATIO) % 1.0)) + 0.5) / kept
    chosen = np.sum(place[None, None, :] > edges[:, :, None], axis=0)  # (m, kept)
    # Length scales of no discrepancy mean nothing.
    thetas = [np.pad(p.theta, [(0, 0), (0, 0), (0, size - p.theta.shape[2])]) for p in posteriors]
    posterior = replace(
        first,
        theta=np.choose(chosen[:, :, None], thetas),
        slope_sd=np.choose(chosen, [p.slope_sd for p in posteriors]),
        # Each is believed as much as a GP that ignores the simulation, with which this is compared.
        log_evidence=log_sum(evidence, axis=0),
        jitter=max(p.jitter for p in posteriors),
    )
    return replace(models[0], posterior=posterior)
