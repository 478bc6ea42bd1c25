"""Acquisitions: what measuring at each of n candidates is worth, all axes hit there.

Measuring at c lowers the GP's variance at u by cov(u, c)²/(var(c) + noise) (Sacks et al. 1989; Cohn
1996). The posterior covariance is a kernel of x plus an inner product of few features (the
simulation's slope and bias, minus what was measured and what is planned), so that a loop
over blocks of candidates makes it, squares it and sums it without keeping it.

With covariance Σ = L Lᵀ of the simulation's parameters and Fisher information F of a hit, Σ becomes
L (I + G)⁻¹ Lᵀ, G = Lᵀ F L, in the linearised model (Fedorov 1972; Chaloner & Verdinelli 1995).
"""

from dataclasses import replace

import numpy as np

from planner.design.frequency_posterior import ALL_AXES, FrequencyOutputs, Margins, Poses, Target
from planner.surrogate.kernels import parse

COINCIDENCE = 1e-6  # distance in model coordinates below which two poses are the same
POSES_PER_CHUNK = 64  # which bounds the memory taken
BLOCK = 128  # candidates at a time: their covariances with the target stay in the cache
NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(15)
LEAST_SHARE = 1e-6  # of a variance: what measuring may leave of it

Axes = tuple[int, ...]
SUBSETS: tuple[Axes, ...] = ((0,), (1,), (2,), (0, 1), (0, 2), (1, 2), ALL_AXES)


