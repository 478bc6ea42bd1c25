"""Average over hyperparameters by importance sampling.

Samples from the prior, then from Gaussians around what the data favour, weighted by
prior × likelihood over the mixture they came from (deterministic mixture weights, Owen & Zhou
2000), then resampled to a few of equal weight. Everything is in units of the prior, N(0, 1).
"""

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from planner import content_hash
from planner.dataset.store import user_store
from planner.inference.log_space import log_sum, shares

MOST_SHARED = 0.95  # points of one output are too few to stand for a narrower one
SHARED_NODES = np.linspace(-4.0, 4.0, 33)  # of what outputs share, in its own sd
PROPOSAL_INFLATION = 1.4  # of the second stage's spread, so that tails are sampled too
LATER_INFLATION = 1.1  # of a later stage's: fewer points favour a wider spread already

Gaussians = tuple[np.ndarray, np.ndarray]  # centre (m, p) and root (m, p, p)
Score = Callable[[np.ndarray], np.ndarray]  # of points (m, s, p): (m, s)


@cache
def normal_points(samples: int, dimensions: int, seed: int) -> np.ndarray:
    """Quasi-random points (samples, dimensions) of N(0, 1): a scrambled Sobol sequence.

    They are kept on disk: scipy.stats, which makes them, takes most of a second to import.
    """
    libraries = content_hash.libraries("numpy", "scipy")
    asked = f"{samples} {dimensions} {seed}"
    key = content_hash.digest("normal points", content_hash.program("surrogate"), libraries, asked)
    points = user_store().result(key, np.ndarray, lambda: _normal_points(samples, dimensions, seed))
    points.flags.writeable = False  # all who ask get the same array
    return points


def _normal_points(samples: int, dimensions: int, seed: int) -> np.ndarray:
    from scipy.special import ndtri
    from scipy.stats import qmc

    sobol = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
    unit = sobol.random_base2(int(np.ceil(np.log2(samples))))[:samples]
    return ndtri(np.clip(unit, 1e-6, 1 - 1e-6))


