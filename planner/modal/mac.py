"""Comparing modes: MAC, and how well measured modes match expected ones."""

import math
from collections.abc import Sequence

import numpy as np

from planner.modal.modes import Mode

# Odds, in units of −2 log likelihood, of an expected mode that was not found and of a measured
# mode that nobody expects; and the weight of 1 − MAC beside squared standard deviations.
MISSING_COST, SPURIOUS_COST, MAC_WEIGHT = 9.0, 9.0, 8.0


def mac(a: np.ndarray, b: np.ndarray) -> float:
    """Modal assurance criterion |aᴴb|²/(aᴴa·bᴴb) of two shapes (n,), complex; in [0, 1]."""
    return float(mac_matrix(np.asarray(a)[None], np.asarray(b)[None])[0, 0])


def mac_matrix(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """MAC of every shape in a (k, n) with every one in b (l, n); 0 where a shape is zero."""
    unit_a, unit_b = _unit(a), _unit(b)
    return np.clip(np.abs(unit_a.conj() @ unit_b.T) ** 2, 0.0, 1.0)


def _unit(shapes: np.ndarray) -> np.ndarray:
    shapes = np.asarray(shapes, complex)
    largest = np.max(np.abs(shapes), axis=-1, keepdims=True)
    shapes = np.divide(shapes, largest, out=np.zeros_like(shapes), where=largest > 0)
    norm = np.linalg.norm(shapes, axis=-1, keepdims=True)
    return np.divide(shapes, norm, out=np.zeros_like(shapes), where=norm > 0)


def match_gain(
    modes: Sequence[Mode], expected: np.ndarray, shape: np.ndarray | None, sd: np.ndarray
) -> np.ndarray:
    """(k, modes): what each match is better than a missing mode and an unexpected one.

    Frequencies `expected` (k,) and shapes (k, 3), complex, or None; sd (k,) of the logarithm of the
    frequency.
    """
    spurious = np.array([unexpected_cost(mode) for mode in modes])
    return MISSING_COST + spurious - _match_cost(modes, expected, shape, sd)


def _match_cost(
    modes: Sequence[Mode], expected: np.ndarray, shape: np.ndarray | None, sd: np.ndarray
) -> np.ndarray:
    if not modes or not expected.size:
        return np.zeros((expected.size, len(modes)))
    frequency = np.array([mode.frequency_hz for mode in modes])
    own = np.array([mode.frequency_sd_hz / mode.frequency_hz for mode in modes])
    own = np.where(np.isfinite(own), own, 0.0)
    spread = sd[:, None] ** 2 + own**2
    cost = np.log(frequency / expected[:, None]) ** 2 / spread
    if shape is not None:
        measured = np.array([mode.shape for mode in modes])
        cost += MAC_WEIGHT * (1 - mac_matrix(np.asarray(shape), measured))
    return cost


def unexpected_cost(mode: Mode) -> float:
    chance = min(max(mode.probability, 1e-3), 1 - 1e-3)
    return SPURIOUS_COST + 2 * math.log(chance / 0.9)
