"""Rotations and second moments of mass: plain 3x3 arrays, angles in rad."""

import numpy as np
from numpy.typing import ArrayLike


def cross_matrix(v: np.ndarray) -> np.ndarray:
    """The matrix [v]x with [v]x u = v x u."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def turn(axis: ArrayLike, angle: float) -> np.ndarray:
    """Rotation by `angle` (rad) about the unit vector `axis` (Rodrigues)."""
    k = cross_matrix(np.asarray(axis, float))
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def to_rpy(rotation: np.ndarray) -> np.ndarray:
    """URDF's roll, pitch, yaw (rad), about fixed x, then y, then z; roll is 0 at +-90° of pitch."""
    pitch = np.arcsin(np.clip(-rotation[2, 0], -1, 1))
    if abs(rotation[2, 0]) > 1 - 1e-10:
        return np.array([0.0, pitch, np.arctan2(-rotation[0, 1], rotation[1, 1])])
    return np.array(
        [
            np.arctan2(rotation[2, 1], rotation[2, 2]),
            pitch,
            np.arctan2(rotation[1, 0], rotation[0, 0]),
        ]
    )


def with_z_along(axis: np.ndarray, spin: float) -> np.ndarray:
    """A rotation whose third column is `axis`, turned by `spin` (rad) about it."""
    axis = np.asarray(axis, float)
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis]) @ turn([0, 0, 1], spin)


def across(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors across `axis` and across each other."""
    frame = with_z_along(axis, 0.0)
    return frame[:, 0], frame[:, 1]


def inertia_of(second: np.ndarray) -> np.ndarray:
    """Inertia tensor (kg m2) of a second moment of mass (kg m2): tr(S) 1 - S."""
    return np.trace(second) * np.eye(3) - second


def random_turn(rng: np.random.Generator, angle: float) -> np.ndarray:
    """Rotation by `angle` (rad) about a direction drawn evenly."""
    axis = rng.normal(size=3)
    return turn(axis / np.linalg.norm(axis), angle)
