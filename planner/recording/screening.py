"""Screening of hits: what a careful engineer would refuse while standing at the robot."""

import math
from dataclasses import dataclass

import numpy as np

from planner.recording.force_levels import levels, peak_n
from planner.recording.records import AXES, Fault, Hit

# Likeness of repeats: below the first, and by so much below what is usual, they are unlike; above
# the last they are the same. Chosen.
UNLIKE, FAR_BELOW, LIKE = 0.5, 0.3, 0.8
# Overload: so improbable is it that equal samples at the top are chance, judged by samples that
# lie below the top by a share of NEAR at most. A pulse of NARROW samples above its half is so sharp
# that two are equal in one of 300 at a step of COARSE of its peak.
BY_CHANCE, NEAR, NARROW, COARSE = 5e-4, 0.1, 6, 2e-3
MOST_TILT = 0.1  # rad: three times what a hand usually tilts by
WHOLE = 0.5  # share of another axis' FRF that is no tilt: that axis was hit
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


def screen_repeats(
    hits: tuple[Hit, ...], band_hz: tuple[float, float]
) -> tuple[tuple[Fault, ...], ...]:
    """Per hit, whether its FRF disagrees with the others of its axis (wrong axis, incoherent).

    Only hits at one point that the same sensors heard are compared, and where three or more were
    made along an axis; a robust vote needs a majority. What a careful hand misses by is no
    disagreement, and what only sets one force level apart from another may be the structure: that
    is for the diagnosis to say.
    """
    faults: list[tuple[Fault, ...]] = [() for _ in hits]
    for place in {(hit.hit_point, hit.responses) for hit in hits}:
        own = [i for i, hit in enumerate(hits) if (hit.hit_point, hit.responses) == place]
        found = _screen_alike(tuple(hits[i] for i in own), band_hz)
        for i, one in zip(own, found, strict=True):
            faults[i] = one
    return tuple(faults)


def _screen_alike(
    hits: tuple[Hit, ...], band_hz: tuple[float, float]
) -> tuple[tuple[Fault, ...], ...]:
    """The same of hits at one point that the same sensors heard."""
    faults: list[tuple[Fault, ...]] = [() for _ in hits]
    shortest = min(len(hit.force_n) for hit in hits)
    frfs = np.array([_frf(hit, shortest, band_hz) for hit in hits])
    axes = np.array([hit.axis_index for hit in hits])
    level = _levels(hits)
    centres = {axis: _centre(frfs[axes == axis]) for axis in set(axes.tolist())}
    for axis, centre in centres.items():
        group = np.flatnonzero(axes == axis)
        if len(group) < 3:
            continue
        across = {other: c for other, c in centres.items() if other != axis}
        own = _Agreement(centre, tuple(across.values()))
        alike = np.array([own.of(frf) for frf in frfs[group]])
        typical = float(np.median(alike))
        for i, share in zip(group.tolist(), alike, strict=True):
            usual = share > UNLIKE or share > typical - FAR_BELOW
            if usual and not _struck(frfs[i], centre, across):
                continue
            same = [frfs[j] for j in group if j != i and level[j] == level[i]]
            told = _disagreement(frfs[i], own, across, same)
            if told:
                kind, text = told
                faults[i] = (
                    Fault(
                        kind,
                        f"Its FRF {text} (likeness {share:.2f}, others {typical:.2f}); check axis "
                        f"and hit point, and hit again.",
                    ),
                )
    return tuple(faults)


def likeness_to(hit: Hit, others: tuple[Hit, ...], band_hz: tuple[float, float]) -> float:
    """How alike a hit's FRF and those of `others` along its axis are, in size too; 0: none such."""
    same = [
        other for other in others
        if other.axis_index == hit.axis_index and other.sampling_rate_hz == hit.sampling_rate_hz
        and (other.hit_point, other.responses) == (hit.hit_point, hit.responses)
    ]  # fmt: skip
    if not same:
        return 0.0
    shortest = min(len(one.force_n) for one in (hit, *same))
    frf = _frf(hit, shortest, band_hz)
    centre = _centre(np.array([_frf(other, shortest, band_hz) for other in same]))
    sizes = np.linalg.norm(frf), np.linalg.norm(centre)
    return _likeness(frf, centre) * float(min(sizes) / max(*sizes, NOTHING))


