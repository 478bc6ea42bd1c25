"""Exact GP of one output over a complete grid, as of an FRF's lines by poses.

cov = k_a(a, a') k_b(b, b') + noise: two small eigendecompositions (Kronecker structure, Saatçi
2011, chapter 5) do what a Cholesky factor of ten thousand points could not. Hyperparameters: the
most probable ones, for thousands of points leave little doubt about them.
"""

from dataclasses import dataclass

import numpy as np

from planner.surrogate.kernels import parse
from planner.surrogate.models.fidelity_levels import spread
from planner.surrogate.models.multitask import KroneckerSolution, pull, solve_kronecker
from planner.surrogate.quasi_newton import maximise

NOISE, NOISE_SPREAD = 0.03, 2.0  # median sd of the noise over the output's, its log-sd
LENGTH, LENGTH_SPREAD = 0.3, 1.5  # of the scales, and of the amplitude's logarithm
SHORT = -1.5  # sds of the prior by which the second start's length scales are shorter
REACH = 5.0  # sds of the prior beyond which nothing is looked for
JITTER = 1e-9  # added to the covariances' diagonals


@dataclass(frozen=True, eq=False)
class GridGP:
    """Fitted, of y = centre + scale·(…); θ of both axes' kernels."""

    a: np.ndarray  # (n, 1)
    b: np.ndarray  # (t, 1)
    kernels: tuple[str, str]
    theta_a: np.ndarray
    theta_b: np.ndarray
    solved: KroneckerSolution
    centre: float
    scale: float
    log_evidence: float

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q,) of the noise-free output at x (q, 2) = (a, b)."""
        ka, kb = (parse(k, 1) for k in self.kernels)
        cross_a = ka.covariance(np, self.theta_a, x[:, :1], self.a)
        cross_b = kb.covariance(np, self.theta_b, x[:, 1:], self.b)
        mean = np.einsum("qi,it,qt->q", cross_a, self.solved.alpha, cross_b, optimize="optimal")
        assert self.solved.rotation is not None
        v, w, u = self.solved.rotation
        explained = np.einsum(
            "qi,it,qt->q", (cross_a @ v) ** 2, 1 / w, (cross_b @ u) ** 2, optimize="optimal"
        )
        own = ka.variance(np, self.theta_a, x[:, :1]) * kb.variance(np, self.theta_b, x[:, 1:])
        sd = np.sqrt(np.maximum(own - explained, 0.0))
        return self.centre + self.scale * mean, self.scale * sd


def fit_grid(
    a: np.ndarray, b: np.ndarray, y: np.ndarray, kernels: tuple[str, str] = ("rbf", "rbf")
) -> GridGP:
    """GP of y (n, t) over a (n,) by b (t,), each scaled to about [0, 1], without gaps."""
    a, b = a[:, None], b[:, None]
    centre, scale = float(np.mean(y)), spread(y.reshape(-1))
    y = (y - centre) / scale
    sizes = [parse(k, 1).size for k in kernels]
    priors = [parse(k, 1).prior(1.0, NOISE, LENGTH, LENGTH_SPREAD, LENGTH_SPREAD) for k in kernels]
    mean, width = (np.concatenate([p[i] for p in priors]) for i in (0, 1))
    width[1] = NOISE_SPREAD  # the nugget's place in θ_a holds the noise
    width[sizes[0] : sizes[0] + 2] = 1e-6  # θ_b's amplitude and nugget: θ_a's are enough

    def solve(theta: np.ndarray) -> tuple[KroneckerSolution, np.ndarray, np.ndarray]:
        theta_a, theta_b = np.split(theta, [sizes[0]])
        ka, kb = (
            parse(k, 1).covariance(np, t, p, p) + JITTER * np.eye(len(p))
            for k, t, p in zip(kernels, (theta_a, theta_b), (a, b), strict=True)
        )
        noise = np.full(len(b), np.exp(2 * theta_a[1]))
        return solve_kronecker(y, ka, kb, noise), theta_a, theta_b

    def posterior(z: np.ndarray) -> tuple[float, np.ndarray]:
        solved, theta_a, theta_b = solve(mean + width * z)
        slope_a = np.array(pull(kernels[0], theta_a, a, solved.slope_k))
        slope_b = np.array(pull(kernels[1], theta_b, b, solved.slope_b))
        slope_a[1] += np.sum(solved.slope_log_noise)
        slope = np.concatenate([slope_a, slope_b]) * width
        return solved.value - 0.5 * float(z @ z), slope - z

    starts = np.zeros((2, len(mean)))
    starts[1, 2 : sizes[0]] = starts[1, sizes[0] + 2 :] = SHORT
    best = maximise(posterior, list(starts), -REACH, REACH).x
    solved, theta_a, theta_b = solve(mean + width * best)
    evidence = solved.value - y.size * np.log(scale)
    return GridGP(a, b, kernels, theta_a, theta_b, solved, centre, scale, evidence)
