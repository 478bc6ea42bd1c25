"""FRFs of many poses with their derivatives with respect to springs and inertias.

At s = iω (or iω + rate under an exponential window) the receptance is J_s Z⁻¹ J_hᵀ with
Z = K(1+iη) + s C + s² M. Z is symmetric, so that with X = Z⁻¹ Jᵀ any change dZ changes it by
−X_sᵀ dZ X_h: two solutions serve all parameters.
"""

from dataclasses import dataclass

import numpy as np

from planner.physics.simulation import Elasticity
from planner.robot.elastic import Matrices


@dataclass(frozen=True, eq=False)
class Gradient:
    """Accelerance (3s, 3h, n, F) in m/s²/N, its derivatives with the parameter's axis first.

    With respect to the natural logarithm of `stiffness` and `damping` (e, ...), to `loss_factor`
    (e, ...) itself, and to the weights of `inertia` (r, ...).
    """

    accelerance: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    loss_factor: np.ndarray
    inertia: np.ndarray


def laplace(frequency_hz: np.ndarray, rate_1_s: np.ndarray | float = 0.0) -> np.ndarray:
    """s (n, F) in rad/s from frequency_hz (n, F) and the window's decay rate (n,)."""
    return 2j * np.pi * np.atleast_2d(frequency_hz) + np.reshape(rate_1_s, (-1, 1))


def response(
    matrices: Matrices, elasticity: Elasticity, s: np.ndarray, mass: np.ndarray | None = None
) -> np.ndarray:
    """Accelerance (3s, 3h, n, F) at s (n, F); `mass` (n, e, e) takes the place of M."""
    mass = matrices.mass if mass is None else mass
    _, x_hit = _solutions(matrices, elasticity, s, mass, matrices.hit)
    sensor = np.swapaxes(matrices.sensor, 0, 1)  # (3s, n, e)
    return s**2 * np.einsum("ane,ebnf->abnf", sensor, x_hit, optimize=True)


def response_gradient(
    matrices: Matrices,
    elasticity: Elasticity,
    s: np.ndarray,
    mass: np.ndarray | None = None,
    mass_gradient: np.ndarray | None = None,
) -> Gradient:
    """Accelerance at s (n, F) and derivatives; mass_gradient (n, r, e, e) is dM per weight."""
    mass = matrices.mass if mass is None else mass
    both = np.concatenate([matrices.hit, matrices.sensor], axis=1)
    points = matrices.hit.shape[1]
    _, x = _solutions(matrices, elasticity, s, mass, both)
    x_hit, x_sensor = x[:, None, :points], x[:, points:, None]  # (e, ., ., n, F)
    sensor = np.swapaxes(matrices.sensor, 0, 1)
    h = s**2 * np.einsum("ane,ebnf->abnf", sensor, x_hit[:, 0], optimize=True)
    each = x_sensor * x_hit
    each *= -(s**2)
    k, c, eta = (
        v.reshape(-1, 1, 1, 1, 1)
        for v in (elasticity.stiffness, elasticity.damping, elasticity.loss_factor)
    )
    by_mass = np.empty((0, *h.shape), dtype=complex)
    if mass_gradient is not None:
        by_mass = _by_mass(mass_gradient, x[:, :points], x[:, points:], s)
    stiffness = k * each if not eta.any() else k * (1 + 1j * eta) * each
    return Gradient(h, stiffness, c * (s * each), 1j * k * each, by_mass)


def _solutions(
    matrices: Matrices, elasticity: Elasticity, s: np.ndarray, mass: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Z (n, F, e, e) and X = Z⁻¹ rowsᵀ (e, rows, n, F)."""
    square = s[..., None, None] ** 2
    z = square * mass[:, None]
    diagonal = np.einsum("...ii->...i", z)
    diagonal += elasticity.stiffness * (1 + 1j * elasticity.loss_factor)
    diagonal += s[..., None] * elasticity.damping
    if matrices.geometric.any():
        z += matrices.geometric[:, None]
    x = np.linalg.solve(z, np.swapaxes(rows, 1, 2)[:, None].astype(complex))
    return z, np.ascontiguousarray(np.moveaxis(x, (2, 3), (0, 1)))


def _by_mass(
    mass_gradient: np.ndarray, x_hit: np.ndarray, x_sensor: np.ndarray, s: np.ndarray
) -> np.ndarray:
    """−s⁴ X_sᵀ dM X_h, (r, 3s, 3h, n, F)."""
    e, b, n, f = x_hit.shape
    r = mass_gradient.shape[1]
    out = np.empty((r, x_sensor.shape[1], b, n, f), dtype=complex)
    for i in range(n):
        # One real product for the real and imaginary parts of all columns.
        columns = np.ascontiguousarray(x_hit[:, :, i]).reshape(e, -1)
        moved = mass_gradient[i].reshape(r * e, e) @ columns.view(float)
        moved = moved.view(complex).reshape(r, e, b, f)
        out[:, :, :, i] = np.einsum("eaf,rebf->rabf", x_sensor[:, :, i] * -(s[i] ** 4), moved)
    return out
