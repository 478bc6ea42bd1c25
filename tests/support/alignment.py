"""Measured modes labelled by expected ones in the order of their frequencies."""

from dataclasses import dataclass

import numpy as np

from planner.modal.mac import match_gain
from planner.modal.mode_matching import best, chances
from planner.modal.modes import ModalModel, Mode

DEFAULT_SD = 0.1


@dataclass(frozen=True, eq=False)
class Alignment:
    """Which measured mode carries which label; `probability[k]` that label k is right."""

    modes: tuple[Mode | None, ...]
    probability: np.ndarray  # (k,)


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
