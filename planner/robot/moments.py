"""Moments of inertia as six numbers, in the orders in which files and libraries list them."""

from collections.abc import Sequence

import numpy as np

Order = Sequence[tuple[int, int]]
STATED: Order = (0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)  # robot.toml, as in a URDF
PINOCCHIO: Order = (0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)


def symmetric(values: Sequence[float] | np.ndarray, order: Order) -> np.ndarray:
    """(3, 3) of its six numbers in some order."""
    found = np.zeros((3, 3))
    for (i, j), value in zip(order, values, strict=True):
        found[i, j] = found[j, i] = value
    return found
