"""AR1 as published (Kennedy & O'Hagan 2000): y = ρ·l(x) + δ(x), at the greatest likelihood.

The cheap level is known at every pose, so that δ's kernel (RBF) and the noise are all that is
climbed; ρ is integrated over a normal prior whose width is climbed too, instead of being climbed
itself, which with a linear kernel in l is one GP. What averages hyperparameters is `recursive_ar1`.
"""

from dataclasses import dataclass

import numpy as np

from planner.surrogate.models.fidelity_levels import FidelityLevel, Samples
from planner.surrogate.models.likelihood_gp import LikelihoodGP, Normalisation, fit_likelihood


@dataclass(frozen=True, eq=False)
class KennedyOHagan:
    """Fitted: a GP of (x, l) with the kernel σ² l l' + k_δ(x)."""

    low: FidelityLevel
    model: LikelihoodGP
    low_units: Normalisation

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q,) of the noise-free expensive output at x (q, d)."""
        return self.model.predict(_with_low(self.low, x, self.low_units))


def fit_kennedy_ohagan(
    measured: Samples, low: FidelityLevel, low_units: Normalisation, isotropic: bool = False
) -> KennedyOHagan:
    """AR1 of the measured samples over a cheap level that is known exactly.

    `isotropic`: δ has one length scale.
    """
    d = measured.x.shape[1]
    wide = Samples(_with_low(low, measured.x, low_units), measured.y, measured.sd)
    model = fit_likelihood(wide, f"linear[{d}:{d + 1}]+rbf[0:{d}]", isotropic=isotropic)
    return KennedyOHagan(low, model, low_units)


def _with_low(low: FidelityLevel, x: np.ndarray, units: Normalisation) -> np.ndarray:
    value, _ = low.predict(x)
    return np.column_stack([x, (value - units.centre) / units.scale])
