"""Does the model hold? Poles must not depend on how much of the band is fitted.

With the right number of modes and out-of-band terms, poles fitted to part of the lines differ
from those fitted to all by chance only, with covariance Cov(part) − Cov(all) (Hausman 1978).
What they differ by beyond that is an error of the model, not of the noise: heavily damped modes
that overlap, or modes outside the band that the out-of-band terms do not describe.
"""

import numpy as np

from planner.modal.fit_data import Data
from planner.modal.mode_selection import PoleFit, scales
from planner.modal.refine import Refined, refine

CUT = 0.12  # of the band's span, taken away above, then below
LEAST_LINES = 32
MAX_ITERATIONS = 8  # the start is next to the answer


def inflation(data: Data, fitted: PoleFit, shared: np.ndarray) -> np.ndarray:
    """(m,) factors ≥ 1 on the covariance of each mode for what noise does not explain.

    For poles in the s-plane (accelerance). `shared` (2m, 2m) is the covariance of the poles from
    errors that lines have in common: it moves the poles of parts of the band too.
    """
    refined, scale = fitted.refined, scales(data, fitted)
    m = refined.poles.size
    common = np.diag(shared).reshape(2, m).T
    own = _variance(refined) * scale[:, None]
    extra = np.zeros((m, 2))
    for part in _parts(data):
        other = _fit(data, fitted, part)
        apart = other.poles - refined.poles
        square = np.stack([apart.real**2, apart.imag**2], axis=1)
        by_chance = np.maximum(_variance(other) * scale[:, None] - own, 0.0)
        extra = np.maximum(extra, square - by_chance - common)
    # One factor a mode: real and imaginary parts suffer from the same cause.
    return 1 + np.max(np.maximum(extra, 0.0) / np.maximum(own, 1e-300), axis=1)


def _parts(data: Data) -> list[slice]:
    frequency = data.frequency_hz
    step = CUT * (frequency[-1] - frequency[0])
    below = int(np.searchsorted(frequency, frequency[0] + step))
    above = int(np.searchsorted(frequency, frequency[-1] - step))
    parts = [slice(0, above), slice(below, frequency.size)]
    return [p for p in parts if p.stop - p.start >= LEAST_LINES]


def _fit(data: Data, fitted: PoleFit, part: slice) -> Refined:
    return refine(
        data.lines.part(part),
        data.response[..., part],
        fitted.variance[..., part],
        fitted.refined.poles,
        data.allowed,
        max_iterations=MAX_ITERATIONS,
    )


def _variance(refined: Refined) -> np.ndarray:
    """(m, 2) variances of the real and imaginary parts of the poles."""
    m = refined.poles.size
    diagonal = np.maximum(np.diag(refined.pole_covariance), 0.0)
    return np.stack([diagonal[:m], diagonal[m:]], axis=1)
