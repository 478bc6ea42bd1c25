"""The frequency response matrix of one pose."""

from dataclasses import dataclass, replace

import numpy as np

from planner.recording.points import SENSOR, TCP, TOOL, Layout
from planner.recording.records import AXES


@dataclass(frozen=True, eq=False)
class Frf:
    """Accelerance matrix of one pose, estimated from its hits.

    `accelerance[i, j]` (m/s²/N) is the response along axis i of the sensor frame to a force along
    axis j of the tcp frame (i, j = x, y, z; parallel frames); between several points rows (r) and
    columns (c) go by threes as `layout` says, each in its own point's frame. What was not measured
    is NaN; columns that were never hit are False in `measured`. `variance` is E|δH|² of each
    complex line (the variance of the estimate, not of one hit), NaN where unknown.
    `exponential_rate_1_s` is the decay rate of the exponential window that the records carry (0:
    none); poles fitted to this FRF are shifted left by exactly that rate and have to be shifted
    back. `tail_s` is the time from the pulse (its centroid) to the end of the transformed records,
    where no window but the exponential one was applied to them: decays cut off at the end are then
    part of the fitted model. ∞ where it is not known, as for exported FRFs. `force_share` is
    E|δF/F|² from the noise of the force, taken from a window of `force_window_s` around the pulse:
    so short that neighbouring lines, and all responses, share the error (`variance` holds it too,
    but line by line).
    """

    frequency_hz: np.ndarray  # (F,) uniform, increasing
    accelerance: np.ndarray  # (r, c, F) complex
    variance: np.ndarray  # (r, c, F)
    coherence: np.ndarray  # (r, c, F) in [0, 1], NaN with a single hit
    hits: tuple[int, ...]  # hits averaged per column
    usable_band_hz: tuple[float, float]  # where pulse, anti-alias and signal-to-noise allow use
    exponential_rate_1_s: float = 0.0
    remarks: tuple[str, ...] = ()
    tail_s: float = float("inf")
    force_share: np.ndarray | None = None  # (c, F), NaN like accelerance, None where unknown
    force_window_s: float = 0.0
    layout: Layout = TOOL

    @property
    def measured(self) -> np.ndarray:
        """(c,) bool: which columns (hit axes) were measured."""
        return np.array(self.hits) > 0

    @property
    def of_tool(self) -> "Frf | None":
        """Hits at the tcp as the sensor there has them; None where no axis has all of its three."""
        if self.layout == TOOL:
            return self
        if TCP not in self.layout.hits or SENSOR not in self.layout.sensors:
            return None
        rows = self.layout.rows(TOOL)
        places = [i for i, name in enumerate(self.layout.hits) if name == TCP]
        known = np.isfinite(self.accelerance[rows]).all(axis=(0, 2)).reshape(-1, 3)
        best = max(places, key=lambda i: (known[i].sum(), sum(self.hits[3 * i : 3 * i + 3])))
        if not known[best].any():
            return None
        columns = 3 * best + np.arange(3)
        parts = {
            name: np.where(known[best][:, None], getattr(self, name)[rows][:, columns], np.nan)
            for name in ("accelerance", "variance", "coherence")
        }
        share = None if self.force_share is None else self.force_share[columns]
        counts = np.where(known[best], np.array(self.hits)[columns], 0).tolist()
        return replace(self, **parts, hits=tuple(counts), force_share=share, layout=TOOL)

    def within(self, band_hz: tuple[float, float]) -> "Frf":
        """The same on the lines of a band only, edges included; two at least, to keep the spacing.

        As it is where the band holds fewer.
        """
        low, high = band_hz
        kept = (self.frequency_hz >= low) & (self.frequency_hz <= high)
        if np.count_nonzero(kept) < 2:
            return self
        names = "frequency_hz", "accelerance", "variance", "coherence", "force_share"
        parts = {name: getattr(self, name) for name in names}
        return replace(self, **{k: v if v is None else v[..., kept] for k, v in parts.items()})


def unreciprocal(frf: Frf) -> tuple[str, ...]:
    """Remarks on pairs of axes of a tool's FRF (3, 3, F) that do not fit each other."""
    found = []
    h = frf.accelerance
    for i, j in ((0, 1), (0, 2), (1, 2)):
        entries = h[i, j], h[j, i], h[i, i], h[j, j]
        if not all(np.all(np.isfinite(entry)) for entry in entries):
            continue
        size = np.sqrt(np.linalg.norm(h[i, i]) * np.linalg.norm(h[j, j]))
        apart = float(np.linalg.norm(h[i, j] - h[j, i]) / max(size, 1e-300))
        # Of ‖H_ij − H_ji‖ over √(‖H_ii‖ ‖H_jj‖). Good poses have 0.05 to 0.35 where hits tilt by 2°
        # and the sensor sits at the tcp, and up to 0.75 where it sits beside it; a turned sign has
        # up to 2, an exchanged axis 1 and more. Chosen between.
        if apart > 0.9:
            found.append(
                f"Hits along {AXES[i]} felt along {AXES[j]} and hits along {AXES[j]} felt along "
                f"{AXES[i]} differ by {100 * apart:.0f} % of what is felt along the hits. Where "
                f"the sensor is at the tip they are alike: check axes and signs of hits and sensor."
            )
    return tuple(found)
