"""Odds as an engineer reads them."""

import numpy as np

MOST = 1e4  # beyond, how large they are says nothing more


def as_ratio(log_odds: float) -> str:
    """Natural logarithm of odds as "30 : 1"; what is said of a robot is never surer than MOST."""
    if log_odds > np.log(MOST):
        return f"more than {MOST:g} : 1"
    return f"about {float(f'{np.exp(max(log_odds, 0.0)):.2g}'):g} : 1"
