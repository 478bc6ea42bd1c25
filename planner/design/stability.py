"""Stability: the candidate after which the fewest answers are expected to be wrong.

An answer is whether a cut is stable at a pose of its path. Its margin, the logarithm of the
largest multiplier, is normal with a mean and an sd; measuring at a candidate lowers the variance by
as much as it lowers that of the frequencies on which the margin hangs, and moves the mean by what
goes. What is left then of the probability to answer wrongly is expected over that move (stepwise
uncertainty reduction: Bect et al., Statistics and Computing 22, 2012).
"""

from dataclasses import replace

import numpy as np

from planner.design.acquisitions import mixed
from planner.design.frequency_posterior import ALL_AXES, FrequencyOutputs, Margins, Poses

NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(15)
LEAST_SHARE = 1e-6  # of a variance: what measuring may leave of it


def stability(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Expected reduction (n,) of the number of wrong answers; where none is asked, as `mixed`."""
    margins = outputs.margins
    if margins is None:
        return mixed(outputs, poses)
    now = share_left(outputs)
    then = share_left(outputs, poses)
    return np.sum(_wrong(margins, now) - _wrong(margins, then), axis=-1)


def with_margins(outputs: FrequencyOutputs, margins: Margins) -> FrequencyOutputs:
    """The same, asked for margins whose `variance` is found here."""
    asked = replace(outputs, margins=margins)
    return replace(asked, margins=replace(margins, variance=_variances(asked, margins)[1]))


def share_left(outputs: FrequencyOutputs, poses: Poses | None = None) -> np.ndarray:
    """Share (u,) of each margin's first variance after what is planned; (n, u): and each pose."""
    margins = outputs.margins
    assert margins is not None
    after, now = _variances(outputs, margins, poses)
    left = (now if poses is None else after) / np.where(margins.variance > 0, margins.variance, 1.0)
    return np.clip(np.where(margins.variance > 0, left, 1.0), LEAST_SHARE, 1.0)


def _variances(
    outputs: FrequencyOutputs, margins: Margins, poses: Poses | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Of margins: (n, u) after measuring at each pose, and (u,) without; frequencies alone."""
    asked = margins.poses[:0] if poses is None else poses
    gains = margins.slope[..., None] * outputs.trust[:, None] * margins.poses.slope
    along = gains.sum(axis=1) @ outputs.covariance_root
    now = np.sum(along**2, axis=-1)
    after = np.tile(now, (len(asked), 1))
    if asked.information.shape[-1] and len(asked):
        root = outputs.covariance_root
        told = root.T @ asked.information[:, list(ALL_AXES)].sum(axis=1) @ root
        left = np.linalg.inv(np.eye(len(root)) + told)
        after = np.einsum("up,npq,uq->nu", along, left, along)
    for k in range(outputs.count):
        square = margins.slope[:, k] ** 2
        if not square.any():
            continue
        cross, own, there = outputs.covariance(k, asked if len(asked) else margins.poses[:1],
                                               margins.poses)  # fmt: skip
        now = now + square * np.mean(there, axis=0)
        if len(asked):
            told = cross**2 / (own + outputs.noise[k])[..., None]
            after = after + square * np.mean(there[:, None] - told, axis=0)
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
