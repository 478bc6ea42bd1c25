"""Multi-task GP: t outputs share what they learn about poses (Lei et al. 2023, section 4.4.2).

cov(f_a(x), f_b(x')) = B_ab k(x, x') (intrinsic coregionalisation, Bonilla et al. 2008) with a noise
per task. B is free, L Lᵀ, for groups of a kind as published, or of a low rank, W Wᵀ + diag(κ), for
any number of tasks at once. Every output is observed at every pose, so that K is B ⊗ K_x + D and
two small eigendecompositions do what one large Cholesky factor would, O(n³ + t³) in place of
O(n³ t³) (Rakitsch et al. 2013). Hyperparameters: the most probable ones, or the likeliest, begun at
the outputs' own covariance, poses' kernel and noises first.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.linalg import eigh

from planner import jax_setup
from planner.errors import InputError
from planner.inference.covariance import eigen
from planner.surrogate.ar1 import AR1
from planner.surrogate.frequency_models import FEWEST, FrequencyData
from planner.surrogate.kernels import parse
from planner.surrogate.likelihood import maximise

RANK = 3  # columns of W: chosen on robots 1 and 2 of the study of Lei et al. 2023
NOISE, NOISE_SPREAD = 0.1, 1.5  # median sd of a task's noise over its scale, its log-sd
LENGTH = 0.8  # of k's scales, times √d
FREE_SPREAD, LOW_RANK_SPREAD = 1.0, 0.5  # log-sd of k's scales; the second chosen as RANK
OWN, OWN_SPREAD = 0.1, 1.5  # κ's square root over the output's sd: median, log-sd
WEIGHT_SD = 1.0  # of L's or W's entries around those of the data's own covariance
REACH = 6.0  # sds of the prior beyond which nothing is looked for
FIRST_STEPS, MOST_STEPS, FTOL = 40, 200, 1e-6
RELATIVE_JITTER = 1e-9


@dataclass(frozen=True, eq=False)
class Tasks:
    """Outputs y (n, t) at x (n, d), each over its own mean and sd, `centre` and `scale` (t,)."""

    x: np.ndarray
    y: np.ndarray
    kernel: str
    centre: np.ndarray
    scale: np.ndarray

    @classmethod
    def of(cls, x: np.ndarray, y: np.ndarray, kernel: str = "rbf") -> "Tasks":
        """Of y (n, t) at x (n, d); InputError where a value is missing."""
        if not np.isfinite(y).all():
            which = int(np.argmin(np.isfinite(y).all(axis=0))) + 1
            raise InputError(f"Output {which} has no value at some pose: leave it or the pose out.")
        centre, scale = y.mean(axis=0), y.std(axis=0)
        scale = np.where(scale > 1e-12 * np.maximum(np.abs(centre), 1e-300), scale, 1.0)
        return cls(x, (y - centre) / scale, kernel, centre, scale)


@dataclass(frozen=True, eq=False)
class Hyperparameters:
    """W (t, r), log √κ (t,), log noise sds (t,), θ (p,) of the kernel over poses.

    A free B has r = t, W lower triangular and no κ (−∞).
    """

    weights: np.ndarray
    log_own: np.ndarray
    log_noise: np.ndarray
    theta: np.ndarray

    @property
    def task_covariance(self) -> np.ndarray:
        """B (t, t)."""
        return self.weights @ self.weights.T + np.diag(np.exp(2 * self.log_own))

    @property
    def noise(self) -> np.ndarray:
        """Variances D (t,)."""
        return np.exp(2 * self.log_noise)

    def flat(self) -> np.ndarray:
        """As one vector."""
        return np.concatenate([self.weights.ravel(), self.log_own, self.log_noise, self.theta])

    def like(self, vector: np.ndarray) -> "Hyperparameters":
        """The ones in `vector`, shaped like these."""
        t, r = self.weights.shape
        split = np.split(vector, [t * r, t * r + t, t * r + 2 * t])
        return Hyperparameters(split[0].reshape(t, r), *split[1:])


@dataclass(frozen=True, eq=False)
class MultiTaskGP:
    """Fitted; y = centre + scale·(…) per task."""

    tasks: Tasks
    hyperparameters: Hyperparameters
    solved: "KroneckerSolution"

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, t) of the noise-free outputs at x (q, d)."""
        h, tasks = self.hyperparameters, self.tasks
        kernel, b = parse(tasks.kernel, x.shape[1]), h.task_covariance
        cross = kernel.covariance(np, h.theta, x, tasks.x)
        own = kernel.variance(np, h.theta, x)[:, None] * np.diag(b)[None, :]
        sd = np.sqrt(np.maximum(own - self.solved.explained(cross, b), 0.0))
        return tasks.centre + tasks.scale * (cross @ self.solved.alpha @ b), tasks.scale * sd


