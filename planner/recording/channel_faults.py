"""What single channels show to be no measurement: dead, overloaded, filled up, samples lost."""

import math
from dataclasses import replace

import numpy as np

from planner.recording.records import Channel, Fault, Hit, TimeRecord, find_pulse

# Overload: so improbable is it that equal samples at the top are chance, judged by samples that
# lie below the top by a share of NEAR at most. A pulse of NARROW samples above its half is so sharp
# that two are equal in one of 300 at a step of COARSE of its peak.
BY_CHANCE, NEAR, NARROW, COARSE = 5e-4, 0.1, 6, 2e-3

# A channel that stands still does so by its resolution, or because nothing was measured. By its
# resolution it rests for longer and longer while it moves by less and less.
# How a channel moves is judged by so many of its changes: where it fades below its resolution, the
# last ones cover two or three of its steps. It moves where they cover more than STEPS, and rests
# unlike before beyond LONGER times their longest rest. One channel alone has to be surer: SURELY
# steps. SKEW: samples by which channels may end one before the other; fewer are not worth a word.
# All chosen.
CHANGES, STEPS, SURELY, LONGER, SKEW = 8, 4.0, 12.0, 4, 16


def _rest(samples: np.ndarray) -> tuple[int, float]:
    """Of a channel (n,) that is not constant: from which sample on it has its last value, and by
    how many steps it moved until then; 0 where it may rest by its resolution.
    """
    start = int(np.flatnonzero(samples != samples[-1])[-1]) + 1
    before = samples[:start]
    changes = np.flatnonzero(np.diff(before))[-CHANGES:]
    usual = np.max(np.diff(changes), initial=0)
    if len(changes) < CHANGES or len(samples) - start <= max(SKEW, LONGER * usual):
        return start, 0.0
    return start, float(np.ptp(before[changes[0] :]) / step(before))


def channel_faults(hit: Hit) -> tuple[Fault, ...]:
    """Faults of the force and of each acceleration by itself."""
    force = _overload("force", "N", hit.force_n, pulse=True)
    answers = (_of_acceleration(hit, row) for row in range(len(hit.responses)))
    return tuple(fault for fault in (force, *answers) if fault is not None)


def by_good_sensors(hit: Hit) -> tuple[Hit, tuple[Fault, ...]]:
    """The hit as its good sensors have it, and remarks on channels of the others.

    A sensor with a channel that cannot be used is left out, where another one is whole; where
    none is the hit stays as it was, to be refused.
    """
    found = [_of_acceleration(hit, row) for row in range(len(hit.responses))]
    named = [dof.node for dof in hit.responses]
    bad = {node for node, fault in zip(named, found, strict=True) if fault}
    good = [row for row, node in enumerate(named) if node not in bad]
    if not bad or not good:
        return hit, ()
    but = "The other sensors of this hit are used, the one at {} is not."
    told = (
        Fault(fault.kind, f"{fault.text} {but.format(node)}", refuse=False)
        for node, fault in zip(named, found, strict=True) if fault
    )  # fmt: skip
    return hit.with_channels(good), tuple(told)


def _of_acceleration(hit: Hit, row: int) -> Fault | None:
    samples, name = hit.acceleration_m_s2[row], hit.label(row)
    if not np.any(samples - samples[0]):
        text = f"The acceleration along {name} is constant"
        return Fault("dead", f"{text}; check the cable of {name}.")
    start, steps = _rest(samples)
    if steps > SURELY:
        seconds = (len(samples) - start) / hit.sampling_rate_hz
        text = f"The acceleration along {name} repeats one value for the last {seconds:.2g} s"
        return Fault("dead", f"{text}, though it moved until then; check the cable of {name}.")
    return _overload(f"acceleration {name}", "m/s²", samples, pulse=False)


def _overload(name: str, unit: str, samples: np.ndarray, pulse: bool) -> Fault | None:
    """Overload leaves the top flat: several samples (n,) equal to the last digit."""
    size = samples - np.median(samples)
    for sense in (1.0, -1.0):
        top = float(np.max(sense * size))
        equal = sense * size >= top * (1 - 1e-6)
        # A pulse has one top; a decaying response reaches the same top again and again.
        ends = np.flatnonzero(np.diff(np.concatenate([[0], equal.astype(int), [0]])))
        longest, every = int(np.max(ends[1::2] - ends[::2])), int(np.sum(equal))
        # Two apart are two swings as large as each other, no flat top.
        flat = longest if pulse or every == 2 else every
        if not _by_chance(np.maximum(sense * size, 0.0), flat, pulse):
            level = float(samples[int(np.argmax(sense * size))])
            text = f"The {name} is clipped at {level:.4g} {unit} ({flat} samples)"
            return Fault("clipped", f"{text}; raise the range of {name} or hit more softly.")
    return None


