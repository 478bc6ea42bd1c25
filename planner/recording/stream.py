"""A recorder that ran on while one hit again and again: its record cut into hits by the pulses."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.recording.channel_faults import lost_samples
from planner.recording.records import NORMAL_MAD, RISING_SAMPLES, Fault, TimeRecord
from planner.recording.screening import (
    ANSWER_S,
    LEAST_RESPONSE_SNR,
    LEAST_SNR,
    SECOND_PEAK,
    SILENCE,
)

# No hand hits again so soon on purpose, and fewer samples tell nothing: such pulses are one hit.
APART_S, APART_SAMPLES = 0.5, 64
# Kept before each hit: a share of the usual pause between two, at most another one of its own.
PRETRIGGER, MOST_PRETRIGGER = 0.1, 0.5
SHORT = 0.5  # share of the usual length below which a hit that still rings at its end is cut off
# Movement before or at the end of a hit, as a share of the answer to it, that is worth saying; it
# stands out of the noise where its power is more than so many times the quietest.
RESTLESS, OUT_OF_NOISE = 0.02, 2.0
LEAST_QUIET = 2 * RISING_SAMPLES  # samples by which rest is judged


def cut_into_hits(record: TimeRecord) -> tuple[TimeRecord, ...]:
    """Each hit of a record by itself; of a single hit the record as it is.

    All hits are as long as the shortest that was not cut off by the next one or by the record's
    end. What is wrong with each is in its faults.
    """
    forces = [c for c in record.channels if c.quantity == "force"]
    pulses = _pulses(forces[0].samples, record.sampling_rate_hz) if len(forces) == 1 else []
    if len(pulses) < 2:
        found = lost_samples(record)
        return (replace(record, faults=(*record.faults, *found)) if found else record,)
    return _parts(record, pulses)


def _pulses(force_n: np.ndarray, rate_hz: float) -> list[tuple[int, int]]:
    """First sample and end of the pulses of each hit.

    A pulse is a hit where one of a single hit would make it a double hit (`second_peak`) beside
    any other; so the softest hits of a stream tell which pulses are still to be told.
    """
    size = np.abs(force_n - np.median(force_n))
    floor = LEAST_SNR * NORMAL_MAD * float(np.median(size))
    least, found = SECOND_PEAK * float(np.max(size)), []
    apart = max(APART_S * rate_hz, APART_SAMPLES)
    while True:
        loud = np.flatnonzero(size > max(least, floor))
        each = np.split(loud, np.flatnonzero(np.diff(loud) > apart) + 1)
        groups = [(int(one[0]), int(one[-1]) + 1) for one in each if one.size]
        if len(groups) <= max(1, len(found)):
            return found or groups
        found = groups
        least = SECOND_PEAK * min(float(np.max(size[a:b])) for a, b in groups)


def _parts(record: TimeRecord, pulses: list[tuple[int, int]]) -> tuple[TimeRecord, ...]:
    """What is kept of each hit of a record, and how far it was from rest."""
    samples = len(record.channels[0].samples)
    first, end = np.array(pulses).T
    pause = first[1:] - end[:-1]
    usual = PRETRIGGER * np.median(pause)
    before = np.append(usual, np.minimum(usual, MOST_PRETRIGGER * pause)).astype(int)
    begin = np.maximum(first - before, 0)
    stop = np.append(begin[1:], samples)
    last = max(samples - int(usual), (int(first[-1]) + samples) // 2)
    quiet = [*zip(begin, first - RISING_SAMPLES, strict=True), (last, samples)]
    moved, answer = _movement(record, quiet, first)
    restless = np.sqrt(np.nan_to_num(moved[:-1]) / answer)
    ringing = np.sqrt(np.nan_to_num(moved[1:], nan=np.inf) / answer)
    length = stop - first
    cut_off = (length < SHORT * np.median(length)) & (ringing > RESTLESS)
    usual = int(np.min(length[~cut_off]))
    stop = np.where(cut_off, stop, first + usual)
    each = zip(*(a.tolist() for a in (first, begin, stop, cut_off, restless)), strict=True)
    return tuple(
        _part(record, at, slice(start, end), usual if short else 0, moving, at == first[-1])
        for at, start, end, short, moving in each
    )


def _movement(
    record: TimeRecord, quiet: Sequence[tuple[int, int]], first: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Power of the accelerations (n + 1,) in parts of the record that should be quiet, without
    the noise, NaN where they are too short; and of the answers (n,) to the n hits.
    """
    a = np.array([c.samples for c in record.channels if c.quantity == "acceleration"])
    judged = [k for k, (start, stop) in enumerate(quiet) if stop - start >= LEAST_QUIET]
    moved, answer = np.full(len(quiet), np.nan), np.full(len(first), SILENCE**2)
    if not a.size or not judged:
        return moved, answer
    long = round(ANSWER_S * record.sampling_rate_hz)
    answer += [float(np.sum(np.var(a[:, at : at + long], axis=1))) for at in first]
    power = np.array([np.var(a[:, slice(*quiet[k])], axis=1) for k in judged])
    noise = np.min(power, axis=0)
    clear = np.sum(power, axis=1) > OUT_OF_NOISE * np.sum(noise)
    moved[judged] = np.where(clear, np.sum(power - noise, axis=1), 0.0)
    return moved, answer


def _part(
    record: TimeRecord, at: int, kept: slice, usual: int, restless: float, last: bool
) -> TimeRecord:
    """The hit at a sample of a record, with what was wrong: faults of the record are the last's.

    Others have `usual` samples after the hit where it was cut off, else 0; `restless` is the
    movement before it as a share of the answer to it.
    """
    rate = record.sampling_rate_hz
    channels = tuple(replace(c, samples=c.samples[kept].copy()) for c in record.channels)
    part = replace(record, channels=channels, at_s=at / rate, faults=())
    told = [*(record.faults if last else ()), *lost_samples(part)]
    if usual:
        ends = "the record ends" if last else "the next hit follows"
        text = f"It is cut off: {ends} {(kept.stop - at) / rate:.2g} s after it, other hits "
        text += f"have {usual / rate:.2g} s; wait as long after each."
        told.append(Fault("cut_off", text))
    if restless > RESTLESS:
        text = f"The structure was not at rest: before this hit it moved by {100 * restless:.0f}"
        text += " % of its answer; wait longer between hits."
        told.append(Fault("not_at_rest", text, refuse=restless > 1 / LEAST_RESPONSE_SNR))
    return replace(part, faults=tuple(told))
