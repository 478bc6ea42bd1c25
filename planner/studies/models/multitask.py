"""Multi-task GP: t outputs that share what they learn about the poses (seed 003, section 2.3).

cov(f_a(x), f_b(x')) = B_ab k(x, x') (intrinsic coregionalisation, Bonilla et al. 2008), with
B = L Lᵀ free and a noise per task. Where every output is observed at every pose, K is B ⊗ K_x + D
and two small eigendecompositions do what one large Cholesky factor would (Rakitsch et al. 2013);
with gaps the observed entries are taken as they are. Hyperparameters: the most probable ones, or a
Laplace mixture around them (`task_average`).
"""

from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from planner import jax_setup
from planner.errors import InputError
from planner.surrogate.kernels import parse

NOISE, NOISE_SPREAD = 0.1, 1.5  # median sd of a task's noise over its scale, its log-sd
LENGTH, LENGTH_SPREAD = 0.8, 1.0  # of k's scales, times √d
REACH = 6.0  # sds of the prior beyond which nothing is looked for
FTOL = 1e-5  # of the log density: less changes no prediction
TASK_SD = 1.0  # of L's entries around those of the data's own covariance
RELATIVE_JITTER = 1e-9


@dataclass(frozen=True, eq=False)
class Tasks:
    """What is to be fitted: x (n, d), y (n, t) scaled, NaN where missing, kernel expression."""

    x: np.ndarray
    y: np.ndarray
    kernel: str

    @property
    def complete(self) -> bool:
        """Whether every output is known everywhere."""
        return bool(np.isfinite(self.y).all())


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
    solved: "Solved"
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
class Solved:
    """log-likelihood, α = K⁻¹y (n, t) and its slopes in B, K_x and log D; dense or Kronecker."""

    value: float
    alpha: np.ndarray
    slope_b: np.ndarray
    slope_k: np.ndarray
    slope_log_noise: np.ndarray
    rotation: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
    inverse: np.ndarray | None = None  # (n, t, n, t), zero where missing

    def explained(self, cross: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Variance (q, t) that the data take away; cross (q, n) of the poses' kernel."""
        if self.rotation is not None:
            v, w, u = self.rotation
            return ((cross @ v) ** 2 @ (1 / w)) @ ((b @ u) ** 2).T
        assert self.inverse is not None
        return np.einsum(
            "qi,ta,iajb,qj,tb->qt", cross, b, self.inverse, cross, b, optimize="optimal"
        )


def solve_kronecker(y: np.ndarray, k: np.ndarray, b: np.ndarray, noise: np.ndarray) -> Solved:
    """For y (n, t) without gaps, k (n, n), b (t, t), noise variances (t,): O(n³ + t³)."""
    n, t = y.shape
    root = np.sqrt(noise)
    scaled = y / root
    values, v = np.linalg.eigh(k)
    tasks, u = np.linalg.eigh(b / np.outer(root, root))
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
    return Solved(
        value - 0.5 * n * t * np.log(2 * np.pi),
        alpha / root,
        slope_b / np.outer(root, root),
        0.5 * v @ inner_k @ v.T,
        in_noise,
        (v, w, u / root[:, None]),
    )


def solve_dense(y: np.ndarray, k: np.ndarray, b: np.ndarray, noise: np.ndarray) -> Solved:
    """For y (n, t) with NaN where missing: O((n t)³)."""
    n, t = y.shape
    pose, task = np.nonzero(np.isfinite(y))
    seen = y[pose, task]
    full = b[np.ix_(task, task)] * k[np.ix_(pose, pose)] + np.diag(noise[task])
    factor = cho_factor(full, lower=True)
    alpha, inverse = cho_solve(factor, seen), cho_solve(factor, np.eye(len(seen)))
    log_det = 2 * np.sum(np.log(np.diag(factor[0])))
    slope = 0.5 * (np.outer(alpha, alpha) - inverse)
    wide, kept = np.zeros((2, n, t, n, t))
    place = np.ix_(*[range(len(seen))] * 2)
    rows, columns = (pose[:, None], task[:, None]), (pose[None, :], task[None, :])
    wide[rows[0], rows[1], columns[0], columns[1]] = slope[place]
    kept[rows[0], rows[1], columns[0], columns[1]] = inverse[place]
    laid = np.zeros((n, t))
    laid[pose, task] = alpha
    diagonal = np.bincount(task, weights=np.diag(slope), minlength=t)
    return Solved(
        -0.5 * (seen @ alpha + log_det + len(seen) * np.log(2 * np.pi)),
        laid,
        np.einsum("iajb,ij->ab", wide, k),
        np.einsum("iajb,ab->ij", wide, b),
        2 * noise * diagonal,
        None,
        kept,
    )


def fit_multitask(
    x: np.ndarray, y: np.ndarray, kernel: str = "rbf", iterations: int = 200
) -> MultiTaskGP:
    """Fit y (n, t), NaN where missing, at x (n, d) scaled to about [0, 1].

    InputError where an output is nowhere known, for then nothing can be said of it.
    """
    known = np.isfinite(y)
    if not known.any(axis=0).all():
        which = int(np.argmin(known.any(axis=0))) + 1
        raise InputError(f"Output {which} has no value at any pose: leave it out.")
    count = known.sum(axis=0)
    centre = np.where(known, y, 0.0).sum(axis=0) / count
    apart = np.where(known, y - centre, 0.0)
    scale = np.sqrt(np.sum(apart**2, axis=0) / count)
    scale = np.where(scale > 1e-12 * np.maximum(np.abs(centre), 1e-300), scale, 1.0)
    tasks = Tasks(x, np.where(known, (y - centre) / scale, np.nan), kernel)
    start = first_guess(tasks)
    middle, width = start.flat(), prior_sds(start)

    def negative(vector: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = log_density(tasks, start.like(vector))
        off = (vector - middle) / width
        return -value + 0.5 * float(off @ off), -slope + off / width

    found = _climb(negative, middle, REACH * width, middle, iterations)
    if np.any(start.like(found).noise > 1):
        # More noise than the output varies at all: a long first step has ended where an output
        # is given up. So first the poses' kernel and the noise, then the rest.
        tasks_only = np.arange(len(middle)) < len(_lower(start.root)[0])
        found = _climb(negative, middle, np.where(tasks_only, 0.0, REACH * width), middle, 20)
        found = _climb(negative, middle, REACH * width, found, iterations)
    h = start.like(found)
    return MultiTaskGP(tasks, h, solve(tasks, h), centre, scale)


def _climb(
    negative: Callable[[np.ndarray], tuple[float, np.ndarray]], middle: np.ndarray,
    reach: np.ndarray, start: np.ndarray, iterations: int,
) -> np.ndarray:  # fmt: skip
    # In units of the prior's sds: what is held fast (1e-6) would spoil the steps of all others.
    unit = np.where(reach > 0, reach / REACH, 1.0)

    def scaled(z: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = negative(start + unit * z)
        return value, slope * unit

    lower, upper = (middle - reach - start) / unit, (middle + reach - start) / unit
    done = minimize(
        scaled, np.zeros_like(start), jac=True, method="L-BFGS-B",
        bounds=list(zip(lower, upper, strict=True)),
        options={"maxiter": iterations, "ftol": FTOL},
    )  # fmt: skip
    return start + unit * done.x


def log_density(tasks: Tasks, h: Hyperparameters) -> tuple[float, np.ndarray]:
    """Log marginal likelihood and its slope in `h.flat()`."""
    solved = solve(tasks, h)
    slope_root = (solved.slope_b + solved.slope_b.T) @ h.root
    slope_theta = np.array(pull(tasks.kernel, h.theta, tasks.x, solved.slope_k))
    return solved.value, np.concatenate(
        [slope_root[_lower(h.root)], solved.slope_log_noise, slope_theta]
    )


def solve(tasks: Tasks, h: Hyperparameters) -> Solved:
    k = parse(tasks.kernel, tasks.x.shape[1]).covariance(np, h.theta, tasks.x, tasks.x)
    k = k + RELATIVE_JITTER * np.mean(np.diag(k)) * np.eye(len(k))
    return (solve_kronecker if tasks.complete else solve_dense)(
        tasks.y, k, h.task_covariance, h.noise
    )


@jax_setup.compiled(static_argnums=0)
def pull(kernel: str, theta: Array, x: Array, slope: Array) -> Array:
    """Slope in θ from the slope (n, n) in the kernel's matrix."""
    k = parse(kernel, x.shape[1])
    return jax.grad(lambda t: jnp.sum(k.covariance(jnp, t, x, x) * slope))(theta)


def first_guess(tasks: Tasks) -> Hyperparameters:
    # Over the poses that two outputs share; made positive definite after that.
    filled, known = np.nan_to_num(tasks.y), np.isfinite(tasks.y).astype(float)
    t = filled.shape[1]
    values, vectors = np.linalg.eigh(filled.T @ filled / np.maximum(known.T @ known, 1.0))
    covariance = (vectors * np.maximum(values, 0.0)) @ vectors.T + 0.1 * np.eye(t)
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
