"""Comparing modes: MAC, and the alignment of measured modes with expected ones."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.modal.mode_matching import best, chances
from planner.modal.modes import ModalModel, Mode

# Odds, in units of −2 log likelihood, of an expected mode that was not found and of a measured
# mode that nobody expects; and the weight of 1 − MAC beside squared standard deviations.
MISSING_COST, SPURIOUS_COST, MAC_WEIGHT = 9.0, 9.0, 8.0
DEFAULT_SD = 0.1


@dataclass(frozen=True, eq=False)
class Alignment:
    """Which measured mode carries which label; `probability[k]` that label k is right."""

    modes: tuple[Mode | None, ...]
    probability: np.ndarray  # (k,)


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


def align(
    measured: ModalModel,
    expected_frequency_hz: np.ndarray,
    expected_shape: np.ndarray | None = None,
    expected_sd: np.ndarray | float = DEFAULT_SD,
) -> Alignment:
    """Label measured modes 1…k by what is expected.

    expected_frequency_hz (k,), increasing; expected_shape (k, 3) complex or None; expected_sd
    (k,) or one number: standard deviation of the log frequency. The order of frequencies is
    kept; an expected mode may be missing and a measured one unexpected, so one missing mode
    costs one label and shifts none. The probabilities sum over all alignments (forward and
    backward), not only the best.
    """
    expected = np.asarray(expected_frequency_hz, float)
    sd = np.broadcast_to(np.asarray(expected_sd, float), expected.shape)
    modes = sorted(measured.modes, key=lambda mode: mode.frequency_hz)
    gain = match_gain(modes, expected, expected_shape, sd)
    choice = best(gain, ordered=True)
    chance = chances(gain, ordered=True)
    labelled = tuple(None if j < 0 else modes[j] for j in choice)
    column = np.where(choice < 0, len(modes), choice)
    return Alignment(labelled, chance[np.arange(len(expected)), column])


def match_gain(
    modes: Sequence[Mode], expected: np.ndarray, shape: np.ndarray | None, sd: np.ndarray
) -> np.ndarray:
    """(k, modes): what each match is better than a missing mode and an unexpected one.

    Arguments as of `align`, of modes in any order.
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
