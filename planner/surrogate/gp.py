"""Gaussian processes of many outputs, averaged over hyperparameters.

Per output: y = mean + ρ'·h + b + δ(x) + ε, where h is the centred low fidelity, ρ' = ρ − 1 and b
have Gaussian priors that are marginalised exactly as kernel terms, δ is a zero-mean GP, and ε has
the measurement's own variance plus a nugget τ². The hyperparameters θ (see `kernels.Kernel`) are
averaged (see `importance`).
"""

from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from planner.errors import InputError
from planner.inference import triangular
from planner.surrogate.importance import Gaussians, Score, Stage, normal_points, sample
from planner.surrogate.kernels import parse
from planner.surrogate.predictive import Predictive
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
    """What an output's data say at each of k samples: L⁻¹ (k, n, n) and K⁻¹(y − mean) (k, n).

    K = LLᵀ is the covariance of the n points that hold a value; `jitter`, relative to the prior
    variance, had to be added to K.
    """

    whiten: np.ndarray
    weights: np.ndarray
    jitter: float


@dataclass(frozen=True, eq=False)
class Posterior:
    """m outputs, k hyperparameter samples of equal weight, c padded training points.

    Everything after the fit is plain NumPy on few matrices, which are worked out when asked for:
    of models that were weighed and found improbable they never are.
    """

    x: np.ndarray  # (c, d)
    y: np.ndarray  # (m, c) less the prior mean
    variance: np.ndarray  # (m, c) of the measurements
    low: np.ndarray  # (m, c) centred
    mask: np.ndarray  # (m, c)
    theta: np.ndarray  # (m, k, p)
    slope_sd: np.ndarray  # (m, k) of ρ'
    prior: Prior
    kernel: str
    log_evidence: np.ndarray  # (m,) log p(y | model), θ averaged out
    jitter: float  # relative to the prior variance, that θ was sampled with

    _found: dict[int, Solved] = field(default_factory=dict, init=False, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        # Matrices of many points are worked out again as fast as they are read.
        few = len(self.x) <= AT_ONCE
        return vars(self) | {"_found": self._found if few else {}}

    def solved(self, j: int) -> Solved:
        """Of output j; InputError where no jitter makes its covariances regular."""
        for jitter in JITTERS[JITTERS.index(self.jitter) :] if j not in self._found else ():
            try:
                # The same digits wherever those of many points are worked out again.
                with threadpool_limits(1) if len(self.x) > AT_ONCE else nullcontext():
                    self._found[j] = self._solved(j, jitter)
                break
            except np.linalg.LinAlgError:
                continue
        if j not in self._found:
            raise InputError(NO_FIT)
        return self._found[j]

    def _solved(self, j: int, jitter: float) -> Solved:
        """LinAlgError where a covariance is singular."""
        known = self.known(j)
        low, mask, variance = (v[j, known] for v in (self.low, self.mask, self.variance))
        data = jitter, self.x[known], low, mask, variance, self.prior.bias_sd[j]
        each = zip(self.theta[j], self.slope_sd[j], strict=True)
        covariances = (data_covariance(np, self.kernel, t, *data, slope) for t, slope in each)
        # By NumPy: SciPy takes long to import, and loaded late its BLAS has more than one thread.
        whiten = np.array([triangular.inverse(np.linalg.cholesky(k)) for k in covariances])
        weights = np.swapaxes(whiten, 1, 2) @ (whiten @ self.y[j, known])[..., None]
        return Solved(whiten, weights[..., 0], jitter)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What went wrong."""
        jitter = max(self._jitter(j) for j in range(len(self.mask)))
        return (SINGULAR_REMARK.format(jitter),) if jitter > SILENT_JITTER else ()

    def _jitter(self, j: int) -> float:
        """With which the covariances of output j are regular."""
        known = self.known(j)
        if j in self._found or self.mask[j].sum() == 0:
            return self.solved(j).jitter
        noise = np.exp(2 * self.theta[j, :, 1, None]) + self.variance[j, known]
        whole = noise + self.own(j, self.x[known], self.low[j, known])
        # So much more than rounding makes of n points, and a factor has to exist (Demmel 1989).
        enough = SURELY * noise.shape[1] ** 2 * np.finfo(float).eps
        if np.all(noise.min(axis=1) > enough * whole.max(axis=1)):
            return self.jitter
        return self.solved(j).jitter

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
        cross, white = self.cross(j, x, low)
        means = self.prior.mean[j] + (self.solved(j).weights[:, None] @ cross)[:, 0]
        own = self.own(j, x, low) - np.sum(white**2, axis=1)
        return Predictive(np.full(len(means), 1 / len(means)), means, np.sqrt(np.maximum(own, 0.0)))

    def covariance(
        self, j: int, xa: np.ndarray, la: np.ndarray, xb: np.ndarray, lb: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Posterior covariance (k, a, b), variances (k, a), (k, b) of output j, per sample."""
        _, wa = self.cross(j, xa, la)
        _, wb = self.cross(j, xb, lb)
        prior = self._prior(j, xa, la, xb, lb)
        va = self.own(j, xa, la) - np.sum(wa**2, axis=1)
        vb = self.own(j, xb, lb) - np.sum(wb**2, axis=1)
        covariance = prior - np.swapaxes(wa, 1, 2) @ wb
        return covariance, np.maximum(va, 0.0), np.maximum(vb, 0.0)

    def nugget_variance(self) -> np.ndarray:
        """Mean nugget variance (m,)."""
        return np.mean(np.exp(2 * self.theta[:, :, 1]), axis=1)

    def _prior(
        self, j: int, xa: np.ndarray, la: np.ndarray, xb: np.ndarray, lb: np.ndarray
    ) -> np.ndarray:
        """Prior covariance (k, a, b), so many samples at once as the processor's cache holds."""
        delta, bias = parse(self.kernel, self.x.shape[1]), self.prior.bias_sd[j] ** 2
        linear, theta = np.outer(la, lb), self.theta[j]
        square = self.slope_sd[j][:, None, None] ** 2
        some = max(1, IN_CACHE // max(linear.size, 1))
        parts = (slice(i, i + some) for i in range(0, len(theta), some))
        return np.concatenate(
            [delta.covariance(np, theta[p], xa, xb) + (bias + square[p] * linear) for p in parts]
        )

    def own(self, j: int, x: np.ndarray, low: np.ndarray) -> np.ndarray:
        """Prior variances (k, q) of output j."""
        linear = self.prior.bias_sd[j] ** 2 + self.slope_sd[j][:, None] ** 2 * low**2
        return parse(self.kernel, self.x.shape[1]).variance(np, self.theta[j], x) + linear

    def cross(self, j: int, x: np.ndarray, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Prior covariance (k, n, q) with the n points that hold a value, and L⁻¹ times it."""
        known = self.known(j)
        found = self._prior(j, self.x[known], self.low[j, known], x, low)
        return found, self.solved(j).whiten @ found

    def known(self, j: int) -> np.ndarray:
        """Which of the training points hold a value of output j."""
        return np.flatnonzero(self.mask[j])


def fit(
    padded: Padded, prior: Prior, samples: int = 256, kept: int = 32, kernel: str = "matern52",
    rounds: int = 1, start: Gaussians | None = None,
) -> Posterior:  # fmt: skip
    """Posterior of all outputs; y and low of `padded` as they are, prior mean taken off here.

    `samples` of θ from the prior and as many in each of `rounds`; `start`, in units of the prior,
    is where the first round looks, as `likelihood.laplace` finds. Of more than AT_ONCE points, θ is
    sampled in stages (`growing`), and fewer samples are kept.

    InputError if the covariance stays singular whatever is added to its diagonal.
    """
    m, p = prior.theta_mean.shape
    c = len(padded.x)
    first, more = padded, []
    if start is None and c > AT_ONCE:
        first, *more = [thinned(padded, size) for size in STAGES]
        kept = max(kept // MOST_FEWER, kept * AT_ONCE // c)
    normal = [normal_points(samples, p, seed) for seed in range(1, 2 + rounds + len(more))]
    for jitter in JITTERS:
        score, *scores = [_score(kernel, part, prior, jitter) for part in (first, *more)]
        later = [Stage(s, max(samples // 2**i, 1)) for i, s in enumerate(scores, 1)]
        try:
            z, evidence = sample(score, normal, m, kept, start, prior.nugget_shared, later)
        except np.linalg.LinAlgError:
            continue
        y = (padded.y - prior.mean[:, None]) * padded.mask
        slope_sd = np.repeat(prior.slope_sd[:, None], kept, axis=1)
        weighed = np.sum((more or [first])[-1].mask, axis=1)
        return Posterior(
            padded.x, y, padded.variance, padded.low, padded.mask, _theta(prior, z), slope_sd,
            prior, kernel, evidence - 0.5 * np.log(2 * np.pi) * weighed, jitter,
        )  # fmt: skip
    raise InputError(NO_FIT)


def _theta(prior: Prior, z: np.ndarray) -> np.ndarray:
    return prior.theta_mean[:, None, :] + prior.theta_sd[:, None, :] * z


def _score(kernel: str, data: Padded, prior: Prior, jitter: float) -> Score:
    """Log likelihoods (m, s) of some data at z (m, s, p), in units of the prior."""
    from planner.surrogate.likelihood import log_likelihoods  # by JAX, which is slow to import

    return lambda z: log_likelihoods(kernel, data, prior, jitter, _theta(prior, z))
