"""Mode shapes as motions of points in space."""

from collections.abc import Sequence

import numpy as np

from planner.recording.dof import Dof
from planner.recording.geometry import Geometry

LARGEST = 0.12  # of the structure's size: how far the point moves that moves most
AXIS = {"x": 0, "y": 1, "z": 2}


def motions(dofs: Sequence[Dof], shape: np.ndarray, geometry: Geometry) -> np.ndarray:
    """(nodes, 3) complex motion of every node of the geometry, the largest of size 1.

    Points not measured stand still; a direction that is not known counts as z.
    """
    place = {node: k for k, node in enumerate(geometry.nodes)}
    motion = np.zeros((len(place), 3), complex)
    for dof, value in zip(dofs, shape, strict=True):
        if dof.node in place and not dof.is_turn:
            axis = AXIS.get(dof.positive.direction, 2)
            motion[place[dof.node], axis] += dof.sign * value
    # The instant of largest motion comes first.
    motion = motion * np.exp(-0.5j * np.angle(np.sum(motion**2)))
    largest = float(np.max(np.linalg.norm(np.abs(motion), axis=1), initial=0.0))
    return motion / largest if largest > 0 else motion


def moved(geometry: Geometry, motion: np.ndarray, phase: float) -> np.ndarray:
    """(nodes, 3) where points are at a phase (rad) of the vibration, exaggerated."""
    span = float(np.linalg.norm(np.ptp(geometry.position_m, axis=0))) or 1.0
    return geometry.position_m + LARGEST * span * np.real(motion * np.exp(1j * phase))
