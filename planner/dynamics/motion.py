"""How a robot moves under forces at its points, and where hits and sensors really were.

A hit off its axis or beside its point is a force and a moment at the stated point; a sensor beside
its place, or turned, shows accelerations and angular accelerations of the stated one. So what is
measured is between *actual ports*: real combinations of those that robot.toml states.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.robot.elastic_model import AngleSlopes, Matrices


@dataclass(frozen=True, eq=False)
class ActualPorts:
    """Of n poses: which forces and moments acted, what was shown, and where the joints stood.

    `hit` (n, 6h, 3h) are the forces, then the moments (m), of each hit; `place` (n, 3s, 6s) what a
    faultless sensor feels of accelerations and angular accelerations (m), `matrix` (n, 3s, 3s)
    what of that it shows, all times `scale` (n, F). `angle` (n, dof) in rad or m is by how much
    the joints stood off their readback.
    """

    hit: np.ndarray
    place: np.ndarray
    matrix: np.ndarray
    scale: np.ndarray
    angle: np.ndarray

    def hit_jacobian(self, matrices: Matrices) -> np.ndarray:
        """(n, 3h, e) of the hits."""
        both = np.concatenate([matrices.hit, matrices.hit_turn], axis=1)
        return np.swapaxes(self.hit, 1, 2) @ both

    def true_sensor_jacobian(self, matrices: Matrices) -> np.ndarray:
        """(n, 3s, e) of faultless sensors where they are."""
        return self.place @ np.concatenate([matrices.sensor, matrices.sensor_turn], axis=1)

    def sensor_jacobian(self, matrices: Matrices) -> np.ndarray:
        """(n, 3s, e) of the sensors."""
        return self.matrix @ self.true_sensor_jacobian(matrices)

    def heavier(self, matrices: Matrices) -> np.ndarray:
        """Change (n, e, e) of the mass matrix by where the joints stood."""
        if matrices.by_angle is None:
            return np.zeros_like(matrices.mass)
        return np.einsum("nk,nkij->nij", self.angle, matrices.by_angle.mass)

    def turned(self, matrices: Matrices) -> Matrices:
        """Stiffness and Jacobians where the joints stood; the mass matrix is left as it is."""
        slopes = matrices.by_angle
        if slopes is None:
            return matrices
        by = np.einsum("nk,nke->ne", self.angle, slopes.stiffness)
        return replace(
            matrices,
            hit=matrices.hit + np.einsum("nk,nkij->nij", self.angle, slopes.hit),
            sensor=matrices.sensor + np.einsum("nk,nkij->nij", self.angle, slopes.sensor),
            geometric=matrices.geometric + by[:, :, None] * np.eye(by.shape[1]),
        )

    def slopes(self, by_angle: AngleSlopes) -> AngleSlopes:
        """How the actual ports change with the joint angles; not by what is beside the points."""
        hits, sensors = by_angle.hit.shape[2], by_angle.sensor.shape[2]
        hit = np.swapaxes(self.hit[:, None, :hits], 2, 3) @ by_angle.hit
        sensor = (self.matrix @ self.place[:, :, :sensors])[:, None] @ by_angle.sensor
        return replace(by_angle, hit=hit, sensor=sensor)


@dataclass(frozen=True, eq=False)
class Motion:
    """Of e elastic degrees of freedom: X (n, e, points, F) in rad/N at s (n, F).

    Where `actual` ports are known, X are the motions of those.
    """

    matrices: Matrices
    x_hit: np.ndarray
    x_sensor: np.ndarray
    s: np.ndarray
    actual: ActualPorts | None = None

    def scaled(self, values: np.ndarray) -> np.ndarray:
        """Values (n, …, F) as force gain and delay of the chain show them."""
        if self.actual is None:
            return values
        scale = self.actual.scale
        return values * scale.reshape(len(scale), *[1] * (values.ndim - 2), -1)

    @cached_property
    def accelerance(self) -> np.ndarray:
        """(n, 3s, 3h, F) in m/s²/N."""
        m = self.matrices
        return self.moving(m.sensor if self.actual is None else self.actual.sensor_jacobian(m))

    @cached_property
    def true_accelerance(self) -> np.ndarray:
        """(n, 3s, 3h, F) in m/s² per hit in N, as faultless sensors would show it."""
        if self.actual is None:
            return self.accelerance
        return self.moving(self.actual.true_sensor_jacobian(self.matrices))

    def moving(self, rows: np.ndarray) -> np.ndarray:
        """(n, r, 3h, F): how the hits accelerate `rows` (n, r, e)."""
        return self.scaled(synthesis(rows, self.x_hit, self.s))

    def shown_of(self, ports: np.ndarray) -> np.ndarray:
        """(n, 3s, p, F): what the sensors show of forces or moments at `ports` (n, p, e)."""
        # Z is symmetric: what a moment at the hit point does to the sensor, a force at the sensor
        # does to the turning of the hit point.
        return self.scaled(np.swapaxes(synthesis(ports, self.x_sensor, self.s), 1, 2))

    @property
    def forces(self) -> np.ndarray:
        """(n, 3s, 3h, F) in m/s² per N along the stated axes, as the sensors show them."""
        return self.shown_of(self.matrices.hit)

    @property
    def moment(self) -> np.ndarray:
        """(n, 3s, 3h, F) in m/s² per N·m at the hit point."""
        return self.shown_of(self.matrices.hit_turn)

    @property
    def turning(self) -> np.ndarray:
        """(n, 3s, 3h, F) in rad/s² per N: how the sensor turns."""
        return self.moving(self.matrices.sensor_turn)

    @cached_property
    def by_angle(self) -> np.ndarray | None:
        """(n, dof, 3s, 3h, F) in m/s²/N per rad of each joint; None where slopes are not known."""
        slopes = self.matrices.by_angle
        if slopes is None:
            return None
        if self.actual is not None:
            slopes = self.actual.slopes(slopes)
        return self.scaled(_by_angle(slopes, self.x_hit, self.x_sensor, self.s))


def synthesis(rows: np.ndarray, x: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Accelerations (n, r, points, F) along rows (n, r, e) of motions x (n, e, points, F)."""
    return (s**2)[:, None, None] * times_real(rows, x)


def times_real(ports: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Real ports (n, r, e) times complex motions (n, e, points, F), in one real product."""
    n, r, _ = ports.shape
    flat = np.ascontiguousarray(x).reshape(n, x.shape[1], -1).view(float)
    return (ports @ flat).view(complex).reshape(n, r, *x.shape[2:])


def _by_angle(
    slopes: AngleSlopes, x_hit: np.ndarray, x_sensor: np.ndarray, s: np.ndarray
) -> np.ndarray:
    """s² [J_s' X_h + X_sᵀ (J_h'ᵀ − Z' X_h)] of each joint's angle, (n, dof, 3s, 3h, F)."""
    n, dof, e, _ = slopes.mass.shape
    square = (s**2)[:, None, None, None]
    inner = times_real(slopes.mass.reshape(n, -1, e), x_hit).reshape(n, dof, e, *x_hit.shape[2:])
    inner *= -square
    if slopes.stiffness.any():
        inner -= slopes.stiffness[..., None, None] * x_hit[:, None]
    inner += np.swapaxes(slopes.hit, 2, 3)[..., None]
    out = times_real(slopes.sensor.reshape(n, -1, e), x_hit).reshape(n, dof, -1, *x_hit.shape[2:])
    out = out + np.einsum("neif,nkejf->nkijf", x_sensor, inner)
    return square * out
