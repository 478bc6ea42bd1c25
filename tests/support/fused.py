"""One output from cheap and expensive samples: every model there is, weighted by its evidence."""

from dataclasses import replace

import numpy as np

from planner.surrogate.ar1 import OutputPrior
from planner.surrogate.models import averaged
from planner.surrogate.models.averaged import (
    AveragedModel,
    fit_ar1_nargp,
    fit_gp,
    fit_recursive,
    scales,
)
from planner.surrogate.models.fidelity_levels import FidelityLevel, Samples
from tests.support.mixture import Mixture, mix

# A simulation's grid: no noise, but perhaps what the kernel cannot follow, and enough points to
# tell an input that hardly matters. The spread is the likeliest on the development problems.
GRID_PRIOR = replace(averaged.GP_PRIOR, nugget=1e-5, length=1.0, length_spread=2.0, spread=3.0)
SHAPES = ("rbf", "matern52")
GRID_SHAPES = (*SHAPES, "rbf+linear", "rbf+quadratic")  # many samples can tell a trend
SOME = 64
BENDS = ("product", "rbf")
TREND, CORNER = 0.5, 2.0
ALIKE = 0.15  # sd of ρ about 1, where simulation and truth vary by the same amount
LONG, LONG_SPREAD, GENTLE = 3.0, 0.5, 0.5  # length scale and amplitude of a gentle discrepancy
# Before any data. AR1's ρ may be 0, so it forgives a simulation of no use; a GP cannot thank a good
# one. Chosen on `development_problems`: at three points the GP's share is error for nothing.
BELIEF = {"AR1": 0.7, "AR1-NARGP": 0.2, "GP": 0.1}


def fit_low(samples: Samples) -> Mixture:
    """The cheap level from its samples; fit it once, and keep it while measurements come in.

    Of many samples some tell which shape of kernel is worth fitting to all of them.
    """
    shapes = GRID_SHAPES
    if len(samples.y) > SOME:
        rows = np.linspace(0, len(samples.y) - 1, SOME).astype(int)
        some = Samples(samples.x[rows], samples.y[rows], samples.sd[rows])
        weights = mix({shape: fit_gp(some, shape, GRID_PRIOR) for shape in shapes}).weights
        shapes = (max(shapes, key=lambda shape: weights[shape]),)
    return mix({shape: fit_gp(samples, shape, GRID_PRIOR) for shape in shapes})


def fit_fused(
    measured: Samples, low: FidelityLevel, low_spread: float, nugget: float = 1e-3
) -> Mixture:
    """Mixture of AR1, AR1-NARGP and a GP that ignores the simulation.

    `low_spread` is the sd of the low level over the workspace, `nugget` the median prior of noise
    beyond the samples' sds, over the scale of the output: 1e-6 for values known to be exact.
    """
    fused, alone = (replace(p, nugget=nugget) for p in (averaged.AR1_PRIOR, averaged.GP_PRIOR))
    _, scale = scales(measured.y, low.predict(measured.x)[0], low_spread)
    families: dict[str, dict[str, AveragedModel]] = {
        "AR1": {
            name: fit_recursive(measured, low, low_spread, kernel, prior)
            for name, (kernel, prior) in _discrepancies(fused, measured.x.shape[1]).items()
        },
        "AR1-NARGP": {k: fit_ar1_nargp(measured, low, low_spread, k, fused) for k in BENDS},
        "GP": {k: fit_gp(measured, k, alone, scale) for k in SHAPES},
    }
    models = {f"{name}, {k}": m for name, family in families.items() for k, m in family.items()}
    belief = {
        f"{n}, {k}": BELIEF[n] / len(family) for n, family in families.items() for k in family
    }
    return mix(models, belief)


def _discrepancies(fused: OutputPrior, width: int) -> dict[str, tuple[str, OutputPrior]]:
    """Kernels and priors of AR1's discrepancy over `width` coordinates, by name.

    Chosen on `development_problems`. That ρ is near 1 and that the discrepancy is gentle is worth
    most where few points cannot tell, as for a robot's frequencies.
    """
    # A simulation may be off by a trend over the workspace as by an offset. The kernel's origin is
    # a corner of the workspace, far from where the trend's offset is small.
    out = {"linear": ("linear", replace(fused, amplitude=TREND, bias_sd=CORNER))}
    gentle = {
        "length": LONG / max(width, 1) ** 0.5, "length_spread": LONG_SPREAD, "amplitude": GENTLE,
    }  # fmt: skip
    for shape in SHAPES:
        out[shape] = shape, fused
        out[f"{shape}, gentle"] = shape, replace(fused, **gentle)
        out[f"{shape}, alike"] = shape, replace(fused, slope_sd=ALIKE)
        out[f"{shape}, gentle and alike"] = shape, replace(fused, slope_sd=ALIKE, **gentle)
    return out
