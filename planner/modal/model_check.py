"""Does the model hold? Poles must not depend on how much of the band is fitted.

With the right number of modes and out-of-band terms, poles fitted to part of the lines differ
from those fitted to all by chance only, with covariance Cov(part) − Cov(all) (Hausman 1978).
What they differ by beyond that is an error of the model, not of the noise: heavily damped modes
that overlap, or modes outside the band that the out-of-band terms do not describe.
"""

import numpy as np

from planner.modal.fit_data import Data
from planner.modal.mode_selection import PoleFit, scales
from planner.modal.refine import evaluate

# Of the band's span, taken away above, then below; at most half of what lies beside a mode there,
# so that it is judged by lines that hold it.
CUT = 0.12
LEAST_LINES = 32
HELD = 1e-10  # of the information on the best held pole: below, rounding rules


def inflation(data: Data, fitted: PoleFit, shared: np.ndarray) -> np.ndarray:
    """(m,) factors ≥ 1 on the covariance of each mode for what noise does not explain.

    For poles in the s-plane (accelerance). `shared` (2m, 2m) is the covariance of the poles from
    errors that lines have in common: it moves the poles of parts of the band too.
    """
    refined, scale = fitted.refined, scales(data, fitted)
    m = refined.poles.size
    own, common = _pairs(refined.pole_covariance) * scale[:, None], _pairs(shared)
    factor = np.ones(m)
    for part, judged in _parts(data, refined.poles).items():
        moved, covariance = _step(data, fitted, slice(*part))
        k = np.array(judged)
        variance = np.maximum(_pairs(covariance) * scale[:, None], own)[k]
        by_chance = variance - own[k] + common[k]
        # An error of the model, too, moves a pole the farther the less the lines hold it. Real and
        # imaginary parts suffer from the same cause: one factor a mode.
        beyond = np.maximum(moved.reshape(2, m).T[k] ** 2 - by_chance, 0.0) / variance
        factor[k] = np.maximum(factor[k], 1 + np.max(beyond, axis=1))
    return factor


def _parts(data: Data, poles: np.ndarray) -> dict[tuple[int, int], list[int]]:
    """Ranges of lines, first and end, and the poles that each judges."""
    frequency = data.frequency_hz
    low, high = frequency[[0, -1]]
    cut = CUT * (high - low)
    found: dict[tuple[int, int], list[int]] = {}
    for k, hz in enumerate(np.abs(poles) / (2 * np.pi)):
        if not low < hz < high:
            continue
        below = int(np.searchsorted(frequency, low + min(cut, (hz - low) / 2)))
        above = int(np.searchsorted(frequency, high - min(cut, (high - hz) / 2)))
        for part in ((0, above), (below, frequency.size)):
            if part[1] - part[0] >= LEAST_LINES:
                found.setdefault(part, []).append(k)
    return found


def _step(data: Data, fitted: PoleFit, part: slice) -> tuple[np.ndarray, np.ndarray]:
    """How the poles move (2m,) when part of the lines is fitted, and their covariance (2m, 2m).

    Linearised where all lines have them: poles that a part does not hold would stray in a fit, to
    where their variance is that of another place.
    """
    refined = fitted.refined
    weight = 2 / fitted.variance[..., part].reshape(data.entries, -1)
    response = data.response[..., part].reshape(data.entries, -1)
    point = evaluate(data.lines.part(part), response, weight, refined.poles)
    unit = np.sqrt(np.maximum(np.diag(refined.pole_covariance), 1e-300))
    turned = np.outer(unit, unit)
    covariance = np.linalg.pinv(point.normal * turned, rcond=HELD, hermitian=True) * turned
    return -covariance @ point.gradient, covariance


def _pairs(covariance: np.ndarray) -> np.ndarray:
    """(m, 2) variances of the real and imaginary parts of the poles."""
    return np.maximum(np.diag(covariance), 0.0).reshape(2, -1).T
