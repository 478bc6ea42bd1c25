"""Screening of hits: what a careful engineer would refuse while standing at the robot."""

import math
from dataclasses import dataclass

import numpy as np

from planner.recording.records import Fault, Hit

# Overload: so improbable is it that equal samples at the top are chance, judged by samples that
# lie below the top by a share of NEAR at most. A pulse of NARROW samples above its half is so sharp
# that two are equal in one of 300 at a step of COARSE of its peak.
BY_CHANCE, NEAR, NARROW, COARSE = 5e-4, 0.1, 6, 2e-3
LEAST_LINES = 8  # frequency lines in the band: fewer hold no mode
QUIET_SAMPLES, ANSWER_S = 12, 0.25  # from which noise is judged, and the answer to a hit
NOTHING = 1e-12  # N or m/s²: below, a channel is silent; chosen, far below any noise


@dataclass(frozen=True)
class ScreeningLimits:
    """When a hit is refused. Ratios are of the pulse's peak unless stated."""

    band_hz: tuple[float, float] = (4.0, 60.0)
    second_peak: float = 0.12
    least_snr: float = 8.0  # peak force over noise
    least_response_snr: float = 6.0  # of the strongest channel, soon after the pulse
    roll_off_db: float = 20.0  # force spectrum at the band's end, below its top in the band
    least_pretrigger: int = 2  # samples before the pulse


def screen(hit: Hit, limits: ScreeningLimits | None = None) -> tuple[Fault, ...]:
    """Faults of one hit by itself; those with `refuse` make it unusable."""
    limits, pulse = limits or ScreeningLimits(), hit.pulse
    if pulse.peak_n < NOTHING or np.max(np.abs(hit.acceleration_m_s2)) < NOTHING:
        return (Fault("dead", "Force or accelerations are zero throughout; check the cables."),)
    faults = [*_short(hit, limits), *_weak(hit, limits), *_clipping(hit)]
    if any(f.kind == "too_weak" for f in faults):
        return tuple(faults)
    return (
        *faults,
        *_polarity(hit),
        *_pulse_whole(hit, limits),
        *_double(hit, limits),
        *_soft(hit, limits),
    )


def _short(hit: Hit, limits: ScreeningLimits) -> list[Fault]:
    low, high = limits.band_hz
    record_s = len(hit.force_n) / hit.sampling_rate_hz
    if (high - low) * record_s >= LEAST_LINES:
        return []
    return [
        Fault(
            "too_short",
            f"The record of {record_s:.3g} s resolves nothing between {low:g} and {high:g} Hz; "
            f"record for longer, or correct the unit of the time.",
        )
    ]


def _weak(hit: Hit, limits: ScreeningLimits) -> list[Fault]:
    faults, peak, noise = [], hit.pulse.peak_n, hit.pulse.noise_n
    if peak < limits.least_snr * noise:
        faults.append(
            Fault(
                "too_weak",
                f"The force peak of {peak:.3g} N is only {peak / noise:.1f} times the noise; "
                f"hit harder.",
            )
        )
    for i, samples in enumerate(hit.acceleration_m_s2):
        if not np.any(samples - samples[0]):
            name = hit.label(i)
            faults.append(
                Fault("dead", f"The acceleration along {name} is constant; check its cable.")
            )
    ratio = _response_snr(hit)
    if ratio is not None and ratio < limits.least_response_snr:
        faults.append(
            Fault(
                "too_weak",
                f"The response is only {ratio:.1f} times the noise before the hit; hit harder.",
            )
        )
    return faults


def _response_snr(hit: Hit) -> float | None:
    """Rms of the strongest response, soon after the pulse, over the noise before it.

    None where the record holds no such time.
    """
    pulse, rate = hit.pulse, hit.sampling_rate_hz
    after = slice(pulse.first, pulse.first + max(QUIET_SAMPLES, round(ANSWER_S * rate)))
    if pulse.quiet < QUIET_SAMPLES:
        return None
    before = hit.acceleration_m_s2[:, : pulse.quiet]
    mean = np.mean(before, axis=1, keepdims=True)
    rounding = np.array([_step(samples) for samples in hit.acceleration_m_s2]) / np.sqrt(12)
    noise = np.hypot(np.std(before, axis=1), rounding)
    answer = np.sqrt(np.mean((hit.acceleration_m_s2[:, after] - mean) ** 2, axis=1))
    return float(np.max(answer / np.maximum(noise, NOTHING)))


def _clipping(hit: Hit) -> list[Fault]:
    """Overload leaves the top flat: several samples equal to the last digit."""
    faults = []
    channels = [("force", hit.force_n)]
    channels += [(f"acceleration {hit.label(i)}", s) for i, s in enumerate(hit.acceleration_m_s2)]
    for name, samples in channels:
        size = samples - np.median(samples)
        for sense in (1.0, -1.0):
            top = float(np.max(sense * size))
            equal = sense * size >= top * (1 - 1e-6)
            # A pulse has one top; a decaying response reaches the same top again and again.
            flat = _longest_run(equal) if name == "force" else int(np.sum(equal))
            if not _by_chance(np.maximum(sense * size, 0.0), flat, name == "force"):
                level = float(samples[int(np.argmax(sense * size))])
                faults.append(
                    Fault(
                        "clipped",
                        f"The {name} is clipped at {level:.4g} ({flat} samples); raise the "
                        f"channel's range or hit more softly.",
                    )
                )
                break
    return faults


