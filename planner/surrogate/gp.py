"""Gaussian processes, averaged over hyperparameters.

Per output: y = mean + ρ'·h + b + δ(x) + ε, where h is the centred low fidelity, ρ' = ρ − 1 and b
have Gaussian priors that are marginalised exactly as kernel terms, δ is a zero-mean GP, and ε has
the measurement's own variance plus a nugget τ². The hyperparameters θ (see `kernels.Kernel`) are
averaged (see `importance`).
"""

from collections.abc import Iterable
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from planner.errors import InputError
from planner.inference import triangular
from planner.surrogate.importance import Gaussians, Score, normal_points, sample
from planner.surrogate.kernels import parse
from planner.surrogate.training_data import Padded, Prior, data_covariance, thinned

JITTERS = (1e-13, 1e-10, 1e-8, 1e-6)  # relative to the prior variance
SURELY = 100.0  # times n² ε: noise, relative to the variance, that keeps a covariance regular
SILENT_JITTER = 1e-10  # of the prior variance; a larger one is reported
# Points up to which all of them are looked at for every sample of θ. Of more, θ is sampled in
# stages: as ever by the first number of them, then by more points with half the samples each time,
# around what the stage before favours. Beyond the last number θ is known well enough, and the
# evidence is that of so many points.
AT_ONCE = 64
STAGES = 32, 64, 128
# θ is the better known the more points there are: samples kept, by this at most. At 500 generated
# poses 4 samples err and cover as 8 do.
MOST_FEWER = 8
IN_CACHE = 2**15  # elements of matrices: of more, most time goes into memory
NO_FIT = (
    "No Gaussian process fits the measured modes; set aside poses that are measured twice "
    "or far off with `planner withdraw`."
)
SINGULAR_REMARK = (
    "The covariance was singular until {:g} of its variance was added to the noise: two poses are "
    "nearly the same, and their sds claim more than that."
)


@dataclass(frozen=True, eq=False)
class Solved:
    """What the data say at each of k samples: L⁻¹ (k, n, n) and K⁻¹(y − mean) (k, n).

    K = LLᵀ is their covariance; `jitter`, relative to the prior variance, had to be added to K.
    """

    whiten: np.ndarray
    weights: np.ndarray
    jitter: float


