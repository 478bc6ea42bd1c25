"""Laplace mixtures: hyperparameters drawn from a Gaussian around the most probable ones.

For models whose likelihood is dear, or whose hyperparameters are too many for the importance
sampling of `gp`: the curvature at the peak, from slopes on both sides of it, says how far each
direction may reach (MacKay 1992; Rasmussen & Williams 2006, section 3.4).
"""

from collections.abc import Callable

import numpy as np

from planner.surrogate.quasi_random import normal_points

STEP = 1e-3  # in sds of the prior
COUNT = 8  # draws


def curvature(slope: Callable[[np.ndarray], np.ndarray], peak: np.ndarray) -> np.ndarray:
    """Second derivatives (p, p) of the negative log posterior, given its slope, at the peak.

    z is in units of the prior N(0, 1), whose own curvature is the least that is believed.
    """
    rows = []
    for unit in STEP * np.eye(len(peak)):
        rows.append((slope(peak + unit) - slope(peak - unit)) / (2 * STEP))
    values, vectors = np.linalg.eigh((np.array(rows) + np.array(rows).T) / 2)
    return (vectors * np.maximum(values, 1.0)) @ vectors.T


def draws(
    slope: Callable[[np.ndarray], np.ndarray], peak: np.ndarray, count: int = COUNT
) -> tuple[np.ndarray, float]:
    """Quasi-random points (count, p) of equal weight, and what the evidence has over the peak.

    log evidence = log posterior at the peak (with −½z² for the prior) + the second value.
    """
    bent = curvature(slope, peak)
    factor = np.linalg.cholesky(bent)
    normal = normal_points(count, len(peak), 1)
    # Few points do not average to nothing; their own mean is taken off, so that these do.
    normal = normal - normal.mean(axis=0)
    apart = np.linalg.solve(factor.T, normal.T).T
    return peak + apart, -float(np.sum(np.log(np.diag(factor))))