def _by_chance(size: np.ndarray, flat: int, pulse: bool) -> bool:
    """Whether so many samples of |a channel| may be equal at its top without an overload.

    Stored in steps, samples fall upon the top as upon any other step nearby: as often as by the
    Poisson distribution. A pulse so narrow has a top so sharp that no two are equal.
    """
    top = float(np.max(size))
    if top <= 0 or flat < 2:
        return True
    rounding = step(size)
    if pulse and int(np.sum(size > 0.5 * top)) <= NARROW and rounding < COARSE * top:
        return False
    if rounding > NEAR * top:
        return True  # of so few steps nobody could tell
    near = np.sum((size > (1 - NEAR) * top) & (size < top * (1 - 1e-6)))
    each = (float(near) + 1) * rounding / (NEAR * top)
    # Of the Poisson distribution: each^(flat−1) / (flat−1)!
    return (flat - 1) * math.log(each) - math.lgamma(flat) > math.log(BY_CHANCE)


def step(samples: np.ndarray) -> float:
    """The step in which a converter stored samples (n,): least difference of any two."""
    steps = np.diff(np.unique(samples))
    steps = steps[steps > 1e-9 * np.max(np.abs(samples))]
    return float(np.min(steps)) if steps.size else 0.0


def without_filling(record: TimeRecord) -> TimeRecord:
    """The record without samples at its ends that were filled in; as it is where none were.

    Filled in is where all accelerations (where there are none: all channels but forces) repeat one
    value though they moved until then, or, before the pulse, from then on.
    """
    end = _filled([c.samples for c in _judged(record)])
    record = _cut(record, 0, end, "last")
    begin = _filled([c.samples[: _quiet(record)][::-1] for c in _judged(record)])
    return _cut(record, begin, 0, "first")


def _judged(record: TimeRecord) -> list[Channel]:
    """Accelerations; of a record without, all channels but forces."""
    found = [c for c in record.channels if c.quantity == "acceleration"]
    return found or [c for c in record.channels if c.quantity != "force"]


def _quiet(record: TimeRecord) -> int:
    """How many samples lie before the pulse."""
    forces = [c for c in record.channels if c.quantity == "force"]
    return find_pulse(forces[0].samples).quiet if len(forces) == 1 else 0


def _filled(channels: list[np.ndarray]) -> int:
    """How many samples at the end of channels (n,) were filled in."""
    rests = [_rest(samples) for samples in channels if np.any(samples != samples[:1])]
    sudden = [start for start, steps in rests if steps > STEPS]
    # The first of equal samples may be the last that was measured, or not.
    if not sudden or max(start for start, _ in rests) > max(sudden) + SKEW:
        return 0
    return len(channels[0]) - min(sudden)


def _cut(record: TimeRecord, first: int, last: int, which: str) -> TimeRecord:
    """The record without so many samples at its ends."""
    if not first and not last:
        return record
    end = len(record.channels[0].samples) - last
    seconds = (first or last) / record.sampling_rate_hz
    text = (
        f"The {which} {seconds:.3g} s repeat one value, while the structure moves: they were "
        f"filled in and are left out."
    )
    channels = (replace(c, samples=c.samples[first:end].copy()) for c in record.channels)
    faults = (*record.faults, Fault("filled", text, refuse=False))
    return replace(record, channels=tuple(channels), faults=faults)


def lost_samples(record: TimeRecord) -> tuple[Fault, ...]:
    """Where all accelerations stand still amid their movement and then jump, after the pulse."""
    moving = [c.samples for c in _judged(record) if np.any(c.samples != c.samples[0])]
    if not moving:
        return ()
    quiet = _quiet(record)
    after = np.array(moving)[:, quiet:]
    changes = np.flatnonzero(np.any(np.diff(after, axis=1), axis=0))
    if len(changes) <= 2 * CHANGES:
        return ()
    from scipy.ndimage import maximum_filter

    rests = np.diff(changes)
    beside = np.arange(-CHANGES, CHANGES + 1) != 0
    around = maximum_filter(rests, footprint=beside, mode="constant")
    inner = slice(CHANGES, len(rests) - CHANGES)
    candidates = np.flatnonzero(rests[inner] > LONGER * around[inner]) + CHANGES
    steps = [step(x) for x in after] if candidates.size else []
    for k in candidates.tolist():
        begin, end = int(changes[k]) + 1, int(changes[k + 1])
        if any(_jumps(x, own, begin, end) for x, own in zip(after, steps, strict=True)):
            rate = record.sampling_rate_hz
            text = (
                f"{(quiet + begin) / rate:.3g} s into the record all accelerations stand still for "
                f"{(end - begin) / rate:.2g} s and then jump: samples were lost; record again."
            )
            return (Fault("lost_samples", text),)
    return ()


def _jumps(x: np.ndarray, own: float, begin: int, end: int) -> bool:
    """Whether a channel (n,) moves for as long before and after a rest, and jumps in between."""
    low = max(0, begin - (end - begin))
    moves = np.ptp(x[low:begin]), np.ptp(x[end + 1 : 2 * end + 1 - begin])
    jump = max(abs(x[end + 1] - x[end]), abs(x[begin] - x[begin - 1]))
    return bool(min(jump, *moves) > STEPS * own)
