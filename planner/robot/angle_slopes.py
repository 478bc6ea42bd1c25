"""How mass matrix and Jacobians change with the robot's own joint angles.

A body's Jacobian in the body's own frame has the columns J_c. Turning joint k changes those of all
that lies between the floor and it by −[J_k, J_c], the bracket of two motions (Lynch & Park 2017,
section 5.1.2 and exercise 5.14), and leaves the others as they are.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class AngleSlopes:
    """By each of `dof` joint angles, of n poses and e elastic degrees of freedom.

    `mass` (n, dof, e, e) in kg·m²/rad, `hit` (n, dof, 3h, e) and `sensor` (n, dof, 3s, e) in
    m/rad², `stiffness` (n, dof, e) in N·m/rad² of springs that go with the angle. Left out is
    what moves with the weight: sag and gravity's stiffness change by a thousandth as much.
    """

    mass: np.ndarray
    hit: np.ndarray
    sensor: np.ndarray
    stiffness: np.ndarray

    def at(self, poses: slice | np.ndarray) -> "AngleSlopes":
        """Of some of the poses."""
        return AngleSlopes(*(getattr(self, name)[poses] for name in self.__dataclass_fields__))


def turned(jacobian: np.ndarray, rigid: np.ndarray, elastic: np.ndarray) -> np.ndarray:
    """Slopes (..., dof, 6, e) of a Jacobian (..., 6, v) in its own frame, of elastic rotations.

    `rigid` (v, dof) and `elastic` (v, e) say how the joints and the elastic rotations move the v
    coordinates; those nearer to the floor come first.
    """
    turning, giving = (np.flatnonzero(moves.any(axis=1)) for moves in (rigid, elastic))
    joint = np.moveaxis(jacobian[..., turning], -1, -2)[..., None]  # (..., turning, 6, 1)
    inner = (giving < turning[:, None])[:, None]
    column = np.where(inner, jacobian[..., None, :, giving], 0.0)
    linear, angular = slice(0, 3), slice(3, 6)

    def cross(a: slice, b: slice) -> np.ndarray:
        return np.cross(joint[..., a, :], column[..., b, :], axis=-2)

    moved = cross(angular, linear) + cross(linear, angular)
    slopes = -np.concatenate([moved, cross(angular, angular)], axis=-2) @ elastic[giving]
    return np.moveaxis(np.tensordot(rigid[turning], slopes, axes=(0, -3)), 0, -3)


def mass_slopes(
    bodies: np.ndarray, inertia: np.ndarray, rigid: np.ndarray, elastic: np.ndarray
) -> np.ndarray:
    """(n, dof, e, e) of M = Σ Jᵀ I J, of Jacobians (n, B, 6, v) and inertias (B, 6, 6)."""
    slope = turned(bodies, rigid, elastic)
    momentum = inertia @ (bodies @ elastic)
    n, _, dof, _, e = slope.shape
    rows = np.moveaxis(slope, (2, 4), (1, 2)).reshape(n, dof * e, -1)
    half = (rows @ momentum.reshape(n, -1, e)).reshape(n, dof, e, e)
    return half + np.swapaxes(half, 2, 3)