@dataclass(frozen=True, eq=False)
class Posterior:
    """One output: n points that hold a value, k hyperparameter samples of equal weight.

    Everything after the fit is plain NumPy on few matrices, which are worked out when asked for:
    of models that were weighed and found improbable they never are.
    """

    rows: np.ndarray  # (n,) of the training data
    x: np.ndarray  # (n, d)
    y: np.ndarray  # (n,) less the prior mean
    variance: np.ndarray  # (n,) of the measurements
    low: np.ndarray  # (n,) centred
    theta: np.ndarray  # (k, p)
    slope_sd: np.ndarray  # (k,) of ρ'
    bias_sd: float
    mean: float  # of the prior
    kernel: str
    log_evidence: float  # log p(y | model), θ averaged out
    jitter: float  # relative to the prior variance, that θ was sampled with
    low_scale: float | None = None  # where kernels see low over it, beside x

    def __getstate__(self) -> dict[str, Any]:
        # Matrices of many points are worked out again as fast as they are read.
        few = len(self.x) <= AT_ONCE
        return {name: v for name, v in vars(self).items() if few or name != "solved"}

    @cached_property
    def solved(self) -> Solved:
        """InputError where no jitter makes the covariances regular."""
        for jitter in JITTERS[JITTERS.index(self.jitter) :]:
            try:
                # The same digits wherever those of many points are worked out again.
                with threadpool_limits(1) if len(self.x) > AT_ONCE else nullcontext():
                    return self._solved(jitter)
            except np.linalg.LinAlgError:
                continue
        raise InputError(NO_FIT)

    def _solved(self, jitter: float) -> Solved:
        """LinAlgError where a covariance is singular."""
        data = jitter, self.seen(self.x, self.low), self.low, np.ones(len(self.x)), self.variance
        each = zip(self.theta, self.slope_sd, strict=True)
        covariances = (
            data_covariance(np, self.kernel, t, *data, self.bias_sd, slope) for t, slope in each
        )
        # By NumPy: SciPy takes long to import, and loaded late its BLAS has more than one thread.
        whiten = np.array([triangular.inverse(np.linalg.cholesky(k)) for k in covariances])
        weights = np.swapaxes(whiten, 1, 2) @ (whiten @ self.y)[..., None]
        return Solved(whiten, weights[..., 0], jitter)

    @property
    def regular_jitter(self) -> float:
        """With which the covariances are regular."""
        if "solved" in vars(self) or not len(self.x):
            return self.solved.jitter
        noise = np.exp(2 * self.theta[:, 1, None]) + self.variance
        whole = noise + self.own(self.x, self.low)
        # So much more than rounding makes of n points, and a factor has to exist (Demmel 1989).
        enough = SURELY * noise.shape[1] ** 2 * np.finfo(float).eps
        if np.all(noise.min(axis=1) > enough * whole.max(axis=1)):
            return self.jitter
        return self.solved.jitter

    def predict(
        self, x: np.ndarray, low: np.ndarray, nugget: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q,) at x (q, d) with centred low (q,).

        The sd is that of the noise-free output; with `nugget`, that of one more value without
        measurement noise of its own.
        """
        means, variances = self.predictive(x, low)
        added = np.exp(2 * self.theta[:, 1, None]) if nugget else 0.0
        mean = np.mean(means, axis=0)
        return mean, np.sqrt(np.mean(variances + added + (means - mean) ** 2, axis=0))

    def predictive(self, x: np.ndarray, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Means and variances (k, q) of the noise-free output, one Gaussian per sample."""
        cross, white = self.cross(x, low)
        means = self.mean + (self.solved.weights[:, None] @ cross)[:, 0]
        return means, np.maximum(self.own(x, low) - np.sum(white**2, axis=1), 0.0)

    def covariance(
        self, xa: np.ndarray, la: np.ndarray, xb: np.ndarray, lb: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Posterior covariance (k, a, b), variances (k, a), (k, b), per sample."""
        _, wa = self.cross(xa, la)
        _, wb = self.cross(xb, lb)
        va = self.own(xa, la) - np.sum(wa**2, axis=1)
        vb = self.own(xb, lb) - np.sum(wb**2, axis=1)
        covariance = self.prior(xa, la, xb, lb) - np.swapaxes(wa, 1, 2) @ wb
        return covariance, np.maximum(va, 0.0), np.maximum(vb, 0.0)

    @property
    def nugget_variance(self) -> float:
        """Mean nugget variance."""
        return float(np.mean(np.exp(2 * self.theta[:, 1])))

    def prior(self, xa: np.ndarray, la: np.ndarray, xb: np.ndarray, lb: np.ndarray) -> np.ndarray:
        """Prior covariance (k, a, b), so many samples at once as the processor's cache holds."""
        linear, xa, xb = np.outer(la, lb), self.seen(xa, la), self.seen(xb, lb)
        delta, square = parse(self.kernel, xa.shape[1]), self.slope_sd[:, None, None] ** 2
        some = max(1, IN_CACHE // max(linear.size, 1))
        parts = (slice(i, i + some) for i in range(0, len(self.theta), some))
        return np.concatenate(
            [
                delta.covariance(np, self.theta[p], xa, xb) + (self.bias_sd**2 + square[p] * linear)
                for p in parts
            ]
        )

    def own(self, x: np.ndarray, low: np.ndarray) -> np.ndarray:
        """Prior variances (k, q)."""
        linear = self.bias_sd**2 + self.slope_sd[:, None] ** 2 * low**2
        x = self.seen(x, low)
        return parse(self.kernel, x.shape[1]).variance(np, self.theta, x) + linear

    def seen(self, x: np.ndarray, low: np.ndarray) -> np.ndarray:
        """Coordinates (q, d) as the kernel takes them."""
        return x if self.low_scale is None else np.column_stack([x, low / self.low_scale])

    def cross(self, x: np.ndarray, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Prior covariance (k, n, q) with the training points, and L⁻¹ times it."""
        found = self.prior(self.x, self.low, x, low)
        return found, self.solved.whiten @ found


def remarks(posteriors: Iterable[Posterior]) -> tuple[str, ...]:
    """What went wrong in the fit of several outputs."""
    jitter = max(one.regular_jitter for one in posteriors)
    return (SINGULAR_REMARK.format(jitter),) if jitter > SILENT_JITTER else ()


def fit(
    padded: Padded, prior: Prior, samples: int = 256, kept: int = 32, kernel: str = "matern52",
    rounds: int = 1, start: Gaussians | None = None, low_scale: np.ndarray | None = None,
) -> tuple[Posterior, ...]:  # fmt: skip
    """Posterior of each output; y and low of `padded` as they are, prior mean taken off here.

    `samples` of θ from the prior and as many in each of `rounds`; `start`, in units of the prior,
    is where the first round looks, as `likelihood.laplace` finds. Of more than AT_ONCE points, θ is
    sampled in stages, and fewer samples are kept. With `low_scale` (m,) kernels see low
    over it, beside x.

    InputError if the covariance stays singular whatever is added to its diagonal.
    """
    m, p = prior.theta_mean.shape
    c = padded.y.shape[1]
    given = padded if low_scale is None else padded.widened(low_scale)
    first, more = given, []
    if start is None and c > AT_ONCE:
        first, *more = [thinned(given, size) for size in STAGES]
        kept = max(kept // MOST_FEWER, kept * AT_ONCE // c)
    normal = [normal_points(samples, p, seed) for seed in range(1, 2 + rounds + len(more))]
    weighed = np.sum((more or [first])[-1].mask, axis=1)
    for jitter in JITTERS:
        score, *scores = [_score(kernel, part, prior, jitter) for part in (first, *more)]
        later = [(s, max(samples // 2**i, 1)) for i, s in enumerate(scores, 1)]
        try:
            z, evidence = sample(score, normal, m, kept, start, prior.nugget_shared, later)
        except np.linalg.LinAlgError:
            continue
        theta, evidence = _theta(prior, z), evidence - 0.5 * np.log(2 * np.pi) * weighed
        scales = [None] * m if low_scale is None else low_scale.tolist()
        return tuple(
            Posterior(
                rows := np.flatnonzero(padded.mask[j]), padded.x[rows],
                padded.y[j, rows] - prior.mean[j], padded.variance[j, rows], padded.low[j, rows],
                theta[j], np.full(kept, prior.slope_sd[j]), prior.bias_sd[j], prior.mean[j],
                kernel, evidence[j], jitter, scales[j],
            )
            for j in range(m)
        )  # fmt: skip
    raise InputError(NO_FIT)


def _theta(prior: Prior, z: np.ndarray) -> np.ndarray:
    return prior.theta_mean[:, None, :] + prior.theta_sd[:, None, :] * z


def _score(kernel: str, data: Padded, prior: Prior, jitter: float) -> Score:
    """Log likelihoods (m, s) of some data at z (m, s, p), in units of the prior."""
    from planner.surrogate.likelihood import log_likelihoods  # by JAX, which is slow to import

    return lambda z: log_likelihoods(kernel, data, prior, jitter, _theta(prior, z))
