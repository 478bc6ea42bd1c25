"""What an identification says where no simulation is quite right: springs differ from pose to pose.

What a simulation leaves out is taken up by its springs, at each pose in another way. Each spring is
taken to differ at each pose by a share τ (1 sd) from its own value, each damper by DAMPERS τ; τ is
inferred from how far the poses contradict each other. Were only noise to part them, five poses
would seem to tell five times as much as one, and sds would shrink below what is left out. (As in
meta-analysis, where studies differ by more than their errors: DerSimonian and Laird 1986.)
"""

import numpy as np

from planner.identification.left_open import PoseEquations
from planner.identification.parameters import Parametrisation
from planner.inference.block_diagonal import block_diagonal
from planner.inference.least_squares import inverse
from planner.inference.log_space import shares

# Sizes τ that are considered: their median before, and the sd of their logarithm. Chosen on
# generated cells: where a link bends they were 1e-3 to 3e-3, and once far more, which made
# frequencies two to three times as unsure as they were: that far nothing is linear.
SIZES = np.geomspace(1e-4, 1e-2, 10)
USUAL, SPREAD = 1e-3, 1.0
DAMPERS = 3.0


def pose_to_pose(each: PoseEquations, p: Parametrisation, temper: float) -> np.ndarray:
    """Covariance (D, D) of (θ, φ) about where noise alone would put them, over all sizes.

    Of what each pose says there, χ² counting 1/`temper`.
    """
    assert each.known is not None
    held, count = p.spread.shape
    kept = slice(len(each.known))
    prior = block_diagonal(each.known, np.eye(len(each.chain)))
    spread = np.zeros((each.gradient.shape[1], len(prior)))
    spread[:held, :count], spread[held:, count:] = p.spread, np.eye(len(prior) - count)
    gradient = each.gradient @ spread / temper
    normal = spread.T @ each.normal @ spread / temper
    multiples = np.array([1.0 if s.kind == "stiffness" else DAMPERS for s in p.parameters])
    found = [_at(size * multiples, gradient, normal, prior) for size in SIZES]
    before = -((np.log(SIZES / USUAL) / SPREAD) ** 2) / 2
    weight = shares(np.array([one[0] for one in found]) + before, axis=0)
    about = np.array([covariance + np.outer(step, step) for _, step, covariance in found])
    return np.einsum("s,sij->ij", weight, about)[kept, kept]


def _at(
    sd: np.ndarray, gradient: np.ndarray, normal: np.ndarray, prior: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """Log evidence, step to the best and covariance where springs differ by sd (P,)."""
    # Where the poses do not differ they are at their best: what is known before pulls against them.
    value, whole, pull = 0.0, prior.copy(), -gradient.sum(axis=0)
    count = len(sd)
    for g, n in zip(gradient, normal, strict=True):
        inner = np.eye(count) + sd[:, None] * n[:count, :count] * sd
        right = sd[:, None] * np.column_stack([g[:count], n[:count]])
        factor = np.linalg.cholesky(inner)
        onto = np.linalg.solve(factor, right)
        value += float(onto[:, 0] @ onto[:, 0]) / 2 - float(np.log(np.diagonal(factor)).sum())
        whole += n - onto[:, 1:].T @ onto[:, 1:]
        pull += g - onto[:, 1:].T @ onto[:, 0]
    covariance = inverse(whole)
    step = -covariance @ pull
    value -= float(pull @ step) / 2 + float(np.linalg.slogdet(whole)[1]) / 2
    return value, step, covariance