@dataclass(frozen=True, eq=False)
class _Agreement:
    """How hits along an axis are answered, and in `across` those along the others."""

    centre: np.ndarray
    across: tuple[np.ndarray, ...]

    def of(self, frf: np.ndarray) -> float:
        """Likeness of an FRF, had it been tilted to the axis as far as hands tilt at most."""
        if not self.across:
            return _likeness(frf, self.centre)
        off = untilted((frf - self.centre)[None], np.array(self.across))[0]
        return _likeness(self.centre + off, self.centre)


def untilted(off: np.ndarray, across: np.ndarray) -> np.ndarray:
    """By what FRFs (n, N) of hits along an axis differ, without what tilts of the hits explain.

    A tilt adds a little of the FRFs `across` (k, N) of the other axes; MOST_TILT rad is the most.
    """
    normal = (across.conj() @ across.T).real
    tilts = np.linalg.lstsq(normal, (off @ across.conj().T).real.T, rcond=None)[0]
    return off - np.clip(tilts, -MOST_TILT, MOST_TILT).T @ across


def _disagreement(
    frf: np.ndarray, own: _Agreement, across: dict[int, np.ndarray], same: list[np.ndarray]
) -> tuple[str, str] | None:
    """Kind and text where an FRF that is unlike others of its axis is a mistake."""
    if own.of(-frf) > UNLIKE:  # modes that move make FRFs unlike, never opposite
        return "wrong_axis", "has the opposite sign of the others"
    for axis, centre in across.items():
        if abs(_likeness(frf, centre)) > LIKE:
            return "wrong_axis", f"is that of hits along {AXES[axis]}"
    # A structure that is not linear answers each level differently: only hits of the same force
    # count, if they agree with each other or with all.
    if any(_Agreement(one, own.across).of(frf) > LIKE for one in same):
        return None
    voters = [*same, own.centre]
    agreed = any(_likeness(a, b) > LIKE for i, a in enumerate(voters) for b in voters[:i])
    if not agreed:
        return None
    return "incoherent", "does not agree with the others of its axis"


def _struck(frf: np.ndarray, own: np.ndarray, across: dict[int, np.ndarray]) -> bool:
    """Whether an FRF is that of another axis in size too: no tilt brings in so much of it."""
    plain = _likeness(frf, own)
    return any(
        abs(_likeness(frf, other)) > max(LIKE, plain + FAR_BELOW)
        and abs(np.vdot(other, frf)) > WHOLE * np.linalg.norm(other) ** 2
        for other in across.values()
    )


def _levels(hits: tuple[Hit, ...]) -> np.ndarray:
    """Which force level each hit belongs to."""
    groups = levels(np.sort([peak_n(hit) for hit in hits]))
    weakest = [group[0] for group in groups[1:]]
    return np.searchsorted(weakest, [peak_n(hit) for hit in hits], side="right")


def _centre(frfs: np.ndarray) -> np.ndarray:
    return np.median(frfs.real, axis=0) + 1j * np.median(frfs.imag, axis=0)


def _frf(hit: Hit, samples: int, band_hz: tuple[float, float]) -> np.ndarray:
    """FRF (3·F,) of a hit's first samples over the band's lines."""
    frequency = np.fft.rfftfreq(samples, 1 / hit.sampling_rate_hz)
    inside = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    force = hit.sign * (hit.force_n - np.median(hit.force_n))
    force = np.fft.rfft(force[:samples])[inside]
    mean = np.median(hit.acceleration_m_s2, axis=1, keepdims=True)
    response = np.fft.rfft((hit.acceleration_m_s2 - mean)[:, :samples], axis=1)[:, inside]
    floor = 1e-3 * np.max(np.abs(force))
    return (response * force.conj() / np.maximum(np.abs(force) ** 2, floor**2)).ravel()


def _likeness(frf: np.ndarray, centre: np.ndarray) -> float:
    """1 where two FRFs are the same in size, sign and phase; 0 or less where unrelated."""
    scale = np.linalg.norm(frf) * np.linalg.norm(centre)
    return float(np.real(np.vdot(centre, frf)) / scale) if scale > 0 else 0.0
