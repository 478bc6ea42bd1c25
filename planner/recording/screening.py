"""Screening of hits: what a careful engineer would refuse while standing at the robot.

Where a hit is felt a passive structure takes power in: Im H ≥ 0 at a driving point.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from planner.recording.channel_faults import channel_faults, step
from planner.recording.points import SENSOR, TCP
from planner.recording.records import AXES, Fault, Hit
from planner.words import significant

LEAST_LINES = 8  # frequency lines in the band: fewer hold no mode
QUIET_SAMPLES, ANSWER_S = 12, 0.25  # from which noise is judged, and the answer to a hit
SILENCE = 1e-12  # N or m/s²: below, a channel is silent; chosen, far below any noise
# When a hit is refused.
SECOND_PEAK = 0.12  # of the pulse's peak
LEAST_SNR = 8.0  # peak force over noise
LEAST_RESPONSE_SNR = 6.0  # of the strongest channel, soon after the pulse
ROLL_OFF_DB = 20.0  # force spectrum at the band's end, below its top in the band
LEAST_PRETRIGGER = 2  # samples before the pulse
# From this line on (the first ones hold offsets and drift), to where the usual pulse has lost so
# much; a hit that has lost twice as much (in dB) there is refused as too soft. Beyond a share of
# the sampling rate anti-alias filters act.
FIRST_LINE, LOST_DB, OF_RATE = 3, 10.0, 0.44
# Share of |Im H| over the band with the right sign. Right hits have 0.9 and more where the sensor
# sits near the point, hits of turned sign what is missing to 1. Chosen between.
TURNED = 0.2
FLOOR = 1e-3  # of the force's largest line, below which a line says nothing


def screen(hit: Hit, band_hz: tuple[float, float]) -> tuple[Fault, ...]:
    """Faults of one hit by itself; those with `refuse` make it unusable."""
    pulse = hit.pulse
    if pulse.peak_n < SILENCE or np.max(np.abs(hit.acceleration_m_s2)) < SILENCE:
        text = "Force or accelerations are zero throughout; check the cables."
        return (*hit.faults, Fault("dead", text))
    (low, high), record_s = band_hz, len(hit.force_n) / hit.sampling_rate_hz
    faults = [*hit.faults]
    if (high - low) * record_s < LEAST_LINES:
        text = f"The record of {record_s:.3g} s resolves nothing between {low:g} and {high:g} Hz"
        remedy = "record for longer, or correct the unit of the time."
        faults.append(Fault("too_short", f"{text}; {remedy}"))
    faults += [*_weak(hit), *channel_faults(hit)]
    if any(f.kind == "too_weak" for f in faults):
        return tuple(faults)
    return (*faults, *_pulse(hit), *_double(hit), *_soft(hit, band_hz))


def _weak(hit: Hit) -> Iterator[Fault]:
    pulse, peak, noise = hit.pulse, hit.pulse.peak_n, hit.pulse.noise_n
    if peak < LEAST_SNR * noise:
        text = (
            f"The force peak of {significant(peak, 3)} N is only {peak / noise:.1f} times the noise"
        )
        yield Fault("too_weak", f"{text}; hit harder.")
    if pulse.quiet < QUIET_SAMPLES or any(fault.kind == "not_at_rest" for fault in hit.faults):
        return
    # Rms of the strongest response, soon after the pulse, over the noise before it
    samples = hit.acceleration_m_s2
    mean = np.mean(samples[:, : pulse.quiet], axis=1, keepdims=True)
    rounding = np.array([step(channel) for channel in samples]) / np.sqrt(12)
    before = np.hypot(np.std(samples[:, : pulse.quiet], axis=1), rounding)
    long = max(QUIET_SAMPLES, round(ANSWER_S * hit.sampling_rate_hz))
    after = samples[:, pulse.first : pulse.first + long] - mean
    ratio = float(np.max(np.sqrt(np.mean(after**2, axis=1)) / np.maximum(before, SILENCE)))
    if ratio < LEAST_RESPONSE_SNR:
        text = f"The response is only {ratio:.1f} times the noise before the hit; hit harder."
        yield Fault("too_weak", text)


def _pulse(hit: Hit) -> Iterator[Fault]:
    pulse, samples = hit.pulse, len(hit.force_n)
    if hit.force_n[pulse.peak] <= pulse.offset_n:
        text = f"The force pulse of {significant(pulse.peak_n, 3)} N is negative: a hammer only"
        yield Fault("polarity", f"{text} pushes; check the polarity of the force channel.")
    if pulse.first < LEAST_PRETRIGGER:
        yield Fault("truncated", "The pulse starts at the record's edge; set a pre-trigger.")
    elif pulse.end > samples - 8 or pulse.peak > 0.8 * samples:
        yield Fault("truncated", "The record ends right after the pulse; check the trigger.")


def _double(hit: Hit) -> Iterator[Fault]:
    """A second pulse: force that rises again after it had fallen.

    An anti-alias filter rings after a pulse, but what it adds above zero is never more than what
    it took below zero just before; a second push has no such counterpart.
    """
    pulse = hit.pulse
    force, peak = hit.force_n - pulse.offset_n, pulse.peak_n
    ringing = max(0.0, -float(np.min(force)))
    rest = np.concatenate([force[: max(0, pulse.first - 1)], force[pulse.end + 1 :]])
    second = float(np.max(rest, initial=0.0))
    # How far the force rises again above the lowest point between two tops of the pulse; coming
    # back from below zero is the filter's ringing.
    inside = np.clip(force[pulse.first : pulse.end], 0.0, None)
    top = int(np.argmax(inside))
    sides = inside[top:], inside[top::-1]
    valley = max(float(np.max(side - np.minimum.accumulate(side))) for side in sides)
    least = max(SECOND_PEAK * peak, 6 * pulse.noise_n, 1.5 * ringing)
    if max(second, valley) > least:
        text = f"A second pulse of {significant(max(second, valley), 3)} N follows the first of"
        text += f" {significant(peak, 3)} N; hit once and let it bounce off."
        yield Fault("double_hit", text)


def _soft(hit: Hit, band_hz: tuple[float, float]) -> Iterator[Fault]:
    force = hit.force_n - np.median(hit.force_n)
    size = 1 << int(np.ceil(np.log2(4 * len(force))))
    spectrum = np.abs(np.fft.rfft(force, size))
    frequency = np.fft.rfftfreq(size, 1 / hit.sampling_rate_hz)
    low, high = band_hz
    last = 0.45 * hit.sampling_rate_hz
    inside = spectrum[(frequency >= low) & (frequency <= high)]
    end = spectrum[(frequency >= 0.9 * high) & (frequency <= high)]
    if high > last:
        yield Fault(
            "too_slow",
            f"Sampled at {hit.sampling_rate_hz:g} Hz, its FRFs end at {last:.4g} Hz, before the "
            f"end of the band of {low:g} to {high:g} Hz; sample at {2.56 * high:.0f} Hz or faster, "
            f"state the unit where times are in ms, or give another band (--band-hz; [modes] "
            f"band_hz).",
        )
    elif inside.size and end.size:
        drop = 20 * np.log10(np.max(inside) / max(float(np.mean(end)), 1e-30))
        if drop > ROLL_OFF_DB:
            text = f"The pulse is too soft: its spectrum has fallen by {drop:.0f} dB at {high:g} Hz"
            yield Fault("too_soft", f"{text}; use a harder tip.")


def band_spectra(
    hit: Hit,
    band_hz: tuple[float, float],
    rest_n: float,
    samples: int | None = None,
    rate_hz: float | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Force (F,) along the axis and accelerations (r, F) over the band's lines.

    `rest_n` is what the force channel shows without a force; only the first `samples` are taken.
    `rate_hz` is that of hits it is compared with, which a rounded time column tells slightly off.
    """
    count = len(hit.force_n) if samples is None else samples
    frequency = np.fft.rfftfreq(count, 1 / (rate_hz or hit.sampling_rate_hz))
    inside = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    force = np.fft.rfft((hit.sign * (hit.force_n - rest_n))[:count])[inside]
    rest = np.median(hit.acceleration_m_s2, axis=1, keepdims=True)
    response = np.fft.rfft((hit.acceleration_m_s2 - rest)[:, :count], axis=1)[:, inside]
    return force, response


