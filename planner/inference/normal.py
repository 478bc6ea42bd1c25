"""The standard normal distribution, of a few thousand values: SciPy's takes 0.1 s to import."""

import math

import numpy as np

_BEYOND = np.frompyfunc(math.erfc, 1, 1)


def below(z: np.ndarray) -> np.ndarray:
    """Probability of a value below z, of any shape."""
    return np.asarray(_BEYOND(-np.asarray(z) / math.sqrt(2)) / 2, dtype=float)
