"""AR1 of many outputs over a simulation that is known exactly at every pose.

y_H(x) = ρ·y_L(x) + b + δ(x) (Kennedy & O'Hagan 2000; Busch et al. 2022, section 2.3.1). The
simulation is deterministic and costs milliseconds, so the low-fidelity level is evaluated, not
modelled. An output without simulation is a plain GP: the same with no ρ·y_L.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from planner.surrogate.gp import Posterior, fit
from planner.surrogate.kernels import Kernel, parse
from planner.surrogate.training_data import Prior, TrainingData, pad


@dataclass(frozen=True)
class OutputPrior:
    """Weakly informative prior of one kind of output, in the output's own unit.

    Medians of amplitude σ of δ and of the nugget τ, with log-sd `spread` each, or
    `nugget_spread`; length scales have median `length`·√d, log-sd `length_spread`, in coordinates
    scaled to [0, 1]. `mean` applies without simulation only. `nugget_shared` is the share of
    log τ's variance that it has in common with the other outputs.
    """

    bias_sd: float
    slope_sd: float
    amplitude: float
    nugget: float
    mean: float = 0.0
    length: float = 0.8
    spread: float = 1.0
    length_spread: float = 0.8
    nugget_spread: float | None = None
    nugget_shared: float = 0.0


@dataclass(frozen=True, eq=False)
class FusionData:
    """What m outputs are fitted to: `values`, per output its prior with and without simulation,
    and the `centre` (m,) of the simulation's, NaN where there is none.
    """

    values: TrainingData
    with_low: tuple[OutputPrior, ...]
    without_low: tuple[OutputPrior, ...]
    centre: np.ndarray

    @property
    def alone(self) -> Self:
        """The same without the simulation."""
        values = replace(self.values, low=np.full_like(self.values.low, np.nan))
        return replace(self, values=values, centre=np.full(len(self.centre), np.nan))


@dataclass(frozen=True, eq=False)
class AR1:
    """Fitted outputs; `uses_low` (m,): which stand on the simulation.

    Where the simulation has no value, it is taken as `centre` ± `unknown_sd` (m,).
    """

    outputs: tuple[Posterior, ...]
    uses_low: np.ndarray
    centre: np.ndarray
    unknown_sd: np.ndarray

    @property
    def log_evidence(self) -> np.ndarray:
        """(m,)."""
        return np.array([one.log_evidence for one in self.outputs])

    @property
    def asked(self) -> np.ndarray:
        """(m,) whether there is something to doubt the simulation by: measurements beside it."""
        return self.uses_low & np.array([len(one.x) > 0 for one in self.outputs], dtype=bool)

    def predict(
        self,
        x: np.ndarray,
        low: np.ndarray,
        outputs: np.ndarray | None = None,
        nugget: bool = False,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, m) at x (q, d), simulation low (q, m) (NaN: unknown there).

        `outputs` (indices) asks for some of the columns only; for `nugget` see
        `Posterior.predict`.
        """
        base, offset, blind = self.split(low)
        asked = np.arange(len(self.outputs)) if outputs is None else outputs
        mean, sd = np.empty((2, len(x), len(asked)))
        for i, j in enumerate(asked):
            mean[:, i], sd[:, i] = self.outputs[j].predict(x, offset[:, j], nugget)
        return mean + base[:, asked], np.hypot(sd, blind[:, asked])

    def split(self, low: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What ρ = 1 predicts, the centred value that ρ − 1 multiplies, and by how much (sd) the
        former is not known; (q, m) each."""
        known = np.where(np.isfinite(low), low, self.centre)
        blind = (self.uses_low & ~np.isfinite(low)) * self.unknown_sd
        return known * self.uses_low, (known - self.centre) * self.uses_low, blind


def fit_ar1(
    given: FusionData,
    samples: int = 256,
    kept: int = 32,
    kernel: str = "matern52",
    thorough: bool = False,
    sees_low: bool = False,
) -> AR1:
    """Fit m outputs.

    `thorough` looks for each output's most probable hyperparameters first: tens of milliseconds
    an output, which pays where there are many hyperparameters or many points. With `sees_low` the
    kernel's last column is the centred y_L over its sd.
    """
    data, uses_low = given.values, _uses_low(given.values, given.centre)
    centre = np.where(uses_low, np.nan_to_num(given.centre), 0.0)
    unknown_sd = _unknown_sd(data.low, given.without_low)
    either = zip(given.with_low, given.without_low, uses_low, strict=True)
    priors = [fused if uses else alone for fused, alone, uses in either]
    model = AR1((), uses_low, centre, unknown_sd)
    base, offset, blind = model.split(data.low)
    sd = np.hypot(np.where(np.isnan(data.sd), 0.0, data.sd), blind)
    padded = pad(TrainingData(data.x, data.y - base, sd, offset), uses_low)
    prior = _stack(priors, uses_low, parse(kernel, data.x.shape[1] + sees_low))
    scale, start = unknown_sd if sees_low else None, None
    if thorough:
        from planner.surrogate.likelihood import laplace  # by JAX, which takes a second to import

        start = laplace(kernel, padded if scale is None else padded.widened(scale), prior)
    outputs = fit(padded, prior, samples, kept, kernel, 2 if thorough else 1, start, scale)
    return replace(model, outputs=outputs)


def _uses_low(data: TrainingData, centre: np.ndarray) -> np.ndarray:
    """Which outputs (m,) stand on the simulation: those it has at most of the measured poses."""
    measured, simulated = np.isfinite(data.y), np.isfinite(data.low)
    most = 2 * np.sum(measured & simulated, axis=0) >= np.sum(measured, axis=0)
    # With no measurement yet the simulation, where there is one, is all there is to stand on.
    alone = simulated.any(axis=0) if len(data.x) else np.isfinite(centre)
    return np.where(measured.any(axis=0), most, alone)


def _unknown_sd(low: np.ndarray, priors: tuple[OutputPrior, ...]) -> np.ndarray:
    """Sd (m,) of the simulation's value where it has none: its scatter over the poses seen."""
    known = np.isfinite(low)
    count = np.maximum(known.sum(axis=0), 1)
    filled = np.where(known, low, 0.0)
    mean = filled.sum(axis=0) / count
    scatter = np.sqrt(np.sum(np.where(known, low - mean[None, :], 0.0) ** 2, axis=0) / count)
    amplitude = np.array([p.amplitude for p in priors])
    never_seen = np.hypot(amplitude, np.array([p.bias_sd for p in priors]))
    return np.where(known.sum(axis=0) > 1, np.maximum(scatter, amplitude), never_seen)


def _stack(priors: list[OutputPrior], uses_low: np.ndarray, kernel: Kernel) -> Prior:
    theta = [
        kernel.prior(p.amplitude, p.nugget, p.length, p.spread, p.length_spread) for p in priors
    ]
    for (_, sd), p in zip(theta, priors, strict=True):
        sd[1] = p.spread if p.nugget_spread is None else p.nugget_spread
    return Prior(
        mean=np.array([p.mean for p in priors]) * ~uses_low,
        bias_sd=np.array([p.bias_sd for p in priors]),
        slope_sd=np.array([p.slope_sd for p in priors]) * uses_low,
        theta_mean=np.array([mean for mean, _ in theta]),
        theta_sd=np.array([sd for _, sd in theta]),
        nugget_shared=np.array([p.nugget_shared for p in priors]),
    )