def _by_chance(size: np.ndarray, flat: int, pulse: bool) -> bool:
    """Whether so many samples of |a channel| may be equal at its top without an overload.

    Stored in steps, samples fall upon the top as upon any other step nearby: as often as by the
    Poisson distribution. A pulse so narrow has a top so sharp that no two are equal.
    """
    top = float(np.max(size))
    if top <= 0 or flat < 2:
        return True
    step = _step(size)
    if pulse and int(np.sum(size > 0.5 * top)) <= NARROW and step < COARSE * top:
        return False
    if step > NEAR * top:
        return True  # of so few steps nobody could tell
    near = np.sum((size > (1 - NEAR) * top) & (size < top * (1 - 1e-6)))
    each = (float(near) + 1) * step / (NEAR * top)
    # Of the Poisson distribution: each^(flat−1) / (flat−1)!
    return (flat - 1) * math.log(each) - math.lgamma(flat) > math.log(BY_CHANCE)


def _step(samples: np.ndarray) -> float:
    """The step in which a converter stored samples (n,): least difference of any two."""
    steps = np.diff(np.unique(samples))
    steps = steps[steps > 1e-9 * np.max(np.abs(samples))]
    return float(np.min(steps)) if steps.size else 0.0


def _longest_run(mask: np.ndarray) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def _polarity(hit: Hit) -> list[Fault]:
    pulse = hit.pulse
    if hit.force_n[pulse.peak] > pulse.offset_n:
        return []
    return [
        Fault(
            "polarity",
            f"The force pulse of {pulse.peak_n:.3g} N is negative: a hammer only pushes; check the "
            f"polarity of the force channel.",
        )
    ]


def _pulse_whole(hit: Hit, limits: ScreeningLimits) -> list[Fault]:
    pulse, samples = hit.pulse, len(hit.force_n)
    if pulse.first < limits.least_pretrigger:
        return [Fault("truncated", "The pulse starts at the record's edge; set a pre-trigger.")]
    if pulse.end > samples - 8 or pulse.peak > 0.8 * samples:
        return [Fault("truncated", "The record ends right after the pulse; check the trigger.")]
    return []


def _double(hit: Hit, limits: ScreeningLimits) -> list[Fault]:
    """A second pulse: force that rises again after it had fallen.

    An anti-alias filter rings after a pulse, but what it adds above zero is never more than what
    it took below zero just before; a second push has no such counterpart.
    """
    pulse = hit.pulse
    force, peak = hit.force_n - pulse.offset_n, pulse.peak_n
    ringing = max(0.0, -float(np.min(force)))
    rest = np.concatenate([force[: max(0, pulse.first - 1)], force[pulse.end + 1 :]])
    second = float(np.max(rest, initial=0.0))
    valley = _valley(force[pulse.first : pulse.end])
    least = max(limits.second_peak * peak, 6 * pulse.noise_n, 1.5 * ringing)
    if max(second, valley) <= least:
        return []
    return [
        Fault(
            "double_hit",
            f"A second pulse of {max(second, valley):.3g} N follows the first of {peak:.3g} N; "
            f"hit once and let it bounce off.",
        )
    ]


def _valley(pulse: np.ndarray) -> float:
    """How far the force rises again inside one pulse, above the lowest point between two tops."""
    top = int(np.argmax(pulse))
    pulse = np.clip(pulse, 0.0, None)  # coming back from below zero is the filter's ringing
    rise = 0.0
    for side in (pulse[top:], pulse[top::-1]):
        lowest = np.minimum.accumulate(side)
        rise = max(rise, float(np.max(side - lowest)))
    return rise


def _soft(hit: Hit, limits: ScreeningLimits) -> list[Fault]:
    force = hit.force_n - np.median(hit.force_n)
    size = 1 << int(np.ceil(np.log2(4 * len(force))))
    spectrum = np.abs(np.fft.rfft(force, size))
    frequency = np.fft.rfftfreq(size, 1 / hit.sampling_rate_hz)
    low, high = limits.band_hz
    if high > 0.45 * hit.sampling_rate_hz:
        return [
            Fault(
                "too_slow",
                f"Sampled at {hit.sampling_rate_hz:g} Hz, the record cannot reach {high:g} Hz; "
                f"sample at {2.56 * high:.0f} Hz or faster.",
            )
        ]
    inside = spectrum[(frequency >= low) & (frequency <= high)]
    end = spectrum[(frequency >= 0.9 * high) & (frequency <= high)]
    if not inside.size or not end.size:
        return []
    drop = 20 * np.log10(np.max(inside) / max(float(np.mean(end)), 1e-30))
    if drop > limits.roll_off_db:
        return [
            Fault(
                "too_soft",
                f"The pulse is too soft: its spectrum has fallen by {drop:.0f} dB at "
                f"{high:g} Hz; use a harder tip.",
            )
        ]
    return []
