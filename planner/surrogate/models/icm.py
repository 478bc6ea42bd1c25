"""One multi-task GP of all outputs at once: intrinsic coregionalisation of any number of tasks.

cov(f_a(x), f_b(x')) = B_ab k(x, x') (Bonilla et al. 2008; Lei et al. 2023, section 4.4.2) with
B = W Wᵀ + diag(κ), W of few columns (a low rank), and a noise per
task. Lei et al. train groups of three, for their direct Cholesky factor of n·m numbers costs
O(n³ m³); with every output observed at every pose K is B ⊗ K_x + D and two eigendecompositions do,
O(n³ + m³) (`multitask.solve_kronecker`). Hyperparameters: the most probable ones, begun at the
outputs' own covariance, poses' kernel and noises first.
`multitask` has B free, for groups of a kind.
"""

from dataclasses import dataclass

import numpy as np

from planner.inference.quasi_newton import maximise
from planner.surrogate.kernels import parse
from planner.surrogate.models.multitask import (
    LENGTH,
    NOISE,
    NOISE_SPREAD,
    RELATIVE_JITTER,
    KroneckerSolution,
    Normalised,
    normalised,
    pull,
    solve_kronecker,
)

RANK = 3  # columns of W: chosen on robots 1 and 2 of the study of Lei et al. 2023
OWN, OWN_SPREAD = 0.1, 1.5  # κ's square root over the output's sd: median, log-sd
WEIGHT_SD = 1.0  # of W's entries around those of the data's own covariance
LENGTH_LOG_SD = 0.5  # of k's scales; chosen on the same robots
REACH = 6.0  # sds of the prior beyond which nothing is looked for
FIRST_STEPS, STEPS = 40, 200
FTOL = 1e-6


@dataclass(frozen=True, eq=False)
class Coregionalisation:
    """W (m, r), log √κ (m,), log noise sds (m,), θ (p,) of the kernel over poses."""

    weights: np.ndarray
    log_own: np.ndarray
    log_noise: np.ndarray
    theta: np.ndarray

    @property
    def task_covariance(self) -> np.ndarray:
        """B (m, m)."""
        return self.weights @ self.weights.T + np.diag(np.exp(2 * self.log_own))

    def flat(self) -> np.ndarray:
        """As one vector."""
        return np.concatenate([self.weights.ravel(), self.log_own, self.log_noise, self.theta])

    def like(self, vector: np.ndarray) -> "Coregionalisation":
        """The ones in `vector`, shaped like these."""
        m, r = self.weights.shape
        split = np.split(vector, [m * r, m * r + m, m * r + 2 * m])
        return Coregionalisation(split[0].reshape(m, r), *split[1:])


@dataclass(frozen=True, eq=False)
class ICM:
    """Fitted; y = centre + scale·(…) per task."""

    data: Normalised
    kernel: str
    found: Coregionalisation
    solved: KroneckerSolution

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, m) of the noise-free outputs at x (q, d)."""
        kernel, theta = parse(self.kernel, x.shape[1]), self.found.theta
        cross = kernel.covariance(np, theta, x, self.data.x)
        b = self.found.task_covariance
        own = kernel.variance(np, theta, x)[:, None] * np.diag(b)[None, :]
        sd = np.sqrt(np.maximum(own - self.solved.explained(cross, b), 0.0))
        d = self.data
        return d.centre + d.scale * (cross @ self.solved.alpha @ b), d.scale * sd


def fit_icm(x: np.ndarray, y: np.ndarray, kernel: str = "rbf", rank: int = RANK) -> ICM:
    """Fit y (n, m) at x (n, d) scaled to about [0, 1]; InputError where a value is missing."""
    data = normalised(x, y)
    guess = _guess(data, kernel, min(rank, y.shape[1]))
    middle, width = guess.flat(), _prior_sds(guess)

    def posterior(z: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = log_density(data, kernel, guess.like(middle + width * z))
        return value - 0.5 * float(z @ z), width * slope - z

    others = np.arange(len(middle)) >= guess.weights.size + guess.log_own.size
    z = np.zeros(len(middle))
    for free, steps in ((others, FIRST_STEPS), (np.ones(len(z)), STEPS)):
        z = maximise(posterior, [z], -REACH * free + z * (1 - free), REACH * free + z * (1 - free),
                     steps, FTOL).x  # fmt: skip
    found = guess.like(middle + width * z)
    return ICM(data, kernel, found, solve(data, kernel, found))


def log_density(data: Normalised, kernel: str, h: Coregionalisation) -> tuple[float, np.ndarray]:
    """Log marginal likelihood of the normalised outputs, and its slope in `h.flat()`."""
    solved = solve(data, kernel, h)
    slope_b = solved.slope_b + solved.slope_b.T
    slope_own = 2 * np.diag(solved.slope_b) * np.exp(2 * h.log_own)
    slope_theta = np.array(pull(kernel, h.theta, data.x, solved.slope_k))
    return solved.value, np.concatenate(
        [(slope_b @ h.weights).ravel(), slope_own, solved.slope_log_noise, slope_theta]
    )


def solve(data: Normalised, kernel: str, h: Coregionalisation) -> KroneckerSolution:
    """K⁻¹y and all slopes, by Kronecker's structure."""
    k = parse(kernel, data.x.shape[1]).covariance(np, h.theta, data.x, data.x)
    k = k + RELATIVE_JITTER * np.mean(np.diag(k)) * np.eye(len(k))
    return solve_kronecker(data.y, k, h.task_covariance, np.exp(2 * h.log_noise))


def _guess(data: Normalised, kernel: str, rank: int) -> Coregionalisation:
    """W is the first principal components of the outputs."""
    n, m = data.y.shape
    values, vectors = np.linalg.eigh(data.y.T @ data.y / n)
    weights = vectors[:, ::-1][:, :rank] * np.sqrt(np.maximum(values[::-1][:rank], 0.0))
    theta, _ = parse(kernel, data.x.shape[1]).prior(1.0, NOISE, LENGTH, 0.0, 1.0)
    return Coregionalisation(weights, np.full(m, np.log(OWN)), np.full(m, np.log(NOISE)), theta)


def _prior_sds(h: Coregionalisation) -> np.ndarray:
    """Prior sds of `h.flat()`; k's amplitude and nugget stay, for B and D hold them."""
    theta = np.full(len(h.theta), LENGTH_LOG_SD)
    theta[:2] = 1e-6
    return Coregionalisation(
        np.full_like(h.weights, WEIGHT_SD), np.full_like(h.log_own, OWN_SPREAD),
        np.full_like(h.log_noise, NOISE_SPREAD), theta,
    ).flat()  # fmt: skip
