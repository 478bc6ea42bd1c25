"""AR1-NARGP: not the published NARGP, but that with AR1's trend in front.

y = ρ·l(x) + b + g(x, l(x)), where g has the kernel k_ρ(x) k_f(l) + k_δ(x) of Perdikaris et al.
2017: AR1 where nothing bends. Hyperparameters are averaged, not maximised. Where the cheap level is
uncertain, its uncertainty is carried through g by quadrature. The published one is in `nargp`.
"""

import numpy as np
from scipy.stats import norm

from planner.surrogate.ar1 import OutputPrior
from planner.surrogate.models.fidelity_levels import FidelityLevel, Samples
from planner.surrogate.models.nargp import perdikaris
from planner.surrogate.models.recursive_ar1 import PRIOR, ScaledAR1
from planner.surrogate.predictive import Predictive

NODES = norm.ppf((np.arange(9) + 0.5) / 9)  # equally probable values of the cheap level
NODES = NODES / np.std(NODES)
CERTAIN = 1e-6  # sd of the cheap level over its scale, below which one value is enough


class AR1NARGP(ScaledAR1):
    """Fitted by `fit_ar1_nargp`; `model` takes (x, l)."""

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


def fit_ar1_nargp(
    measured: Samples, low: FidelityLevel, low_spread: float, kernel: str = "product",
    prior: OutputPrior = PRIOR,
) -> AR1NARGP:  # fmt: skip
    """AR1-NARGP of the measured samples; `kernel` over (x, l), or "product": `perdikaris`."""
    expression = perdikaris(measured.x.shape[1]) if kernel == "product" else kernel
    return AR1NARGP.fit(measured, low, low_spread, expression, prior, sees_low=True)