def excited_band(hits: Sequence[Hit]) -> tuple[float, float]:
    """Lowest and highest frequency in Hz to three digits, by the median of hits (n ≥ 1)."""
    bands = []
    for hit in hits:
        pulse, rate, samples = hit.pulse, hit.sampling_rate_hz, len(hit.force_n)
        first, end = pulse.around(samples)
        spectrum = np.abs(np.fft.rfft(hit.force_n[first:end] - pulse.offset_n, samples))
        lost = spectrum < np.max(spectrum) * 10 ** (-LOST_DB / 20)
        lost[: int(np.argmax(spectrum))] = False
        line = int(np.argmax(lost)) if lost.any() else samples // 2
        bands.append((FIRST_LINE * rate / samples, min(line / samples, OF_RATE) * rate))
    low, high = np.median(bands, axis=0)
    return float(f"{low:.3g}"), float(f"{high:.3g}")


def driving_point(hit: Hit, band_hz: tuple[float, float]) -> tuple[Fault, ...]:
    """A remark where the tool answers against the hit: sign of the hit, or polarity of a channel.

    The sensor has to be near the point that is hit; only hits at the tcp are judged.
    """
    own = hit.channels_of(SENSOR)
    if own is None or hit.hit_point != TCP:
        return ()
    force, answers = band_spectra(own, band_hz, own.pulse.offset_n)
    power = np.abs(force) ** 2
    strong = power > FLOOR**2 * np.max(power, initial=0.0)
    answer = answers[own.axis_index, strong]
    imag = np.imag(answer * force[strong].conj()) / power[strong]
    total = np.sum(np.abs(imag))
    if not total > 0 or np.sum(imag[imag > 0]) / total > TURNED:
        return ()
    axis = AXES[hit.axis_index]
    text = (
        f"The driving-point FRF of hits along {hit.axis} has the wrong sign (imaginary part of "
        f"acceleration/force below 0 along {axis}): check the sign of the axis and the polarity of "
        f"force and acceleration."
    )
    return (Fault("driving_point", text, refuse=False),)