def sample(
    score: Score, normal: list[np.ndarray], outputs: int, kept: int,
    start: Gaussians | None = None, shared: np.ndarray | None = None,
    later: Sequence[tuple[Score, int]] = (),
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """`kept` points z (m, kept, p) of equal weight from N(0, 1) × exp(score); log of its integral.

    The first set (s, p) of `normal` are points from the prior, each further one is moved to a
    Gaussian around what weighs most so far; `start` is the first of these Gaussians, if there is
    one. `shared` (m,) is the share of the prior variance of the second coordinate that all outputs
    have in common, so that each also learns from the others (the integral stays its own). With
    `later` stages, each a score that replaces this one and for how many points, each takes a set
    more and looks only around what the one before favours. LinAlgError if an output has no finite
    score.
    """
    first = len(normal) - len(later)
    points, log_weight = _from_prior(score, normal[:first], outputs, start)
    for (narrower, count), base in zip(later, normal[first:], strict=True):
        centre, root = _around(points, shares(log_weight, axis=1))
        wide = LATER_INFLATION * root
        points = centre[:, None, :] + base[:count] @ np.swapaxes(wide, 1, 2)
        like = narrower(points)
        if not np.isfinite(like).any(axis=1).all():
            raise np.linalg.LinAlgError
        log_weight = like + _log_normal(points) - _log_gaussian(points, centre, wide)
    evidence = log_sum(log_weight, axis=1) - np.log(points.shape[1])
    if shared is not None and shared.any():
        log_weight = log_weight + _learned_together(points[:, :, 1], log_weight, shared)
    return _resampled(points, shares(log_weight, axis=1), kept), evidence


def _from_prior(
    score: Score, normal: list[np.ndarray], outputs: int, start: Gaussians | None
) -> tuple[np.ndarray, np.ndarray]:
    """Points (m, s, p) of all sets, and their log weights (m, s)."""
    points = np.broadcast_to(normal[0], (outputs, *normal[0].shape))
    like = score(points)
    if not np.isfinite(like).any(axis=1).all():
        raise np.linalg.LinAlgError
    proposals: list[Gaussians] = []
    for t, base in enumerate(normal[1:]):
        if t == 0 and start is not None:
            centre, root = start
        else:
            centre, root = _around(points, shares(_log_weight(points, like, proposals), axis=1))
        proposals.append((centre, PROPOSAL_INFLATION * root))
        moved = centre[:, None, :] + PROPOSAL_INFLATION * base @ np.swapaxes(root, 1, 2)
        points = np.concatenate([points, moved], axis=1)
        like = np.concatenate([like, score(moved)], axis=1)
    return points, _log_weight(points, like, proposals)


def _learned_together(z: np.ndarray, log_weight: np.ndarray, shared: np.ndarray) -> np.ndarray:
    """What the other outputs add to the log weights (m, s) of z (m, s).

    z_k = √shared_k·μ + √(1 − shared_k)·ε_k: μ is integrated out on a grid, each output's evidence
    given μ being what its points say, weighed anew.
    """
    most = np.minimum(shared, MOST_SHARED)[:, None, None]
    apart = z[:, :, None] - np.sqrt(most) * SHARED_NODES
    given = -0.5 * (apart**2 / (1 - most) + np.log(1 - most)) + 0.5 * z[:, :, None] ** 2
    evidence = log_sum(log_weight[:, :, None] + given, axis=1)  # (m, nodes)
    others = evidence.sum(axis=0) - evidence - 0.5 * SHARED_NODES**2
    return log_sum(given + others[:, None, :], axis=2)


def _log_weight(points: np.ndarray, like: np.ndarray, proposals: list[Gaussians]) -> np.ndarray:
    """(m, s) of points (m, s, p) from equally many of N(0, 1) and of every proposal."""
    densities = [_log_normal(points), *(_log_gaussian(points, *g) for g in proposals)]
    return like + densities[0] - log_sum(np.array(densities), axis=0) + np.log(len(densities))


def _resampled(points: np.ndarray, weight: np.ndarray, kept: int) -> np.ndarray:
    # Every 16th point of a Sobol sequence is not spread evenly; in the order of the steepness of
    # δ, on which predictions away from the data hang, every 16th is.
    steepness = points[:, :, 0] - np.sum(points[:, :, 2:], axis=2) / max(points.shape[2] - 2, 1)
    order = np.argsort(steepness, axis=1)
    edges = np.cumsum(np.take_along_axis(weight, order, axis=1), axis=1)
    wanted = (np.arange(kept) + 0.5) / kept
    picks = [np.searchsorted(e, wanted * e[-1]) for e in edges]
    chosen = np.take_along_axis(order, np.minimum(picks, points.shape[1] - 1), axis=1)
    return np.take_along_axis(points, chosen[:, :, None], axis=1)


def _around(points: np.ndarray, weight: np.ndarray) -> Gaussians:
    """Gaussians like the weighted points (m, s, p)."""
    p = points.shape[2]
    centre = np.einsum("ms,msp->mp", weight, points)
    apart = points - centre[:, None, :]
    # With few effective samples their spread says little; the prior's own variance is mixed in.
    effective = 1 / np.sum(weight**2, axis=1)
    share = (1 / (1 + effective / p))[:, None, None]
    spread = np.swapaxes(apart * weight[:, :, None], 1, 2) @ apart * (1 - share)
    return centre, np.linalg.cholesky(spread + (0.25 * share + 1e-6) * np.eye(p))


def _log_normal(z: np.ndarray) -> np.ndarray:
    return -0.5 * np.sum(z**2, axis=-1)


def _log_gaussian(points: np.ndarray, centre: np.ndarray, root: np.ndarray) -> np.ndarray:
    white = (points - centre[:, None, :]) @ np.swapaxes(np.linalg.inv(root), 1, 2)
    sizes = np.diagonal(root, axis1=1, axis2=2)
    return _log_normal(white) - np.sum(np.log(sizes), axis=1)[:, None]
