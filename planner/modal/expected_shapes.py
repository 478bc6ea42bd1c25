"""Shapes that modes are expected to have at a pose, from a guide and the poses around."""

import numpy as np

NEIGHBOURS, GUIDE_WEIGHT = 6, 0.5  # shapes that are compared; the guide's weight among them


def mixture(
    shape: np.ndarray, certain: np.ndarray, guide: np.ndarray, x: np.ndarray, length: float
) -> np.ndarray:
    """Expected shapes (n, k, 3, 3): the guide's and those of the nearest poses, as Σ w s sᴴ.

    Args:
        shape: Unit shapes (n, k, 3) of the modes that carry a label; NaN where none does.
        certain: Probability (n, k) that they carry it rightly.
        guide: The guide's shapes (n, k, 3).
        x: Poses (n, d), in coordinates scaled to the workspace.
        length: Distance, per √d, over which shapes stay alike.
    """
    n = len(certain)
    size = np.linalg.norm(x[:, None] - x[None], axis=2) / max(1, x.shape[1]) ** 0.5
    np.fill_diagonal(size, np.inf)
    near = np.argsort(size, axis=1, kind="stable")[:, : min(NEIGHBOURS, n - 1)]  # (n, neighbours)
    nearness = np.exp(-((np.take_along_axis(size, near, axis=1) / length) ** 2) / 2)
    filled = np.nan_to_num(guide)
    turn = _rotations(np.broadcast_to(filled[:, None], filled[near].shape), filled[near])
    known = np.isfinite(shape[near][..., 0])
    theirs = np.where(known, certain[near] * nearness[..., None], 0.0)
    turned = np.nan_to_num(shape[near]) @ np.swapaxes(turn, -1, -2)
    own = GUIDE_WEIGHT * np.isfinite(guide[..., 0])
    out = own[..., None, None] * _projector(filled)
    out = out + np.sum(theirs[..., None, None] * _projector(turned), axis=1)
    return out / np.maximum(own + np.sum(theirs, axis=1), 1e-12)[..., None, None]


def _projector(shape: np.ndarray) -> np.ndarray:
    """s sᴴ (…, 3, 3) of unit shapes (…, 3)."""
    size = np.linalg.norm(shape, axis=-1, keepdims=True)
    unit = np.divide(shape, size, out=np.zeros_like(shape), where=size > 0)
    return unit[..., :, None] * unit[..., None, :].conj()


def _rotations(here: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Orthogonal (…, 3, 3) that best carry the guide's shapes there (…, k, 3) to those here.

    Signs of shapes are arbitrary, so they are made to agree first (Schönemann 1966).
    """
    phase = np.sum(here.conj() * there, axis=-1)
    phase = np.where(np.abs(phase) > 1e-12, phase / np.maximum(np.abs(phase), 1e-12), 1.0)
    product = np.swapaxes(here * phase[..., None], -1, -2) @ there.conj()
    # A little of the identity decides directions in which no guided mode moves.
    left, _, right = np.linalg.svd(product.real + 1e-3 * np.eye(3))
    return left @ right
