"""Where a hit is felt a passive structure takes power in: Im H ≥ 0 at a driving point."""

import numpy as np

from planner.recording.band_spectra import band_spectra
from planner.recording.points import SENSOR, TCP
from planner.recording.records import AXES, Fault, Hit

# Share of |Im H| over the band with the right sign. Right hits have 0.9 and more where the sensor
# sits near the point, hits of turned sign what is missing to 1. Chosen between.
TURNED = 0.2
FLOOR = 1e-3  # of the force's largest line, below which a line says nothing


def driving_point(hit: Hit, band_hz: tuple[float, float]) -> tuple[Fault, ...]:
    """A remark where the tool answers against the hit: sign of the hit, or polarity of a channel.

    The sensor has to be near the point that is hit; only hits at the tcp are judged.
    """
    own = hit.channels_of(SENSOR)
    if own is None or hit.hit_point != TCP or positive_share(own, band_hz) > TURNED:
        return ()
    axis = AXES[hit.axis_index]
    text = (
        f"The tool answers hits along {hit.axis} against their direction (Im H < 0 along {axis}, "
        f"where it is hit); check the sign of the axis and the polarity of force and acceleration."
    )
    return (Fault("driving_point", text, refuse=False),)


def positive_share(hit: Hit, band_hz: tuple[float, float]) -> float:
    """Share of |Im H|, in [0, 1], with the right sign; H of the hit's own axis, x, y, z heard."""
    force, answers = band_spectra(hit, band_hz, hit.pulse.offset_n)
    answer = answers[hit.axis_index]
    power = np.abs(force) ** 2
    strong = power > FLOOR**2 * np.max(power, initial=0.0)
    imag = np.imag(answer[strong] * force[strong].conj()) / power[strong]
    total = np.sum(np.abs(imag))
    return float(np.sum(imag[imag > 0]) / total) if total > 0 else 1.0
