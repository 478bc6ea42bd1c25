"""NARGP: the expensive level is any smooth function of the pose and of the cheap level.

y = g(x, l(x)) (Perdikaris et al. 2017, eq. 2.13), with a Gaussian process g whose kernel is
k_ρ(x) k_f(l) + k_δ(x), and here AR1's ρ·l + b in front, so that it is AR1 where nothing bends.
Where the cheap level is uncertain, its uncertainty is carried through g by quadrature.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from planner.studies.models.fidelity_levels import LowLevel, Samples
from planner.studies.models.recursive_ar1 import PRIOR, scales
from planner.surrogate.ar1 import AR1, OutputPrior, fit_ar1
from planner.surrogate.predictive import Predictive
from planner.surrogate.training_data import TrainingData

NODES = norm.ppf((np.arange(9) + 0.5) / 9)  # equally probable values of the cheap level
NODES = NODES / np.std(NODES)
CERTAIN = 1e-6  # sd of the cheap level over its scale, below which one value is enough


@dataclass(frozen=True, eq=False)
class NARGP:
    """Fitted; `model` takes (x, l) and is in scaled units."""

    low: LowLevel
    model: AR1
    low_centre: float
    low_scale: float
    centre: float
    scale: float
    log_evidence: float

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Median and sd (q,) of the noise-free output at x (q, d)."""
        found = self.predictive(x)
        return found.median, found.sd

    def predictive(self, x: np.ndarray) -> Predictive:
        """The same, one Gaussian per sample of the hyperparameters."""
        value, unsure = self.low.predict(x)
        scaled, sd = (value - self.low_centre) / self.low_scale, unsure / self.low_scale
        nodes = NODES if np.max(sd, initial=0.0) > CERTAIN else np.zeros(1)
        low = (scaled[None, :] + nodes[:, None] * sd[None, :]).reshape(-1)
        wide = np.column_stack([np.tile(x, (len(nodes), 1)), low])
        base, offset = self.model.split(low[:, None])
        found = self.model.posterior.predictive(0, wide, offset[:, 0])
        shape = len(found.weights), len(nodes), len(x)
        means, sds = (found.means + base[:, 0]).reshape(shape), found.sds.reshape(shape)
        sds = np.sqrt(np.mean(sds**2, axis=1) + np.var(means, axis=1))
        moments = Predictive(found.weights, np.mean(means, axis=1), sds)
        return moments.scaled(self.centre, self.scale)


def perdikaris(d: int, shape: str = "rbf") -> str:
    """Kernel expression k_ρ(x) k_f(l) + k_δ(x) over the columns (x_1 … x_d, l)."""
    return f"{shape}[0:{d}]*{shape}[{d}:{d + 1}]+{shape}[0:{d}]"


def fit_nargp(
    measured: Samples, low: LowLevel, low_spread: float, kernel: str = "product",
    prior: OutputPrior = PRIOR,
) -> NARGP:  # fmt: skip
    """NARGP of the measured samples; `kernel` over (x, l), or "product": `perdikaris`."""
    n, d = len(measured.y), measured.x.shape[1]
    value, unsure = low.predict(measured.x)
    low_centre = float(np.mean(value)) if n else 0.0
    low_scale, scale = scales(measured.y, value, low_spread)
    centre = float(np.mean(measured.y)) if n else 0.0
    scaled = (value - low_centre) / low_scale
    data = TrainingData(
        np.column_stack([measured.x, scaled]),
        ((measured.y - centre) / scale)[:, None],
        np.hypot(measured.sd / scale, unsure / low_scale)[:, None],
        scaled[:, None],
    )
    expression = perdikaris(d) if kernel == "product" else kernel
    model = fit_ar1(data, (prior,), (prior,), np.zeros(1), kernel=expression, thorough=True)
    evidence = float(model.posterior.log_evidence[0]) - n * np.log(scale)
    return NARGP(low, model, low_centre, low_scale, centre, scale, evidence)