@dataclass(frozen=True, eq=False)
class KroneckerSolution:
    """log-likelihood, α = K⁻¹y (n, t) and its slopes in B, K_x and log D.

    `rotation` holds eigenvectors (n, n), eigenvalues (n, t) of K over D, and task vectors (t, t).
    """

    value: float
    alpha: np.ndarray
    slope_b: np.ndarray
    slope_k: np.ndarray
    slope_log_noise: np.ndarray
    rotation: tuple[np.ndarray, np.ndarray, np.ndarray]

    def explained(self, cross: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Variance (q, t) that the data take away; cross (q, n) of the poses' kernel."""
        v, w, u = self.rotation
        return ((cross @ v) ** 2 @ (1 / w)) @ ((b @ u) ** 2).T


def solve_kronecker(
    y: np.ndarray, k: np.ndarray, b: np.ndarray, noise: np.ndarray
) -> KroneckerSolution:
    """For y (n, t) without gaps, k (n, n), b (t, t), noise variances (t,): O(n³ + t³)."""
    n, t = y.shape
    root = np.sqrt(noise)
    scaled = y / root
    # Not NumPy's divide and conquer: it failed on a regular matrix of 89 clustered poses.
    values, v = eigh(k, driver="evr")
    tasks, u = eigh(b / np.outer(root, root), driver="evr")
    values, tasks = np.maximum(values, 0.0), np.maximum(tasks, 0.0)
    w = np.outer(values, tasks) + 1
    rotated = v.T @ scaled @ u
    a = rotated / w
    value = -0.5 * np.sum(rotated * a) - 0.5 * np.sum(np.log(w)) - 0.5 * n * np.sum(np.log(noise))
    inner_b = a.T @ (values[:, None] * a) - np.diag(np.sum(values[:, None] / w, axis=0))
    inner_k = (a * tasks) @ a.T - np.diag(np.sum(tasks / w, axis=1))
    slope_b = 0.5 * u @ inner_b @ u.T
    alpha = v @ a @ u.T
    in_noise = np.sum(alpha * scaled, axis=0) - n
    in_noise = in_noise - 2 * np.sum(slope_b * b / np.outer(root, root), axis=1)
    return KroneckerSolution(
        value - 0.5 * n * t * np.log(2 * np.pi),
        alpha / root,
        slope_b / np.outer(root, root),
        0.5 * v @ inner_k @ v.T,
        in_noise,
        (v, w, u / root[:, None]),
    )


def fit_multitask(
    x: np.ndarray, y: np.ndarray, kernel: str = "rbf", prior: bool = True, rank: int | None = None
) -> MultiTaskGP:
    """Fit y (n, t) at x (n, d) scaled to about [0, 1].

    `rank` of W; None: B is free. Without `prior` it is the greatest likelihood, as published.
    InputError where a value is missing.
    """
    tasks = Tasks.of(x, y, kernel)
    guess = first_guess(tasks, rank)
    middle, width = guess.flat(), prior_sds(guess, rank)

    # In units of the prior's sds: what is held fast (0) would spoil the steps of all others.
    def posterior(z: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = log_density(tasks, guess.like(middle + width * z))
        believed = float(prior) * z
        return value - 0.5 * float(believed @ z), width * slope - believed

    # B last: a long first step would end where an output is given up as noise.
    z = np.zeros(len(middle))
    others = np.arange(len(z)) >= guess.weights.size + guess.log_own.size
    for free, steps in ((others, FIRST_STEPS), (np.ones(len(z)), MOST_STEPS)):
        z = maximise(posterior, [z], -REACH * free, REACH * free, steps, FTOL).x
    h = guess.like(middle + width * z)
    return MultiTaskGP(tasks, h, solve(tasks, h))


def log_density(tasks: Tasks, h: Hyperparameters) -> tuple[float, np.ndarray]:
    """Log marginal likelihood and its slope in `h.flat()`."""
    solved = solve(tasks, h)
    slope_weights = (solved.slope_b + solved.slope_b.T) @ h.weights
    slope_own = 2 * np.diag(solved.slope_b) * np.exp(2 * h.log_own)
    slope_theta = np.array(pull(tasks.kernel, h.theta, tasks.x, solved.slope_k))
    return solved.value, np.concatenate(
        [slope_weights.ravel(), slope_own, solved.slope_log_noise, slope_theta]
    )


def solve(tasks: Tasks, h: Hyperparameters) -> KroneckerSolution:
    """K⁻¹y and all slopes at hyperparameters, by Kronecker's structure."""
    k = parse(tasks.kernel, tasks.x.shape[1]).covariance(np, h.theta, tasks.x, tasks.x)
    k = k + RELATIVE_JITTER * np.mean(np.diag(k)) * np.eye(len(k))
    return solve_kronecker(tasks.y, k, h.task_covariance, h.noise)


@jax_setup.compiled(static_argnums=0)
def pull(kernel: str, theta: Array, x: Array, slope: Array) -> Array:
    """Slope in θ from the slope (n, n) in the kernel's matrix."""
    k = parse(kernel, x.shape[1])
    return jax.grad(lambda t: jnp.sum(k.covariance(jnp, t, x, x) * slope))(theta)


def first_guess(tasks: Tasks, rank: int | None) -> Hyperparameters:
    """Hyperparameters to start from: B is the outputs' own covariance, or its first components."""
    n, t = tasks.y.shape
    covariance = tasks.y.T @ tasks.y / n
    if rank is None:
        weights, own = np.linalg.cholesky(covariance + 0.1 * np.eye(t)), np.full(t, -np.inf)
    else:
        values, vectors = eigen(covariance)
        weights = (vectors * np.sqrt(np.maximum(values, 0.0)))[:, ::-1][:, :rank]
        own = np.full(t, np.log(OWN))
    theta, _ = parse(tasks.kernel, tasks.x.shape[1]).prior(1.0, NOISE, LENGTH, 0.0, 1.0)
    return Hyperparameters(weights, own, np.full(t, np.log(NOISE)), theta)


def prior_sds(h: Hyperparameters, rank: int | None) -> np.ndarray:
    """Prior sds of `h.flat()`, 0 of what stays.

    So do k's first amplitude and its nugget, for B and D hold them.
    """
    weights = np.full_like(h.weights, WEIGHT_SD)
    theta = np.full(len(h.theta), FREE_SPREAD if rank is None else LOW_RANK_SPREAD)
    theta[:2] = 0.0
    return Hyperparameters(
        np.tril(weights) if rank is None else weights,
        np.full_like(h.log_own, 0.0 if rank is None else OWN_SPREAD),
        np.full_like(h.log_noise, NOISE_SPREAD),
        theta,
    ).flat()


@dataclass(frozen=True, eq=False)
class TaskedDeviations:
    """One GP of how far all outputs are off what `ar1` says of the simulation with a factor 1."""

    ar1: AR1
    gp: MultiTaskGP

    def predict(self, x: np.ndarray, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, m) at x (q, d), simulation low (q, m)."""
        mean, sd = self.gp.predict(x)
        base, _, blind = self.ar1.split(low)
        return mean + base, np.hypot(sd, blind)


def fit_tasks(seen: FrequencyData, ar1: AR1) -> TaskedDeviations | None:
    """At poses where every output is known; None where these are fewer than FEWEST."""
    data = seen.values
    base, _, blind = ar1.split(data.low)
    off = data.y - base
    whole = np.isfinite(off).all(axis=1) & ~blind.any(axis=1)
    if whole.sum() < FEWEST:
        return None
    return TaskedDeviations(ar1, fit_multitask(data.x[whole], off[whole], seen.kernel))
