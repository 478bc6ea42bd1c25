"""FRFs of many poses with their derivatives with respect to springs and inertias.

At s = iω (or iω + rate under an exponential window) the receptance is J_s Z⁻¹ J_hᵀ with
Z = K(1+iη) + s C + s² M. Z is symmetric, so that with X = Z⁻¹ Jᵀ any change dZ changes it by
−X_sᵀ dZ X_h: two solutions serve all parameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from planner.dynamics.motion import ActualPorts, Motion, synthesis, times_real
from planner.dynamics.simulation import Elasticity
from planner.robot.elastic_model import Matrices


@dataclass(frozen=True, eq=False)
class Inertias:
    """How p inertial parameters of each of B bodies move the mass matrix: Σ Jᵀ basis J.

    `jacobians` (n, B, 6, e) of the bodies at n poses; `basis` (B, p, 6, 6), symmetric, per unit of
    parameter.
    """

    jacobians: np.ndarray
    basis: np.ndarray


Terms = tuple[tuple[int, np.ndarray], ...]


@dataclass(frozen=True, eq=False)
class Impedance:
    """What an effect adds to Z through r ports: Pᵀ [Σ c(s) S] P, P being `ports` (n, r, e).

    Z is in N·m/rad. `shapes` (t, r, r) are all S that occur, real and symmetric. `values` names
    those of Z itself, by number, each with its c (n, F); `slope` those of its derivative by each
    of the effect's own parameters.
    """

    ports: np.ndarray
    shapes: np.ndarray
    values: Terms
    slope: tuple[Terms, ...] = ()

    def add_to(self, z: np.ndarray) -> None:
        """Add it to z (n, F, e, e)."""
        if not self.values:
            return
        numbers, coefficients = zip(*self.values, strict=True)
        ports = self.ports[:, None]
        whole = np.swapaxes(ports, 2, 3) @ self.shapes[list(numbers)] @ ports
        each = np.stack([np.broadcast_to(c, z.shape[:2]) for c in coefficients], axis=2)
        z += (each @ whole.reshape(len(z), len(numbers), -1)).reshape(z.shape)

    def gradient(self, x_hit: np.ndarray, x_sensor: np.ndarray, out: np.ndarray) -> None:
        """X_sᵀ dZ X_h into out (n, p, 3s, 3h, F), of solutions (n, e, 3, F)."""
        hit, sensor = times_real(self.ports, x_hit), times_real(self.ports, x_sensor)
        each = np.empty((len(hit), len(self.shapes), *out.shape[2:]), dtype=complex)
        _between(self.shapes, sensor, hit, each)
        for parameter, ((number, coefficient), *more) in enumerate(self.slope):
            one = out[:, parameter]
            np.multiply(coefficient[:, None, None], each[:, number], out=one)
            for number, coefficient in more:
                one += coefficient[:, None, None] * each[:, number]


def laplace(frequency_hz: np.ndarray, rate_1_s: np.ndarray | float = 0.0) -> np.ndarray:
    """s (n, F) in rad/s from frequency_hz (n, F) and the window's decay rate (n,)."""
    return 2j * np.pi * np.atleast_2d(frequency_hz) + np.reshape(rate_1_s, (-1, 1))


def response(matrices: Matrices, elasticity: Elasticity, s: np.ndarray) -> np.ndarray:
    """Accelerance (n, 3s, 3h, F) in m/s²/N at s (n, F)."""
    x = _solutions(matrices, elasticity, s, matrices.mass, matrices.hit)
    return synthesis(matrices.sensor, x, s)


def moved(
    matrices: Matrices,
    elasticity: Elasticity,
    s: np.ndarray,
    mass: np.ndarray | None = None,
    added: Sequence[Impedance] = (),
    actual: ActualPorts | None = None,
) -> Motion:
    """The motion behind accelerances at s (n, F); where hits and sensors were, if that is known.

    `mass` (n, e, e) takes M's place.
    """
    mass = matrices.mass if mass is None else mass
    hit, sensor = matrices.hit, matrices.sensor
    if actual is not None:
        matrices = actual.turned(matrices)
        mass = mass + actual.heavier(matrices)
        hit, sensor = actual.hit_jacobian(matrices), actual.sensor_jacobian(matrices)
    rows = np.concatenate([hit, sensor], axis=1)
    x = _solutions(matrices, elasticity, s, mass, rows, added)
    points = hit.shape[1]
    return Motion(matrices, x[:, :, :points], x[:, :, points:], s, actual)


