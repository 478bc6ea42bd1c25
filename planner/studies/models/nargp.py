"""NARGP: the expensive level is any smooth function of the pose and of the cheap level.

y = g(x, l(x)) (Perdikaris et al. 2017, eq. 2.13), with a Gaussian process g whose kernel is
k_ρ(x) k_f(l) + k_δ(x), and here AR1's ρ·l + b in front, so that it is AR1 where nothing bends.
Where the cheap level is uncertain, its uncertainty is carried through g by quadrature.
"""

import numpy as np
from scipy.stats import norm

from planner.studies.models.fidelity_levels import FidelityLevel, Samples
from planner.studies.models.recursive_ar1 import PRIOR, ScaledAR1
from planner.surrogate.ar1 import OutputPrior
from planner.surrogate.predictive import Predictive

NODES = norm.ppf((np.arange(9) + 0.5) / 9)  # equally probable values of the cheap level
NODES = NODES / np.std(NODES)
CERTAIN = 1e-6  # sd of the cheap level over its scale, below which one value is enough


class NARGP(ScaledAR1):
    """Fitted by `fit_nargp`; `model` takes (x, l)."""

    def predictive(self, x: np.ndarray) -> Predictive:
        """The noise-free output at x (q, d), one Gaussian per sample of the hyperparameters."""
        low, sd = self.scaled_low(x)
        nodes = NODES if np.max(sd, initial=0.0) > CERTAIN else np.zeros(1)
        low = (low[None, :] + nodes[:, None] * sd[None, :]).reshape(-1)
        wide = np.column_stack([np.tile(x, (len(nodes), 1)), low])
        base, offset = self.model.split(low[:, None])
        each = self.model.posterior.predictive(0, wide, offset[:, 0])
        shape = len(each.weights), len(nodes), len(x)
        means, sds = (each.means + base[:, 0]).reshape(shape), each.sds.reshape(shape)
        sds = np.sqrt(np.mean(sds**2, axis=1) + np.var(means, axis=1))
        moments = Predictive(each.weights, np.mean(means, axis=1), sds)
        return moments.scaled(self.centre, self.scale)


def perdikaris(d: int, shape: str = "rbf") -> str:
    """Kernel expression k_ρ(x) k_f(l) + k_δ(x) over the columns (x_1 … x_d, l)."""
    return f"{shape}[0:{d}]*{shape}[{d}:{d + 1}]+{shape}[0:{d}]"


def fit_nargp(
    measured: Samples, low: FidelityLevel, low_spread: float, kernel: str = "product",
    prior: OutputPrior = PRIOR,
) -> NARGP:  # fmt: skip
    """NARGP of the measured samples; `kernel` over (x, l), or "product": `perdikaris`."""
    expression = perdikaris(measured.x.shape[1]) if kernel == "product" else kernel
    return NARGP.fit(measured, low, low_spread, expression, prior, sees_low=True)
