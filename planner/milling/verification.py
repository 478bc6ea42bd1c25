"""What a coupled result says of the target's resonances, and the hit that would verify it."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks

from planner.milling.coupling import CoupledFrf
from planner.recording.records import AXES

PROMINENT = 0.02  # of the largest peak of the three directions: smaller ones are not listed


@dataclass(frozen=True)
class Resonance:
    """A peak of a direct FRF: size in m/N, its relative sd, how errors grew there."""

    direction: str
    frequency_hz: float
    receptance_m_n: float
    sd_percent: float
    amplification: float


@dataclass(frozen=True)
class VerifyingHit:
    """A hit at the target's tip where the coupled FRF is least sure, and what to expect of it.

    `expected_m_n` and `sd_m_n` are receptance and sd at `frequency_hz`, read along the hit.
    """

    hit: str
    frequency_hz: float
    expected_m_n: float
    sd_m_n: float

    @property
    def sentence(self) -> str:
        """What to do."""
        if not self.sd_m_n > 0:
            return (
                f"To verify: hit the target's tip along {self.hit} and read {self.hit[1]} there; "
                f"expect {1e6 * self.expected_m_n:.3g} µm/N at {self.frequency_hz:.4g} Hz."
            )
        return (
            f"To verify: hit the target's tip along {self.hit} and read {self.hit[1]} there; "
            f"expect {1e6 * self.expected_m_n:.3g} ± {1e6 * self.sd_m_n:.2g} µm/N at "
            f"{self.frequency_hz:.4g} Hz, where it is least sure."
        )


def resonances(coupled: CoupledFrf) -> tuple[Resonance, ...]:
    """Peaks of the direct FRFs, direction by direction, by frequency."""
    size = np.nan_to_num(np.abs(coupled.receptance[range(3), range(3)]))
    found = []
    for k in range(3):
        for line in find_peaks(size[k])[0]:
            if size[k, line] >= PROMINENT * size.max():
                relative = 100 * coupled.sd[k, k, line] / size[k, line]
                found.append(
                    Resonance(
                        AXES[k], float(coupled.frequency_hz[line]), float(size[k, line]),
                        float(relative), float(coupled.amplification[line]),
                    )
                )  # fmt: skip
    return tuple(found)


def verifying_hit(coupled: CoupledFrf) -> VerifyingHit:
    """The direction and resonance at whose peak the receptance is least sure.

    By its absolute sd, for a resonance matters to the cut by its size; without any sd the largest.
    """
    peaks = resonances(coupled)
    if peaks:
        sd = [p.receptance_m_n * p.sd_percent for p in peaks]
        size = [p.receptance_m_n for p in peaks]
        best = peaks[int(np.argmax(sd if max(sd) > 0 else size))]
        axis = AXES.index(best.direction)
        line = int(np.argmin(np.abs(coupled.frequency_hz - best.frequency_hz)))
    else:
        direct = np.nan_to_num(np.abs(coupled.receptance[range(3), range(3)]))
        axis, line = (int(k) for k in np.unravel_index(np.argmax(direct), direct.shape))
    return VerifyingHit(
        f"+{AXES[axis]}",
        float(coupled.frequency_hz[line]),
        float(np.abs(coupled.receptance[axis, axis, line])),
        float(coupled.sd[axis, axis, line]),
    )
