"""Comparing shapes: MAC, how complex they are, and the real modes behind them."""

from collections.abc import Callable, Iterable
from typing import TypeVar

import numpy as np

from planner.frf.metrics import unit_and_length
from planner.inference.assignment import least_cost

Item = TypeVar("Item")


def mac(a: np.ndarray, b: np.ndarray) -> float:
    """Modal assurance criterion |aᴴb|²/(aᴴa·bᴴb) of two shapes (n,), complex; in [0, 1]."""
    return float(mac_matrix(np.asarray(a)[None], np.asarray(b)[None])[0, 0])


def mac_matrix(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """MAC of every shape in a (k, n) with every one in b (l, n); 0 where a shape is zero."""
    unit_a, unit_b = (unit_and_length(np.asarray(shapes))[0] for shapes in (a, b))
    return np.clip(np.abs(unit_a.conj() @ unit_b.T) ** 2, 0.0, 1.0)


def phase_collinearity(shape: np.ndarray) -> float:
    """Modal phase collinearity (MPC) of a shape (n,), in [0, 1]; 1: all points move in phase.

    The share of variance along the main axis of the points in the complex plane (Pappa et al.,
    AIAA J. 31, 1993), which is that of the eigenvalues of their scatter.
    """
    real, imag = np.real(shape), np.imag(shape)
    xx, yy, xy = real @ real, imag @ imag, real @ imag
    total = xx + yy
    return float(((xx - yy) ** 2 + 4 * xy**2) / total**2) if total > 0 else 0.0


def phase_deviation_deg(shape: np.ndarray) -> float:
    """Mean phase deviation (MPD) of a shape (n,) in degrees, weighted by amplitude: 0 is real.

    Angles between each point and the main axis (Reynders, Houbrechts & De Roeck, Mech. Syst.
    Signal Process. 29, 2012).
    """
    size = np.abs(shape)
    if not size.any():
        return 0.0
    axis = np.linalg.svd(np.stack([np.real(shape), np.imag(shape)], axis=1))[2][0]
    along = np.abs(np.real(shape) * axis[0] + np.imag(shape) * axis[1])
    angle = np.arccos(np.clip(along / np.maximum(size, 1e-300), 0.0, 1.0))
    return float(np.rad2deg(size @ angle / np.sum(size)))


def grouped(items: Iterable[Item], together: Callable[[Item, Item], bool]) -> list[list[Item]]:
    """Items in their order, in groups in which each goes `together` with the one before it."""
    groups: list[list[Item]] = []
    for item in items:
        if groups and together(groups[-1][-1], item):
            groups[-1].append(item)
        else:
            groups.append([item])
    return groups


def real_normal_modes(poles: np.ndarray, shapes: np.ndarray) -> np.ndarray:
    """Real shapes (n, m) of complex modes, in their order.

    poles (m,) in rad/s, shapes (n, m), n ≥ m. In the space of the m shapes, M⁻¹K and M⁻¹C are
    those real matrices that have these poles and shapes (Ibrahim, AIAA J. 21, 1983); the normal
    modes are the eigenvectors of M⁻¹K. Each is as large as the complex shape that it replaces,
    where that has been turned as real as can be. With fewer points than modes the shapes' real
    parts are given.
    """
    turned = shapes * np.exp(-0.5j * np.angle(np.sum(shapes**2, axis=0)))
    points, count = shapes.shape
    if points < count:
        return turned.real
    basis = np.linalg.svd(np.hstack([turned.real, turned.imag]), full_matrices=False)[0][:, :count]
    inside = basis.T @ turned
    both = np.hstack([inside, inside.conj()])
    values = np.concatenate([poles, poles.conj()])
    state = np.vstack([both, both * values])
    system = -np.linalg.solve(state.T, (both * values**2).T).T
    square, vectors = np.linalg.eig(system[:, :count].real)
    normal = (basis @ vectors).real
    likeness = np.abs(turned.conj().T @ unit_and_length(normal.T)[0].T)
    real = turned.real.copy()
    for k, best in zip(*least_cost(-likeness), strict=True):
        if square[best].real > 0 and np.linalg.norm(normal[:, best]) > 0:
            scale = normal[:, best] @ turned[:, k].real / (normal[:, best] @ normal[:, best])
            real[:, k] = scale * normal[:, best]
    return real
