"""The frequency response matrix of one pose."""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, eq=False)
class Frf:
    """Accelerance matrix of one pose, estimated from its hits.

    `accelerance[i, j]` (m/s²/N) is the response along axis i of the sensor frame to a force along
    axis j of the tcp frame (i, j = x, y, z; parallel frames). Columns that were never hit are NaN
    and False in `measured`. `variance` is E|δH|² of each complex line (the variance of the
    estimate, not of one hit), NaN where unknown. `exponential_rate_1_s` is the decay rate of the
    exponential window that the records carry (0: none); poles fitted to this FRF are shifted left
    by exactly that rate and have to be shifted back. `tail_s` is the time from the pulse (its
    centroid) to the end of the transformed records, where no window but the exponential one was
    applied to them: decays cut off at the end are then part of the fitted model. ∞ where it is not
    known, as for exported FRFs. `force_share` is E|δF/F|² from the noise of the force,
    taken from a window of `force_window_s` around the pulse: so short that neighbouring lines, and
    all responses, share the error (`variance` holds it too, but line by line).
    """

    frequency_hz: np.ndarray  # (F,) uniform, increasing
    accelerance: np.ndarray  # (3, 3, F) complex
    variance: np.ndarray  # (3, 3, F)
    coherence: np.ndarray  # (3, 3, F) in [0, 1], NaN with a single hit
    hits: tuple[int, int, int]  # hits averaged per column
    usable_band_hz: tuple[float, float]  # where pulse, anti-alias and signal-to-noise allow use
    exponential_rate_1_s: float = 0.0
    remarks: tuple[str, ...] = ()
    tail_s: float = float("inf")
    force_share: np.ndarray | None = None  # (3, F), NaN like accelerance, None where unknown
    force_window_s: float = 0.0

    @property
    def measured(self) -> np.ndarray:
        """(3,) bool: which columns (hit axes) were measured."""
        return np.array(self.hits) > 0

    def within(self, band_hz: tuple[float, float]) -> "Frf":
        """The same on the lines of a band only, edges included; two at least, to keep the spacing.

        As it is where the band holds fewer.
        """
        low, high = band_hz
        kept = (self.frequency_hz >= low) & (self.frequency_hz <= high)
        if np.count_nonzero(kept) < 2:
            return self
        share = None if self.force_share is None else self.force_share[:, kept]
        return replace(
            self,
            frequency_hz=self.frequency_hz[kept],
            accelerance=self.accelerance[..., kept],
            variance=self.variance[..., kept],
            coherence=self.coherence[..., kept],
            force_share=share,
        )
