"""Information that hits at a pose give about the simulation's parameters: D- and I-optimality.

With covariance Σ = L Lᵀ of the parameters and Fisher information F of a hit, Σ becomes
L (I + G)⁻¹ Lᵀ, G = Lᵀ F L, in the linearised model (Fedorov 1972; Chaloner & Verdinelli 1995).
"""

import numpy as np

from planner.design.frequency_posterior import ALL_AXES, FrequencyOutputs, Poses, Target

Axes = tuple[int, ...]
SUBSETS: tuple[Axes, ...] = ((0,), (1,), (2,), (0, 1), (0, 2), (1, 2), ALL_AXES)
POSES_PER_CHUNK = 64  # which bounds the memory taken


def parameter_information(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """I-optimal: reduction (n,) of the mean frequency variance that parameters leave, all axes."""
    return parameter_reduction(outputs, poses, outputs.workspace)


def d_information(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """D-optimal: expected information (n,) about the parameters in nat, hits along all axes.

    ½ log det(Σ Σ'⁻¹) of those combinations of parameters that move the workspace's frequencies.
    """
    moving = _moving(outputs, outputs.workspace)
    parts = []
    for i in range(0, len(poses), POSES_PER_CHUNK):
        left = _left(outputs, poses[slice(i, i + POSES_PER_CHUNK)], ALL_AXES)
        parts.append(-0.5 * np.linalg.slogdet(moving.T @ left @ moving)[1])
    return np.concatenate(parts) if parts else np.zeros(0)


def parameter_reduction(
    outputs: FrequencyOutputs, poses: Poses, target: Target, axes: Axes = ALL_AXES
) -> np.ndarray:
    """Reduction (n,) of a target's mean variance by hits along `axes` at n poses: tr A (Σ − Σ')."""
    if not poses.information.shape[-1] or not len(poses):
        return np.zeros(len(poses))
    matters = _matters(outputs, target)
    parts = []
    for i in range(0, len(poses), POSES_PER_CHUNK):
        left = _left(outputs, poses[slice(i, i + POSES_PER_CHUNK)], axes)
        parts.append(np.trace(matters) - np.einsum("ij,nji->n", matters, left))
    return np.concatenate(parts)


def _left(outputs: FrequencyOutputs, poses: Poses, axes: Axes) -> np.ndarray:
    """(I + G)⁻¹ (n, p, p): what is left of each parameter's variance, in units of L."""
    root = outputs.covariance_root
    gained = root.T @ poses.information[:, list(axes)].sum(axis=1) @ root
    return np.linalg.inv(np.eye(len(root)) + gained)


def _matters(outputs: FrequencyOutputs, target: Target) -> np.ndarray:
    """Σ over target and labels of importance · (trust S L)ᵀ(trust S L), (p, p)."""
    slope = target.poses.slope @ outputs.covariance_root
    slope = slope * (outputs.trust * np.sqrt(target.importance))[..., None]
    flat = slope.reshape(-1, slope.shape[-1])
    return flat.T @ flat


def _moving(outputs: FrequencyOutputs, target: Target) -> np.ndarray:
    """Orthonormal combinations (p, r) of parameters that make up the target's variance."""
    values, vectors = np.linalg.eigh(_matters(outputs, target))
    return vectors[:, values > 1e-6 * np.sum(values)]
