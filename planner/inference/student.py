"""How much wider intervals of 95 % are where few values tell the variance, without SciPy."""

import numpy as np

# ln(t₀.₉₇₅(ν)/1.95996) as a polynomial in 1/ν: least squares beside scipy.special.stdtrit for
# ν ≥ 2, right to 1.3e-6.
QUANTILE = -1.21111e-06, 1.210469181, 0.705417327, 0.170526168, -0.309654629, 0.0881456454


def widening_factor(freedom: np.ndarray | float) -> np.ndarray:
    """Student's t quantile over the normal one (97.5 %), for degrees of freedom ≥ 2."""
    return np.exp(np.polynomial.polynomial.polyval(1 / freedom, QUANTILE))
