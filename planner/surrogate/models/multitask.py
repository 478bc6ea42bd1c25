"""Multi-task GP: t outputs share what they learn about poses (Lei et al. 2023, section 4.4.2).

cov(f_a(x), f_b(x')) = B_ab k(x, x') (intrinsic coregionalisation, Bonilla et al. 2008), with
B = L Lᵀ free and a noise per task. Every output is observed at every pose, so that K is
B ⊗ K_x + D and two small eigendecompositions do what one large Cholesky factor would (Rakitsch et
al. 2013). Hyperparameters: the most probable ones, or the likeliest.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.linalg import eigh

from planner import jax_setup
from planner.errors import InputError
from planner.inference.quasi_newton import maximise
from planner.surrogate.kernels import parse

NOISE, NOISE_SPREAD = 0.1, 1.5  # median sd of a task's noise over its scale, its log-sd
LENGTH, LENGTH_SPREAD = 0.8, 1.0  # of k's scales, times √d
REACH = 6.0  # sds of the prior beyond which nothing is looked for
FTOL = 1e-5  # of the log density: less changes no prediction
TASK_SD = 1.0  # of L's entries around those of the data's own covariance
RELATIVE_JITTER = 1e-9


@dataclass(frozen=True, eq=False)
class Normalised:
    """Outputs y (n, t) at x (n, d), each over its own mean and sd, `centre` and `scale` (t,)."""

    x: np.ndarray
    y: np.ndarray
    centre: np.ndarray
    scale: np.ndarray


@dataclass(frozen=True, eq=False)
class Tasks:
    """What is to be fitted: x (n, d), y (n, t) scaled, kernel expression."""

    x: np.ndarray
    y: np.ndarray
    kernel: str


@dataclass(frozen=True, eq=False)
class Hyperparameters:
    """L (t, t) lower triangular, log of the noise sds (t,), θ (p,) of the kernel over poses."""

    root: np.ndarray
    log_noise: np.ndarray
    theta: np.ndarray

    @property
    def task_covariance(self) -> np.ndarray:
        """B (t, t)."""
        return self.root @ self.root.T

    @property
    def noise(self) -> np.ndarray:
        """Variances D (t,)."""
        return np.exp(2 * self.log_noise)

    def flat(self) -> np.ndarray:
        """As one vector."""
        return np.concatenate([self.root[_lower(self.root)], self.log_noise, self.theta])

    def like(self, vector: np.ndarray) -> "Hyperparameters":
        """The ones in `vector`, shaped like these."""
        t = len(self.root)
        split = np.split(vector, [t * (t + 1) // 2, t * (t + 1) // 2 + t])
        root = np.zeros((t, t))
        root[_lower(root)] = split[0]
        return Hyperparameters(root, split[1], split[2])


@dataclass(frozen=True, eq=False)
class MultiTaskGP:
    """Fitted; y = centre + scale·(…) per task."""

    tasks: Tasks
    hyperparameters: Hyperparameters
    solved: "KroneckerSolution"
    centre: np.ndarray
    scale: np.ndarray

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, t) of the noise-free outputs at x (q, d)."""
        h, kernel = self.hyperparameters, parse(self.tasks.kernel, x.shape[1])
        cross = kernel.covariance(np, h.theta, x, self.tasks.x)
        b = h.task_covariance
        explained = self.solved.explained(cross, b)
        own = kernel.variance(np, h.theta, x)[:, None] * np.diag(b)[None, :]
        sd = np.sqrt(np.maximum(own - explained, 0.0))
        return self.centre + self.scale * (cross @ self.solved.alpha @ b), self.scale * sd

    @property
    def correlation(self) -> np.ndarray:
        """Correlation (t, t) of the outputs, as learned."""
        b = self.hyperparameters.task_covariance
        sd = np.sqrt(np.maximum(np.diag(b), 1e-300))
        return b / np.outer(sd, sd)


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
    in_noise = in_noise - 2 * np.sum(
        slope_b * b / np.outer(root, root), axis=1
    )  # fmt: skip
    return KroneckerSolution(
        value - 0.5 * n * t * np.log(2 * np.pi),
        alpha / root,
        slope_b / np.outer(root, root),
        0.5 * v @ inner_k @ v.T,
        in_noise,
        (v, w, u / root[:, None]),
    )


