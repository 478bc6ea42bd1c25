"""How much measuring a candidate lowers the variance over a target, in closed form.

Measuring at c lowers the variance at u by cov(u, c)²/(var(c) + noise) (Sacks et al. 1989; Cohn
1996). The posterior covariance is a kernel of x plus an inner product of few features (the
simulation's slope and bias, minus what was measured and what is planned), so that a loop over
blocks of candidates, compiled where they are many, makes it, squares it and sums it without
keeping it.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from planner.design.frequency_posterior import FrequencyOutputs, Poses, Target
from planner.design.squared_covariances import BLOCK_CANDIDATES, squared_covariances
from planner.inference.parallel import side_by_side

BLOCKS_PER_CALL = 64  # where there are many; calls of equal shape are compiled once
# Up to so many NumPy takes as long as what is compiled, and JAX half a second to import.
PLAIN_CANDIDATES = 1_000
MANY_CANDIDATES = 20_000  # from which all but the best are done in single precision
BEST_CANDIDATES = 1_000  # that are then done in double precision
FEATURE_MULTIPLE = 2  # the number of features is rounded up to a multiple of it: fewer compilations


def reduction(outputs: FrequencyOutputs, poses: Poses, target: Target) -> np.ndarray:
    """Expected reduction (n,) of the GP's variance over a target, weighted with its importance.

    Averaged over the hyperparameters, which are held.
    """
    return np.sum(reduction_by_label(outputs, poses, target)[0], axis=0)


def reduction_by_label(
    outputs: FrequencyOutputs, poses: Poses, target: Target
) -> tuple[np.ndarray, np.ndarray]:
    """The part of each label in it (k, n), and the variance of a measurement there (k, n).

    Of many candidates only the best are done in double precision: single precision errs by 1e-7 of
    the prior covariance, which ranks the others well enough.
    """
    labels, double = range(outputs.count), partial(_label, outputs, target, np.float64)
    if len(poses) <= MANY_CANDIDATES:
        return _both([double(poses, k) for k in labels])
    single = partial(_label, outputs, target, np.float32, poses)
    gained, variance = _both(side_by_side(single, labels))
    best = np.argpartition(np.sum(gained, axis=0), -BEST_CANDIDATES)[-BEST_CANDIDATES:]
    gained[:, best], _ = _both(side_by_side(partial(double, poses[best]), labels))
    return gained, variance


def _both(by_label: Sequence[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    return np.array([r for r, _ in by_label]), np.array([v for _, v in by_label])


def _label(
    outputs: FrequencyOutputs, target: Target, precision: type[np.floating], poses: Poses, k: int
) -> tuple[np.ndarray, np.ndarray]:
    """Reduction (n,) by label k and the variance (n,) of measuring it, mean over the samples."""
    weight = target.importance[:, k]
    if not weight.any() or not len(poses):
        return np.zeros(len(poses)), np.ones(len(poses))
    a, va = _features(outputs, k, poses, sign=-1.0)
    b, _ = _features(outputs, k, target.poses, sign=1.0)
    scale = va + outputs.noise[k]
    n, kernel = len(poses), outputs.posterior.kernel
    squared, step = squared_covariances, BLOCK_CANDIDATES
    if n > PLAIN_CANDIDATES:
        from planner.design.compiled_squared_covariances import compiled_squared_covariances

        squared = compiled_squared_covariances

        step *= BLOCKS_PER_CALL if n > 4 * BLOCK_CANDIDATES * BLOCKS_PER_CALL else 1
    rows = (_filled(poses.x, step), np.stack([_filled(one, step) for one in a]))
    x, a = (one.astype(precision) for one in rows)
    rest = (outputs.posterior.theta[k], target.poses.x, b, weight)
    thetas, xu, b, weight = (one.astype(precision) for one in rest)
    done = np.empty(a.shape[:2])
    for s, theta in enumerate(thetas):
        for i in range(0, len(x), step):
            part = slice(i, i + step)
            done[s, part] = squared(kernel, theta, x[part], a[s, part], xu, b[s], weight)
    return np.mean(done[:, :n] / scale, axis=0), np.mean(scale, axis=0)


def _features(
    outputs: FrequencyOutputs, k: int, poses: Poses, sign: float
) -> tuple[np.ndarray, np.ndarray]:
    """Features (s, n, r) whose inner product is the covariance but for δ's kernel; variance (s, n).

    `sign` −1 on one side takes off what is measured.
    """
    post = outputs.posterior
    low = poses.low[:, k]
    _, white = post._cross(k, poses.x, low)
    if len(outputs.planned):
        white = np.concatenate([white, outputs.whitened_planned(k, poses)], axis=1)
    own = post._own(k, poses.x, low) - np.sum(white**2, axis=1)
    slope = post.slope_sd[k][:, None] * low
    linear = np.stack([np.full(slope.shape, post.prior.bias_sd[k]), slope], axis=1)
    both = np.swapaxes(np.concatenate([linear, sign * white], axis=1), 1, 2)
    empty = np.zeros((*both.shape[:2], -both.shape[2] % FEATURE_MULTIPLE))
    return np.concatenate([both, empty], axis=2), np.maximum(own, 0.0)


def _filled(rows: np.ndarray, step: int) -> np.ndarray:
    """Rows up to a multiple of `step`, the last one repeated."""
    return np.concatenate([rows, np.repeat(rows[-1:], -len(rows) % step, axis=0)])