def variance(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Weighted mean relative variance (n,) of the natural frequencies: what is known least."""
    each = [outputs.variance(k, poses) * w for k, w in enumerate(outputs.weights)]
    return np.sum(each, axis=0)


def integrated_variance(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Expected reduction (n,) of the mean relative frequency variance over the workspace.

    What the simulation's parameters leave open is not looked at; `mixed` does that too.
    """
    return reduction(outputs, poses, outputs.workspace)


def parameter_variance(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """I-optimal: reduction (n,) of the mean frequency variance that parameters leave."""
    return parameter_reduction(outputs, poses, outputs.workspace)


def mixed(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Both together (n,), for a simulation that learns and whose physics may be incomplete.

    Both are reductions of the same mean variance over the workspace, so that they add up.
    """
    return integrated_variance(outputs, poses) + parameter_variance(outputs, poses)


def goal(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """`mixed` (n,) over what matters most: a path of poses, labels with weights of their own, or
    modes within a band, as `outputs.goal` says.
    """
    target = outputs.goal
    return reduction(outputs, poses, target) + parameter_reduction(outputs, poses, target)


def mutual_information(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Information (n,) in nat about the workspace's frequencies, labels weighed.

    ½ log of the variance of a measurement at c given what is measured, over that given all other
    poses of the workspace as well (Krause, Singh & Guestrin 2008, eq. 7). Unlike variance it is not
    drawn to the edge, where much is unknown that matters nowhere else.
    """
    score = np.zeros(len(poses))
    at = outputs.workspace.poses
    distance = np.linalg.norm(poses.x[:, None] - at.x[None], axis=2)
    same = np.argmin(distance, axis=1)
    coincides = np.min(distance, axis=1) < COINCIDENCE
    for k in np.flatnonzero(outputs.weights).tolist():
        between, _, _ = outputs.covariance(k, at, at)
        inverse = np.linalg.inv(between + outputs.noise[k] * np.eye(len(at)))
        cross, own, _ = outputs.covariance(k, poses, at)
        before = own + outputs.noise[k]
        apart = before - np.einsum("scu,scu->sc", cross @ inverse, cross)
        # A candidate that stands for the workspace itself is no part of its rest.
        alone = 1 / np.diagonal(inverse, axis1=1, axis2=2)[:, same]
        after = np.where(coincides, alone, apart)
        score += outputs.weights[k] * np.mean(0.5 * np.log(before / after), axis=0)
    return score


def parameter_information(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Expected information (n,) about the parameters in nat, hits along all axes.

    ½ log det(Σ Σ'⁻¹) of those combinations of parameters that move the workspace's frequencies.
    """
    values, vectors = np.linalg.eigh(_matters(outputs, outputs.workspace))
    moving = vectors[:, values > 1e-6 * np.sum(values)]  # make up the target's variance
    left = moving.T @ _left(outputs, poses, ALL_AXES) @ moving
    return -0.5 * np.linalg.slogdet(left)[1]


def stability(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Expected reduction (n,) of the number of wrong answers; where none is asked, as `mixed`.

    An answer is whether a cut is stable at a pose of its path. Its margin, the logarithm of the
    largest multiplier, is normal; measuring at a candidate lowers its variance by as much as it
    lowers that of the frequencies on which it hangs, and moves its mean by what goes. What is left
    of the probability to answer wrongly is expected over that move (stepwise uncertainty reduction:
    Bect et al., Statistics and Computing 22, 2012).
    """
    margins = outputs.margins
    if margins is None:
        return mixed(outputs, poses)
    now = share_left(outputs)
    then = share_left(outputs, poses)
    return np.sum(_wrong(margins, now) - _wrong(margins, then), axis=-1)


def reduction(outputs: FrequencyOutputs, poses: Poses, target: Target) -> np.ndarray:
    """Expected reduction (n,) of the GP's variance over a target, weighted with its importance.

    Averaged over the hyperparameters, which are held.
    """
    return np.sum(reduction_by_label(outputs, poses, target)[0], axis=0)


def reduction_by_label(
    outputs: FrequencyOutputs, poses: Poses, target: Target
) -> tuple[np.ndarray, np.ndarray]:
    """The part of each label in it (k, n), and the variance of a measurement there (k, n)."""
    shape, importance, where = (outputs.count, len(poses)), target.importance, target.poses
    reduced, variance = np.zeros(shape), np.ones(shape)
    for k in np.flatnonzero(importance.any(axis=0)).tolist() if len(poses) else ():
        post = outputs.posteriors[k]
        a, va = _features(outputs, k, poses, sign=-1.0)
        b, _ = _features(outputs, k, where, sign=1.0)
        # By NumPy: a proposal is one pass, over before JAX is imported and has compiled it.
        x, at = post.seen(poses.x, poses.low[:, k]), post.seen(where.x, where.low[:, k])
        delta, squared = parse(post.kernel, x.shape[1]), np.empty(a.shape[:2])
        for start in range(0, len(poses), BLOCK):
            some = slice(start, start + BLOCK)
            for theta, own, there, out in zip(post.theta, a, b, squared, strict=True):
                cross = delta.covariance(np, theta, x[some], at)
                out[some] = (cross + own[some] @ there.T) ** 2 @ importance[:, k]
        scale = va + outputs.noise[k]
        reduced[k], variance[k] = np.mean(squared / scale, axis=0), np.mean(scale, axis=0)
    return reduced, variance


def _features(
    outputs: FrequencyOutputs, k: int, poses: Poses, sign: float
) -> tuple[np.ndarray, np.ndarray]:
    """Features (s, n, r) whose inner product is the covariance but for δ's kernel; variance (s, n).

    `sign` −1 on one side takes off what is measured.
    """
    post, low = outputs.posteriors[k], poses.low[:, k]
    _, white = post.cross(poses.x, low)
    if len(outputs.planned):
        white = np.concatenate([white, outputs.whitened_planned(k, poses)], axis=1)
    own = post.own(poses.x, low) - np.sum(white**2, axis=1)
    slope = post.slope_sd[:, None] * low
    linear = np.stack([np.full(slope.shape, post.bias_sd), slope], axis=1)
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
    target, gain = outputs.workspace, np.zeros(len(variance))
    for k, post in enumerate(outputs.posteriors):
        known = post.rows
        if not len(known):
            continue
        _, white = post.cross(target.poses.x, target.poses.low[:, k])
        whiten = post.solved.whiten
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
    return np.trace(matters) - np.einsum("ij,nji->n", matters, _left(outputs, poses, axes))


def _left(outputs: FrequencyOutputs, poses: Poses, axes: Axes) -> np.ndarray:
    """(I + G)⁻¹ (n, p, p): what is left of each parameter's variance, in units of L."""
    root = outputs.covariance_root
    starts = range(0, len(poses), POSES_PER_CHUNK)
    parts = (poses.information[i : i + POSES_PER_CHUNK, list(axes)].sum(axis=1) for i in starts)
    left = (np.linalg.inv(np.eye(len(root)) + root.T @ part @ root) for part in parts)
    return np.concatenate([np.zeros((0, *root.shape)), *left])


def _matters(outputs: FrequencyOutputs, target: Target) -> np.ndarray:
    """Σ over target and labels of importance · (trust S L)ᵀ(trust S L), (p, p)."""
    slope = target.poses.slope @ outputs.covariance_root
    slope = slope * (outputs.trust * np.sqrt(target.importance))[..., None]
    flat = slope.reshape(-1, slope.shape[-1])
    return flat.T @ flat


def with_margins(outputs: FrequencyOutputs, margins: Margins) -> FrequencyOutputs:
    """The same, asked for margins whose `variance` is found here."""
    asked = replace(outputs, margins=margins)
    now = _variances(asked, margins, margins.poses[:0])[1]
    return replace(asked, margins=replace(margins, variance=now))


def share_left(outputs: FrequencyOutputs, poses: Poses | None = None) -> np.ndarray:
    """Share (u,) of each margin's first variance after what is planned; (n, u): and each pose."""
    margins = outputs.margins
    assert margins is not None
    asked = margins.poses[:0] if poses is None else poses
    after, now = _variances(outputs, margins, asked)
    left = (now if poses is None else after) / np.where(margins.variance > 0, margins.variance, 1.0)
    return np.clip(np.where(margins.variance > 0, left, 1.0), LEAST_SHARE, 1.0)


def _variances(
    outputs: FrequencyOutputs, margins: Margins, poses: Poses
) -> tuple[np.ndarray, np.ndarray]:
    """Of margins: (n, u) after measuring at each pose, and (u,) without; frequencies alone."""
    gains = margins.slope[..., None] * outputs.trust[:, None] * margins.poses.slope
    along = gains.sum(axis=1) @ outputs.covariance_root
    now = np.sum(along**2, axis=-1)
    after = np.tile(now, (len(poses), 1))
    if poses.information.shape[-1]:
        after = np.einsum("up,npq,uq->nu", along, _left(outputs, poses, ALL_AXES), along)
    for k in np.flatnonzero(margins.slope.any(axis=0)).tolist():
        square = margins.slope[:, k] ** 2
        cross, own, variance = outputs.covariance(k, poses, margins.poses)
        told = cross**2 / (own + outputs.noise[k])[..., None]
        now = now + square * np.mean(variance, axis=0)
        after = after + square * np.mean(variance[:, None] - told, axis=0)
    return after, now


def _wrong(margins: Margins, left: np.ndarray) -> np.ndarray:
    """(…, u) expected probability to answer wrongly once a share of the first variance is left.

    The mean moves until then by what goes.
    """
    moved = margins.sd * np.sqrt(1 - left)
    at = margins.margin + NODES.reshape(-1, *([1] * moved.ndim)) * moved
    from scipy.special import ndtr  # 0.1 s, which other acquisitions do not need

    wrong = ndtr(-np.abs(at) / (margins.sd * np.sqrt(left)))
    return np.tensordot(WEIGHTS / WEIGHTS.sum(), wrong, axes=1)
