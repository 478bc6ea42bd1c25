"""Decaying oscillations of a free response, with their amplitudes."""

from dataclasses import dataclass

import numpy as np

from planner.modal.estimate_modes import PoleIdentification
from planner.modal.free_decays import MAX_ORDER, identify_decays


@dataclass(frozen=True)
class Decay:
    """One decaying oscillation A·e^{−ζω₀t}·cos(…); the amplitude holds at the first sample.

    With several channels it is the largest among them, in the unit of the samples.
    """

    frequency_hz: float
    damping_ratio: float
    amplitude: float
    frequency_sd_hz: float
    damping_sd: float
    probability: float

    @property
    def energy(self) -> float:
        """∫x² dt of the decay, to which a short transient adds little."""
        return self.amplitude**2 / (8 * np.pi * self.damping_ratio * self.frequency_hz)


def ringdown(
    samples: np.ndarray,
    sampling_rate_hz: float,
    band_hz: tuple[float, float],
    max_order: int = MAX_ORDER,
) -> tuple[Decay, ...]:
    """Free decays in `band_hz`, greatest energy first; empty where there is none.

    samples (n,) or (channels, n): the free response, from after the excitation on.
    """
    free = np.atleast_2d(np.asarray(samples, float))[:, None, :]
    found = identify_decays(free, sampling_rate_hz, band_hz, max_order)
    if found is None:
        return ()
    decays = []
    for mode in found.modes:
        if band_hz[0] <= mode.frequency_hz <= band_hz[1]:
            decays.append(
                Decay(
                    mode.frequency_hz,
                    mode.damping_ratio,
                    float(
                        np.max(np.abs(amplitudes(mode.pole, mode.residue, found, free.shape[-1])))
                    ),
                    mode.frequency_sd_hz,
                    mode.damping_sd,
                    mode.probability,
                )
            )
    return tuple(sorted(decays, key=lambda decay: -decay.energy))


def amplitudes(
    pole: complex, residue: np.ndarray, found: PoleIdentification, samples: int
) -> np.ndarray:
    """Complex amplitude (channels, decays) at the first of so many samples: x ≈ Re(A e^{λt})."""
    step = found.data.step_s or 0.0
    # Σ_k A/2 p^k z^{-k} over n samples = A/2 (1 − pⁿ) z/(z − p) at the lines of the DFT.
    return 2 * residue / (1 - np.exp(pole * step * samples))
