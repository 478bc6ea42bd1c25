"""Gaussian processes of many outputs, averaged over hyperparameters.

Per output: y = mean + ρ'·h + b + δ(x) + ε, where h is the centred low fidelity, ρ' = ρ − 1 and b
have Gaussian priors that are marginalised exactly as kernel terms, δ is a zero-mean GP, and ε has
the measurement's own variance plus a nugget τ². The hyperparameters θ (see `kernels.Kernel`) are
averaged (see `importance`).
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg.lapack import dtrtri

from planner.errors import InputError
from planner.surrogate.importance import Gaussians, normal_points, sample
from planner.surrogate.kernels import Kernel, parse
from planner.surrogate.likelihood import data_covariance, log_likelihoods
from planner.surrogate.predictive import Predictive
from planner.surrogate.training_data import Padded

JITTERS = (1e-13, 1e-10, 1e-8, 1e-6)  # relative to the prior variance
SILENT_JITTER = 1e-10  # of the prior variance; a larger one is reported
SINGULAR_REMARK = (
    "The covariance was singular until {:g} of its variance was added to the noise: two poses are "
    "nearly the same, and their sds claim more than that."
)


@dataclass(frozen=True, eq=False)
class Prior:
    """Prior of m outputs: mean (m,), sd of b and ρ' (m,), θ's mean and sd (m, p).

    `nugget_shared` (m,) is the share of log τ's variance that the outputs have in common; (1,): all
    alike.
    """

    mean: np.ndarray
    bias_sd: np.ndarray
    slope_sd: np.ndarray
    theta_mean: np.ndarray
    theta_sd: np.ndarray
    nugget_shared: np.ndarray = field(default_factory=lambda: np.zeros(1))


@dataclass(frozen=True, eq=False)
class Posterior:
    """m outputs, k hyperparameter samples of equal weight, c padded training points.

    Everything after the fit is plain NumPy on few, small matrices.
    """

    x: np.ndarray  # (c, d)
    low: np.ndarray  # (m, c) centred
    mask: np.ndarray  # (m, c)
    theta: np.ndarray  # (m, k, p)
    slope_sd: np.ndarray  # (m, k) of ρ'
    whiten: np.ndarray  # (m, k, c, c) inverse of the Cholesky factor
    weights: np.ndarray  # (m, k, c) K⁻¹(y − mean)
    prior: Prior
    kernel: str
    log_evidence: np.ndarray  # (m,) log p(y | model), θ averaged out
    remarks: tuple[str, ...] = ()

    def predict(
        self,
        x: np.ndarray,
        low: np.ndarray,
        outputs: np.ndarray | None = None,
        nugget: bool = False,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, m) of the outputs at x (q, d) with centred low (q, m).

        `outputs` (indices) asks for some of them only. The sd is that of the noise-free output;
        with `nugget`, that of one more value without measurement noise of its own.
        """
        asked = range(len(self.mask)) if outputs is None else outputs.tolist()
        mean, sd = np.empty((len(x), len(asked))), np.empty((len(x), len(asked)))
        for i, j in enumerate(asked):
            mixture = self.predictive(j, x, low[:, j])
            if nugget:
                mixture = mixture.widened(np.exp(self.theta[j, :, 1, None]))
            mean[:, i], sd[:, i] = mixture.mean, mixture.sd
        return mean, sd

    def predictive(self, j: int, x: np.ndarray, low: np.ndarray) -> Predictive:
        """Output j, noise-free, at x (q, d) with centred low (q,), one Gaussian per sample."""
        cross, white = self._cross(j, x, low)
        means = self.prior.mean[j] + (self.weights[j][:, None, :] @ cross)[:, 0]
        own = self._own(j, x, low) - np.sum(white**2, axis=1)
        return Predictive(np.full(len(means), 1 / len(means)), means, np.sqrt(np.maximum(own, 0.0)))

    def covariance(
        self, j: int, xa: np.ndarray, la: np.ndarray, xb: np.ndarray, lb: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Posterior covariance (k, a, b), variances (k, a), (k, b) of output j, per sample."""
        _, wa = self._cross(j, xa, la)
        _, wb = self._cross(j, xb, lb)
        prior = self._prior(j, xa, la, xb, lb)
        va = self._own(j, xa, la) - np.sum(wa**2, axis=1)
        vb = self._own(j, xb, lb) - np.sum(wb**2, axis=1)
        covariance = prior - np.swapaxes(wa, 1, 2) @ wb
        return covariance, np.maximum(va, 0.0), np.maximum(vb, 0.0)

    def nugget_variance(self) -> np.ndarray:
        """Mean nugget variance (m,)."""
        return np.mean(np.exp(2 * self.theta[:, :, 1]), axis=1)

    def slopes(self, j: int) -> np.ndarray:
        """Posterior mean (k,) of ρ' of output j, per sample."""
        return self.slope_sd[j] ** 2 * (self.weights[j] @ (self.low[j] * self.mask[j]))

    def _prior(
        self, j: int, xa: np.ndarray, la: np.ndarray, xb: np.ndarray, lb: np.ndarray
    ) -> np.ndarray:
        prior = self.prior
        slope = self.slope_sd[j][:, None, None]
        linear = prior.bias_sd[j] ** 2 + slope**2 * np.outer(la, lb)
        return self._delta.covariance(np, self.theta[j], xa, xb) + linear

    @property
    def _delta(self) -> Kernel:
        return parse(self.kernel, self.x.shape[1])

    def _own(self, j: int, x: np.ndarray, low: np.ndarray) -> np.ndarray:
        """Prior variances (k, q)."""
        prior = self.prior
        linear = prior.bias_sd[j] ** 2 + self.slope_sd[j][:, None] ** 2 * low**2
        return self._delta.variance(np, self.theta[j], x) + linear

    def _cross(self, j: int, x: np.ndarray, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Prior covariance (k, n, q) with the training points, and L⁻¹ times it.

        Padding is left out here: n counts the points that hold a value.
        """
        known = np.flatnonzero(self.mask[j])
        cross = self._prior(j, self.x[known], self.low[j][known], x, low)
        full = np.zeros((len(cross), self.mask.shape[1], len(x)))
        full[:, known] = cross
        return full, self.whiten[j][:, known[:, None], known[None, :]] @ cross


def fit(
    padded: Padded, prior: Prior, samples: int = 256, kept: int = 32, kernel: str = "matern52",
    rounds: int = 1, start: Gaussians | None = None,
) -> Posterior:  # fmt: skip
    """Posterior of all outputs; y and low of `padded` as they are, prior mean taken off here.

    `samples` of θ from the prior and as many in each of `rounds`; `start`, in units of the prior,
    is where the first round looks, as `marginal.laplace` finds.

    InputError if the covariance stays singular whatever is added to its diagonal.
    """
    m, p = prior.theta_mean.shape
    normal = [normal_points(samples, p, seed) for seed in range(1, 2 + rounds)]
    y = (padded.y - prior.mean[:, None]) * padded.mask

    def theta(z: np.ndarray) -> np.ndarray:
        return prior.theta_mean[:, None, :] + prior.theta_sd[:, None, :] * z

    for jitter in JITTERS:
        try:
            z, evidence = sample(
                lambda z, j=jitter: log_likelihoods(
                    kernel, padded, y, prior.bias_sd, prior.slope_sd, j, theta(z)
                ),
                normal, m, kept, start, prior.nugget_shared,
            )  # fmt: skip
            whiten = _whitening(kernel, padded, prior, jitter, theta(z))
        except np.linalg.LinAlgError:
            continue
        weights = (np.swapaxes(whiten, 2, 3) @ (whiten @ y[:, None, :, None]))[..., 0]
        evidence = evidence - 0.5 * np.log(2 * np.pi) * np.sum(padded.mask, axis=1)
        remarks = (SINGULAR_REMARK.format(jitter),) if jitter > SILENT_JITTER else ()
        slope_sd = np.repeat(prior.slope_sd[:, None], kept, axis=1)
        return Posterior(
            padded.x, padded.low, padded.mask, theta(z), slope_sd, whiten, weights, prior, kernel,
            evidence, remarks,
        )  # fmt: skip
    raise InputError(
        "No Gaussian process fits the measured modes; set aside poses that are measured twice "
        "or far off with `planner withdraw`."
    )


def _whitening(
    kernel: str, data: Padded, prior: Prior, jitter: float, theta: np.ndarray
) -> np.ndarray:
    """Inverse Cholesky factors (m, k, c, c); LinAlgError where a covariance is singular."""
    outputs = zip(data.low, data.mask, data.variance, prior.bias_sd, prior.slope_sd, strict=True)
    each = [
        np.linalg.cholesky(data_covariance(np, kernel, data.x, *own, jitter, t))
        for t, own in zip(theta, outputs, strict=True)
    ]
    return np.array([[dtrtri(factor, lower=True)[0] for factor in factors] for factors in each])
