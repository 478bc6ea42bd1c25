"""Quasi-random points of the standard normal distribution."""

import numpy as np
from scipy.special import ndtri


def normal_points(samples: int, dimensions: int, seed: int) -> np.ndarray:
    """Scrambled Sobol points (samples, dimensions), as standard normal ones; a seed, a set."""
    from scipy.stats import qmc  # scipy.stats takes most of a second to import

    sobol = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
    unit = sobol.random_base2(int(np.ceil(np.log2(samples))))[:samples]
    return ndtri(np.clip(unit, 1e-6, 1 - 1e-6))