def fit_multitask(
    x: np.ndarray, y: np.ndarray, kernel: str = "rbf", iterations: int = 200, prior: bool = True
) -> MultiTaskGP:
    """Fit y (n, t) at x (n, d) scaled to about [0, 1], of at most `iterations` steps.

    Without `prior` it is the greatest likelihood, as published.
    InputError where a value is missing.
    """
    data = normalised(x, y)
    tasks = Tasks(x, data.y, kernel)
    guess = first_guess(tasks)
    middle, width = guess.flat(), prior_sds(guess)

    # In units of the prior's sds: what is held fast (1e-6) would spoil the steps of all others.
    def posterior(z: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = log_density(tasks, guess.like(middle + width * z))
        believed = float(prior) * z
        return value - 0.5 * float(believed @ z), width * slope - believed

    def climb(z: np.ndarray, reach: float | np.ndarray, steps: int) -> np.ndarray:
        return maximise(posterior, [z], -reach, reach, steps, FTOL).x

    z = climb(np.zeros(len(middle)), REACH, iterations)
    if np.any(guess.like(middle + width * z).noise > 1):
        # More noise than the output varies at all: a long first step has ended where an output
        # is given up. So first the poses' kernel and the noise, then the rest.
        others = np.arange(len(middle)) >= len(_lower(guess.root)[0])
        z = climb(climb(np.zeros(len(middle)), REACH * others, 20), REACH, iterations)
    h = guess.like(middle + width * z)
    return MultiTaskGP(tasks, h, solve(tasks, h), data.centre, data.scale)


def normalised(x: np.ndarray, y: np.ndarray) -> Normalised:
    """Of y (n, t) at x (n, d); InputError where a value is missing."""
    if not np.isfinite(y).all():
        which = int(np.argmin(np.isfinite(y).all(axis=0))) + 1
        raise InputError(f"Output {which} has no value at some pose: leave it or the pose out.")
    centre, scale = y.mean(axis=0), y.std(axis=0)
    scale = np.where(scale > 1e-12 * np.maximum(np.abs(centre), 1e-300), scale, 1.0)
    return Normalised(x, (y - centre) / scale, centre, scale)


def log_density(tasks: Tasks, h: Hyperparameters) -> tuple[float, np.ndarray]:
    """Log marginal likelihood and its slope in `h.flat()`."""
    solved = solve(tasks, h)
    slope_root = (solved.slope_b + solved.slope_b.T) @ h.root
    slope_theta = np.array(pull(tasks.kernel, h.theta, tasks.x, solved.slope_k))
    return solved.value, np.concatenate(
        [slope_root[_lower(h.root)], solved.slope_log_noise, slope_theta]
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


def first_guess(tasks: Tasks) -> Hyperparameters:
    """Hyperparameters to start from: B is the outputs' own covariance, made positive definite."""
    n, t = tasks.y.shape
    covariance = tasks.y.T @ tasks.y / n + 0.1 * np.eye(t)
    theta, _ = parse(tasks.kernel, tasks.x.shape[1]).prior(1.0, NOISE, LENGTH, 0.0, 1.0)
    return Hyperparameters(np.linalg.cholesky(covariance), np.full(t, np.log(NOISE)), theta)


def prior_sds(h: Hyperparameters) -> np.ndarray:
    """Prior sds of `h.flat()`; k's first amplitude and its nugget stay, for B and D hold them."""
    theta = np.full(len(h.theta), LENGTH_SPREAD)
    theta[:2] = 1e-6
    return Hyperparameters(
        np.full_like(h.root, TASK_SD), np.full_like(h.log_noise, NOISE_SPREAD), theta
    ).flat()


def _lower(root: np.ndarray) -> tuple[np.ndarray, ...]:
    return np.tril_indices(len(root))
