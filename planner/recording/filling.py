"""What an instrument wrote where it had measured nothing: records filled up, samples lost."""

from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from planner.recording.channel_faults import CHANGES, LONGER, SKEW, STEPS, Rest, step
from planner.recording.pulse import find_pulse
from planner.recording.records import Channel, Fault, TimeRecord


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
    rests = [Rest.of(samples) for samples in channels if np.any(samples != samples[:1])]
    sudden = [rest.start for rest in rests if rest.steps > STEPS]
    # The first of equal samples may be the last that was measured, or not.
    if not sudden or max(rest.start for rest in rests) > max(sudden) + SKEW:
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
    rests = np.diff(changes)
    padded = np.pad(rests, CHANGES)
    usual = np.max(sliding_window_view(padded, CHANGES), axis=1)
    around = np.maximum(usual[: len(rests)], usual[CHANGES + 1 :])
    inner = slice(CHANGES, len(rests) - CHANGES)
    candidates = np.flatnonzero(rests[inner] > LONGER * around[inner]) + CHANGES
    steps = [step(x) for x in after] if candidates.size else []
    for k in candidates.tolist():
        begin, end = int(changes[k]) + 1, int(changes[k + 1])
        both = zip(after, steps, strict=True)
        if any(_jumps(x, own, begin, end) for x, own in both):
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
