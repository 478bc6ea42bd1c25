"""How much measuring a candidate lowers the variance over a target, in closed form.

Measuring at c lowers the GP's variance at u by cov(u, c)²/(var(c) + noise) (Sacks et al. 1989; Cohn
1996). The posterior covariance is a kernel of x plus an inner product of few features (the
simulation's slope and bias, minus what was measured and what is planned), so that a loop
over blocks of candidates makes it, squares it and sums it without keeping it.

With covariance Σ = L Lᵀ of the simulation's parameters and Fisher information F of a hit, Σ becomes
L (I + G)⁻¹ Lᵀ, G = Lᵀ F L, in the linearised model (Fedorov 1972; Chaloner & Verdinelli 1995).
"""

import numpy as np

from planner.design.frequency_posterior import ALL_AXES, FrequencyOutputs, Poses, Target
from planner.design.squared_covariances import squared_covariances

POSES_PER_CHUNK = 64  # which bounds the memory taken

Axes = tuple[int, ...]
SUBSETS: tuple[Axes, ...] = ((0,), (1,), (2,), (0, 1), (0, 2), (1, 2), ALL_AXES)


def reduction(outputs: FrequencyOutputs, poses: Poses, target: Target) -> np.ndarray:
    """Expected reduction (n,) of the GP's variance over a target, weighted with its importance.

    Averaged over the hyperparameters, which are held.
    """
    return np.sum(reduction_by_label(outputs, poses, target)[0], axis=0)


def reduction_by_label(
    outputs: FrequencyOutputs, poses: Poses, target: Target
) -> tuple[np.ndarray, np.ndarray]:
    """The part of each label in it (k, n), and the variance of a measurement there (k, n)."""
    by_label = [_label(outputs, target, poses, k) for k in range(outputs.count)]
    return np.array([r for r, _ in by_label]), np.array([v for _, v in by_label])


def _label(
    outputs: FrequencyOutputs, target: Target, poses: Poses, k: int
) -> tuple[np.ndarray, np.ndarray]:
    """Reduction (n,) by label k and the variance (n,) of measuring it, mean over the samples."""
    weight = target.importance[:, k]
    if not weight.any() or not len(poses):
        return np.zeros(len(poses)), np.ones(len(poses))
    a, va = _features(outputs, k, poses, sign=-1.0)
    b, _ = _features(outputs, k, target.poses, sign=1.0)
    scale, post = va + outputs.noise[k], outputs.posterior
    rest = target.poses.x, b, weight
    done = squared_covariances(post.kernel, post.theta[k], poses.x, a, *rest)
    return np.mean(done / scale, axis=0), np.mean(scale, axis=0)


def _features(
    outputs: FrequencyOutputs, k: int, poses: Poses, sign: float
) -> tuple[np.ndarray, np.ndarray]:
    """Features (s, n, r) whose inner product is the covariance but for δ's kernel; variance (s, n).

    `sign` −1 on one side takes off what is measured.
    """
    post = outputs.posterior
    low = poses.low[:, k]
    _, white = post.cross(k, poses.x, low)
    if len(outputs.planned):
        white = np.concatenate([white, outputs.whitened_planned(k, poses)], axis=1)
    own = post.own(k, poses.x, low) - np.sum(white**2, axis=1)
    slope = post.slope_sd[k][:, None] * low
    linear = np.stack([np.full(slope.shape, post.prior.bias_sd[k]), slope], axis=1)
    both = np.swapaxes(np.concatenate([linear, sign * white], axis=1), 1, 2)
    return both, np.maximum(own, 0.0)


def repeat_gain(outputs: FrequencyOutputs, variance: np.ndarray) -> np.ndarray:
    """Reduction (n,) of the mean variance over the workspace by repeating each measured pose.

    A measured value's own variance σ² halves; the nugget, which is the pose's own, stays. With
    K the covariance of what was measured, the variance at u falls by
    h (K⁻¹k_u)_i² / (1 − h (K⁻¹)_ii), h = σ²/2 (Sherman & Morrison 1950).

    `variance` (n, k) is that of each measured ln f, NaN where the mode was not found; rows are
    the posterior's training poses in their order.
    """
    post, target = outputs.posterior, outputs.workspace
    gain = np.zeros(len(variance))
    for k in range(outputs.count):
        known = post.known(k)
        if not len(known):
            continue
        _, white = post.cross(k, target.poses.x, target.poses.low[:, k])
        whiten = post.solved(k).whiten
        pulled = (np.swapaxes(whiten, 1, 2) @ white) ** 2 @ target.importance[:, k]
        half = np.nan_to_num(variance[known, k]) / 2
        left = 1 - half * np.sum(whiten**2, axis=1)
        gain[known] += np.mean(half * pulled / np.maximum(left, 1e-9), axis=0)
    return gain


def parameter_reduction(
    outputs: FrequencyOutputs, poses: Poses, target: Target, axes: Axes = ALL_AXES
) -> np.ndarray:
    """Reduction (n,) of a target's mean variance by hits along `axes` at n poses: tr A (Σ − Σ')."""
    if not poses.information.shape[-1]:
        return np.zeros(len(poses))
    matters = _matters(outputs, target)
    left = [np.einsum("ij,nji->n", matters, part) for part in _left(outputs, poses, axes)]
    return np.trace(matters) - np.concatenate([np.zeros(0), *left])


def parameter_information(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Expected information (n,) about the parameters in nat, hits along all axes.

    ½ log det(Σ Σ'⁻¹) of those combinations of parameters that move the workspace's frequencies.
    """
    values, vectors = np.linalg.eigh(_matters(outputs, outputs.workspace))
    moving = vectors[:, values > 1e-6 * np.sum(values)]  # make up the target's variance
    left = _left(outputs, poses, ALL_AXES)
    parts = [-0.5 * np.linalg.slogdet(moving.T @ part @ moving)[1] for part in left]
    return np.concatenate([np.zeros(0), *parts])


def _left(outputs: FrequencyOutputs, poses: Poses, axes: Axes) -> list[np.ndarray]:
    """(I + G)⁻¹ (n, p, p), part by part: what is left of each parameter's variance, units of L."""
    root = outputs.covariance_root
    starts = range(0, len(poses), POSES_PER_CHUNK)
    parts = (poses.information[i : i + POSES_PER_CHUNK, list(axes)].sum(axis=1) for i in starts)
    return [np.linalg.inv(np.eye(len(root)) + root.T @ part @ root) for part in parts]


def _matters(outputs: FrequencyOutputs, target: Target) -> np.ndarray:
    """Σ over target and labels of importance · (trust S L)ᵀ(trust S L), (p, p)."""
    slope = target.poses.slope @ outputs.covariance_root
    slope = slope * (outputs.trust * np.sqrt(target.importance))[..., None]
    flat = slope.reshape(-1, slope.shape[-1])
    return flat.T @ flat