def motion_slopes(
    motion: Motion,
    elasticity: Elasticity,
    inertias: Inertias | None = None,
    added: Sequence[Impedance] = (),
) -> np.ndarray:
    """Derivatives (n, P, 3s, 3h, F) of a motion's accelerance.

    The parameters are ln stiffness (e), ln damping (e), ln loss factor (e, only if one is not 0),
    those of `inertias` (B · p, only if given), and those of all that is `added` to Z.
    """
    # All derivatives are products with the sensors' motions, by which the chain shows them.
    x_hit, x_sensor, s = motion.x_hit, motion.scaled(motion.x_sensor), motion.s
    e, lossy = x_hit.shape[1], bool(elasticity.loss_factor.any())
    springs = (3 if lossy else 2) * e
    extra = 0 if inertias is None else inertias.basis.shape[0] * inertias.basis.shape[1]
    own = sum(len(one.slope) for one in added)
    shape = len(s), springs + extra + own, x_sensor.shape[2], x_hit.shape[2], s.shape[1]
    out = np.empty(shape, dtype=complex)
    minus = -(s**2)[:, None, None, None]
    each = out[:, :e]
    np.multiply(x_sensor[:, :, :, None], x_hit[:, :, None] * minus, out=each)
    k = elasticity.stiffness[:, None, None, None]
    slope = s[:, None, None, None] * elasticity.damping[:, None, None, None]
    np.multiply(each, slope, out=out[:, e : 2 * e])
    if lossy:
        lost = 1j * elasticity.loss_factor[:, None, None, None]
        np.multiply(each, k * lost, out=out[:, 2 * e : springs])
        each *= k * (1 + lost)
    else:
        each *= k
    if inertias is not None:
        _by_inertia(inertias, x_hit, x_sensor, s, out[:, springs : springs + extra])
    place = springs + extra
    for one in added:
        part = out[:, place : place + len(one.slope)]
        one.gradient(x_hit * minus[:, 0], x_sensor, part)
        place += len(one.slope)
    return out


def _solutions(
    matrices: Matrices,
    elasticity: Elasticity,
    s: np.ndarray,
    mass: np.ndarray,
    rows: np.ndarray,
    added: Sequence[Impedance] = (),
) -> np.ndarray:
    """X = Z⁻¹ rowsᵀ as (n, e, rows, F)."""
    z = (s**2)[..., None, None] * mass[:, None]
    z += matrices.geometric[:, None]
    diagonal = np.einsum("...ii->...i", z)
    diagonal += elasticity.stiffness * (1 + 1j * elasticity.loss_factor)
    diagonal += s[..., None] * elasticity.damping
    for one in added:
        one.add_to(z)
    x = np.linalg.solve(z, np.swapaxes(rows, 1, 2)[:, None].astype(complex))
    return np.ascontiguousarray(np.moveaxis(x, 1, 3))


def _by_inertia(
    inertias: Inertias, x_hit: np.ndarray, x_sensor: np.ndarray, s: np.ndarray, out: np.ndarray
) -> None:
    """−s⁴ (J X_s)ᵀ basis (J X_h) into out (n, B · p, 3s, 3h, F)."""
    n, bodies, _, e = inertias.jacobians.shape
    lines = s.shape[1]
    for i in range(n):
        jacobian = inertias.jacobians[i].reshape(1, -1, e)
        hit = times_real(jacobian, x_hit[i, None]).reshape(bodies, 6, -1, lines)
        sensor = times_real(jacobian, x_sensor[i, None] * -(s[i] ** 4))
        sensor = sensor.reshape(bodies, 6, -1, lines)
        _between(inertias.basis, sensor, hit, out[i].reshape(bodies, -1, *out.shape[2:]))


def _between(shapes: np.ndarray, sensor: np.ndarray, hit: np.ndarray, out: np.ndarray) -> None:
    """sensorᵀ S hit into out (n, t, 3s, 3h, F), which is contiguous, of motions (n, r, 3, F).

    `shapes` S (t, r, r), or (n, t, r, r), are real and symmetric: the products of the motions, two
    and two, are added up in one real product.
    """
    n, r = sensor.shape[:2]
    upper = _upper(r)
    products = np.empty((n, len(upper[0]), *out.shape[2:]), dtype=complex)
    end = 0
    for port in range(r):
        start, end = end, end + r - port
        part = products[:, start:end]
        np.multiply(sensor[:, port, None, :, None], hit[:, port:, None], out=part)
        part[:, 1:] += sensor[:, port + 1 :, :, None] * hit[:, port, None, None]
    flat = products.reshape(n, len(upper[0]), -1).view(float)
    weights = shapes[..., upper[0], upper[1]]
    np.matmul(weights, flat, out=out.reshape(n, out.shape[1], -1).view(float))


@cache
def _upper(size: int) -> tuple[np.ndarray, np.ndarray]:
    return np.triu_indices(size)
