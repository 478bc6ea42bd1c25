"""Quadrature MFDGP: not the published MFDGP (`mfdgp`), but its second layer trained exactly.

Layer 1 is a GP of the cheap samples that is fitted first and kept, layer 2 a sparse GP of
(x, f_1(x)) with the kernel of Cutajar et al. 2019, k_ρ(x) (σ² f f' + k_f(f, f')) + k_δ(x). f_1
enters layer 2 with its whole distribution, in training and in prediction, by quadrature instead of
Monte Carlo. The bound of layer 2 has its best q(u) put in (see `sparse_gp`), so nothing is left for
a stochastic optimiser; layer 1 has so many more points that it is not corrected by layer 2.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from planner.surrogate.models.fidelity_levels import FidelityLevel, Samples
from planner.surrogate.models.sparse_gp import SparseGP, fit_sparse

NODE_COUNT = 5  # of the quadrature over f_1
NODES = norm.ppf((np.arange(NODE_COUNT) + 0.5) / NODE_COUNT)
NODES = NODES / np.std(NODES)


@dataclass(frozen=True, eq=False)
class QuadratureMFDGP:
    """Fitted layers; the first one's output is centred and scaled for the second."""

    low: FidelityLevel
    high: SparseGP
    centre: float
    scale: float

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q,) of the noise-free output at x (q, d)."""
        wide = _spread(self.low, x, self.centre, self.scale)
        mean, sd = (a.reshape(NODE_COUNT, -1) for a in self.high.predict(wide))
        total = np.sqrt(np.mean(sd**2, axis=0) + np.var(mean, axis=0))
        return np.mean(mean, axis=0), total


def cutajar(d: int, shape: str = "rbf") -> str:
    """Kernel expression of layer 2 over the columns (x_1 … x_d, f_1)."""
    pose, below = f"{shape}[0:{d}]", f"[{d}:{d + 1}]"
    return f"{pose}*linear{below}+{pose}*{shape}{below}+{pose}"


def fit_quadrature_mfdgp(
    measured: Samples, low: FidelityLevel, inducing: int = 200, kernel: str | None = None
) -> QuadratureMFDGP:
    """Fit layer 2 to the measured samples; `low`, fitted or exact, is layer 1.

    `kernel` is an expression over (x_1 … x_d, f_1), default `cutajar`.
    """
    value, _ = low.predict(measured.x)
    centre, scale = float(np.mean(value)), float(np.std(value)) or 1.0
    wide = _spread(low, measured.x, centre, scale)
    tiled = Samples(wide, np.tile(measured.y, NODE_COUNT), np.tile(measured.sd, NODE_COUNT))
    weights = np.full(len(wide), 1 / NODE_COUNT)
    expression = kernel or cutajar(measured.x.shape[1])
    high = fit_sparse(tiled, expression, inducing, weights)
    return QuadratureMFDGP(low, high, centre, scale)


def _spread(low: FidelityLevel, x: np.ndarray, centre: float, scale: float) -> np.ndarray:
    """x (q, d) with the low level's value at each node: (NODE_COUNT·q, d + 1)."""
    value, sd = low.predict(x)
    nodes = (value[None, :] + NODES[:, None] * sd[None, :] - centre) / scale
    return np.column_stack([np.tile(x, (NODE_COUNT, 1)), nodes.reshape(-1)])
