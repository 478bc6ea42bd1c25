"""Hits as wrenches at the tcp."""

from collections.abc import Sequence

import numpy as np


def along(axes: Sequence[int]) -> np.ndarray:
    """Wrenches (h, 6) of hits exactly along tcp axes 0..2 (h,) and exactly at the tcp."""
    return np.eye(6)[list(axes)]
