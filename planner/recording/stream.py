"""A recorder that ran on while one hit again and again: its record cut into hits by the pulses."""

from dataclasses import dataclass, replace

import numpy as np

from planner.recording.filling import lost_samples
from planner.recording.pulse import NORMAL_MAD, RISING_SAMPLES
from planner.recording.records import Fault, TimeRecord
from planner.recording.screening import ANSWER_S, SILENCE, ScreeningLimits

APART_S = 0.5  # no hand hits again so soon on purpose: pulses closer than this are one hit
# Kept before each hit: a share of the usual pause between two, at most another one of its own.
PRETRIGGER, MOST_PRETRIGGER = 0.1, 0.5
SHORT = 0.5  # share of the usual length below which a hit is cut off
# Movement left from the hit before, as a share of the answer, that is worth saying; it stands out
# of the noise where its power is more than so many times the quietest.
RESTLESS, OUT_OF_NOISE = 0.02, 2.0
LEAST_QUIET = 2 * RISING_SAMPLES  # samples before a hit from which its rest is judged


@dataclass(frozen=True)
class _Struck:
    """Samples of a hit in a stream: of its pulses, and of the part that is kept of it."""

    first: int  # of its pulses
    end: int
    begin: int  # of what is kept
    stop: int
    cut_off: bool


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
    struck = _parts(pulses, len(forces[0].samples))
    both = zip(struck, _restless(record, struck), strict=True)
    return tuple(_part(record, one, struck, share) for one, share in both)


def _pulses(force_n: np.ndarray, rate_hz: float) -> list[tuple[int, int]]:
    """First sample and end of the pulses of each hit.

    A pulse is a hit where one of a single hit would make it a double hit (`second_peak`) beside
    any other; so the softest hits of a stream tell which pulses are still to be told.
    """
    limits = ScreeningLimits()
    size = np.abs(force_n - np.median(force_n))
    floor = limits.least_snr * NORMAL_MAD * float(np.median(size))
    least, found = limits.second_peak * float(np.max(size)), []
    while True:
        groups = _groups(np.flatnonzero(size > max(least, floor)), APART_S * rate_hz)
        if len(groups) <= max(1, len(found)):
            return found or groups
        found = groups
        least = limits.second_peak * min(float(np.max(size[a:b])) for a, b in groups)


def _groups(samples: np.ndarray, apart: float) -> list[tuple[int, int]]:
    if not samples.size:
        return []
    each = np.split(samples, np.flatnonzero(np.diff(samples) > apart) + 1)
    return [(int(one[0]), int(one[-1]) + 1) for one in each]


def _parts(pulses: list[tuple[int, int]], samples: int) -> list[_Struck]:
    """What is kept of each hit of a record of so many samples."""
    first, end = np.array(pulses).T
    pause = first[1:] - end[:-1]
    usual = PRETRIGGER * np.median(pause)
    before = np.append(usual, np.minimum(usual, MOST_PRETRIGGER * pause)).astype(int)
    length = np.append(first[1:] - before[1:], samples) - first
    short = length < SHORT * np.median(length)
    stop = first + np.where(short, length, np.min(length[~short]))
    begin = np.maximum(first - before, 0)
    each = zip(*(a.tolist() for a in (first, end, begin, stop, short)), strict=True)
    return [_Struck(*one) for one in each]


def _part(record: TimeRecord, one: _Struck, struck: list[_Struck], restless: float) -> TimeRecord:
    """One hit of a record."""
    rate, last = record.sampling_rate_hz, one is struck[-1]
    kept = slice(one.begin, one.stop)
    channels = tuple(replace(c, samples=c.samples[kept].copy()) for c in record.channels)
    part = replace(record, channels=channels, at_s=one.first / rate, faults=())
    told = [*(record.faults if last else ()), *lost_samples(part)]
    if one.cut_off:
        usual = min(s.stop - s.first for s in struck if not s.cut_off)
        ends = "the record ends" if last else "the next hit follows"
        told.append(
            Fault(
                "cut_off",
                f"It is cut off: {ends} {(one.stop - one.first) / rate:.2g} s after it, other hits "
                f"have {usual / rate:.2g} s; wait as long after each.",
            )
        )
    if restless > RESTLESS:
        told.append(
            Fault(
                "not_at_rest",
                f"The structure was not at rest: it still moved by {100 * restless:.0f} % of its "
                f"answer to this hit; wait longer before the next.",
                refuse=restless > 1 / ScreeningLimits().least_response_snr,
            )
        )
    return replace(part, faults=tuple(told))


def _restless(record: TimeRecord, struck: list[_Struck]) -> list[float]:
    """Of each hit, the movement before it as a share of the answer to it; 0 where it is noise."""
    samples = np.array([c.samples for c in record.channels if c.quantity == "acceleration"])
    known = [s for s in struck if s.first - s.begin > LEAST_QUIET]
    if not samples.size or not known:
        return [0.0] * len(struck)
    answer = round(ANSWER_S * record.sampling_rate_hz)
    before = [np.var(samples[:, s.begin : s.first - RISING_SAMPLES], axis=1) for s in known]
    after = [np.var(samples[:, s.first : s.first + answer], axis=1) for s in known]
    quietest = np.min(before, axis=0)
    shares = {}
    for one, rest, own in zip(known, before, after, strict=True):
        over = float(np.sum(rest - quietest))
        clear = np.sum(rest) > OUT_OF_NOISE * np.sum(quietest)
        shares[one] = float(np.sqrt(over / max(float(np.sum(own)), SILENCE**2))) if clear else 0.0
    return [shares.get(one, 0.0) for one in struck]
