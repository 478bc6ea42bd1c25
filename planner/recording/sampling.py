"""When channels and hits were sampled: rates, and channels that do not begin together."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.recording.records import Channel, Hit

UNEVEN = 1e-3  # share of a step by which sampling times may scatter beside their rounding
MOST_DIGITS = 15
LEAST_SAMPLES = 8
SLOWEST_S = 1e6  # between two samples
# Relative. Times that are rounded to a hundredth of a step, or to six digits, tell the rate of some
# hundred samples better than that; rates that analysers offer lie a percent or more apart. Chosen.
ALIKE = 1e-4
SHORT = 0.6  # of the others' length, below which a record was cut off. Chosen.


@dataclass(frozen=True)
class Axis:
    """What is stated of where a channel's samples stand: `step` and `offset` in s, or in Hz.

    `offset` is that of the first sample, from `date_s` (since 1970) where that is stated.
    """

    quantity: str = "time"  # or "frequency", of a spectrum
    step: float | None = None
    offset: float | None = None
    date_s: float | None = None


def common_step(path: Path, steps: Mapping[str, float]) -> float | None:
    """The step that all which state one (by their names) have; InputError where they contradict."""
    first, common = next(iter(steps.items()), ("", None))
    for name, step in steps.items():
        if not abs(step - steps[first]) <= UNEVEN * abs(steps[first]):
            raise InputError(
                f"{path}: {first} and {name} have different rates (steps of {common:.6g} and "
                f"{step:.6g} s); correct what is wrong, or export what was sampled together."
            )
    return common


def sampling_rate(path: Path, time_s: np.ndarray) -> float:
    """Rate in Hz of sampling times (n,) in s; InputError if they are not evenly spaced.

    Times are even if none is farther from the straight line fitted to them than rounding, of it
    and of the line, explains.
    """
    count = len(time_s)
    if count < LEAST_SAMPLES:
        raise InputError(f"{path} holds {count} samples; a hit has hundreds: export again.")
    step = (time_s[-1] - time_s[0]) / (count - 1)
    if not 0 < step < SLOWEST_S:
        raise InputError(f"{path}: the time column does not increase; check the columns.")
    middle = np.arange(count) - (count - 1) / 2
    step = float(middle @ time_s / (middle @ middle))
    off = np.abs(time_s - np.mean(time_s) - step * middle)
    digits = 4 * np.finfo(np.float32).eps * max(abs(time_s[0]), abs(time_s[-1]))
    if np.max(off) > max(UNEVEN * step, digits, 3 * rounding(time_s)):
        steps = np.abs(np.diff(time_s) - step)
        row = int(np.argmax(steps)) + 2
        raise InputError(
            f"{path}: time step {row} differs from the others; samples must be evenly spaced."
        )
    return float(f"{1 / step:.12g}")  # sums round the last digits


def rounding(values: np.ndarray) -> float:
    """By how much `values` (n,) may have been rounded at most, as they were written.

    To decimals (0.001 of 1.234, 2.5) or to significant digits (1e-4 of 10.9995 beside 9.00049).
    """
    size = np.abs(values)
    written = values[size > 1e-12 * np.max(size)]  # a zero that arithmetic missed is a zero
    magnitude = np.floor(np.log10(np.abs(written)))
    places = _first_whole(written, np.zeros(len(written))), _first_whole(written, magnitude)
    return float(np.max(places)) / 2


def _first_whole(values: np.ndarray, magnitude: np.ndarray) -> np.ndarray:
    """The coarsest decimal place, counted from each one's `magnitude`, at which all are whole."""
    for digits in range(MOST_DIGITS):
        place = 10.0 ** (magnitude - digits)
        scaled = values / place
        if np.all(np.abs(scaled - np.round(scaled)) < 1e-4):
            return place
    return np.zeros(len(values))


def aligned(
    path: Path, channels: Sequence[Channel], axes: Sequence[Axis], rate_hz: float
) -> tuple[tuple[Channel, ...], tuple[str, ...]]:
    """Channels over the time that all of them have, and what was left out, in words.

    `axes` (one a channel) say when each begins. Raises InputError where channels that begin
    together differ in length, and where they have no time in common.
    """
    begin = _begin_s(path, channels, axes)
    lengths = np.array([len(channel.samples) for channel in channels])
    late = np.max(begin) - begin
    if np.all(late < 0.01 / rate_hz):
        if len(set(lengths)) > 1:
            raise InputError(
                f"{path} has channels of {len(set(lengths))} lengths; export them together."
            )
        return tuple(channels), ()
    skip = np.round(late * rate_hz).astype(int)
    count = int(np.min(lengths - skip))
    first, last = (channels[int(at(begin))].name for at in (np.argmin, np.argmax))
    apart = f"{first} and {last} begin {np.max(late):.3g} s apart"
    if count < LEAST_SAMPLES:
        raise InputError(f"{path}: {apart} and have no time in common; export them together.")
    remarks = []
    if np.any(skip):
        remarks.append(f"{apart}: the {count / rate_hz:.4g} s that all channels have are used.")
    rest = float(np.max(np.abs(late * rate_hz - skip)))
    if rest > 0.05:
        remarks.append(f"{first} and {last} are {rest / rate_hz:.2g} s apart, less than a sample.")
    cut = (
        replace(channel, samples=channel.samples[at : at + count])
        for channel, at in zip(channels, skip, strict=True)
    )
    return tuple(cut), tuple(remarks)


def _begin_s(path: Path, channels: Sequence[Channel], axes: Sequence[Axis]) -> np.ndarray:
    """When channels begin (n,) in s after the first; who does not say so begins with that.

    A channel without a date begins with the others, if those begin together.
    """
    dates = [axis.date_s for axis in axes if axis.date_s is not None]
    first, last = min(dates, default=0.0), max(dates, default=0.0)
    undated = [c.name for c, a in zip(channels, axes, strict=True) if a.date_s is None and a.step]
    if undated and last > first:
        dated = next(c.name for c, a in zip(channels, axes, strict=True) if a.date_s is not None)
        raise InputError(
            f"{path}: {dated} and others say when they begin, {undated[0]} does not; export what "
            f"was sampled together."
        )
    unknown = [axis.offset is None and axis.date_s is None for axis in axes]
    begin = np.array([
        np.nan if lacks else (first if a.date_s is None else a.date_s) - first + (a.offset or 0.0)
        for a, lacks in zip(axes, unknown, strict=True)
    ])  # fmt: skip
    # Of different lengths, what states no start cannot be laid beside the others.
    if all(unknown) or (any(unknown) and len({len(c.samples) for c in channels}) > 1):
        return np.zeros(len(begin))
    return np.nan_to_num(begin - np.nanmin(begin))


def same_rate(one: Hit, other: Hit) -> bool:
    """Whether two hits were sampled alike, as far as a rounded time column can tell."""
    return abs(one.sampling_rate_hz / other.sampling_rate_hz - 1) <= ALIKE


def recorded_otherwise(hits: Sequence[Hit]) -> tuple[str, ...]:
    """Per hit, at which other rate than most of them it was sampled, or how much shorter its
    record is, to which theirs would be cut; "" where neither is so.

    Hits that one record holds last until the next, and are not held against each other.
    """
    if not hits:
        return ()
    usual = max(hits, key=lambda hit: sum(same_rate(hit, other) for other in hits))
    seconds = np.array([len(hit.force_n) / hit.sampling_rate_hz for hit in hits])
    parts, long_s = Counter(hit.source for hit in hits), float(np.median(seconds))
    found = []
    for hit, own in zip(hits, seconds, strict=True):
        said = ""
        if not same_rate(hit, usual):
            said = f"sampled at {hit.sampling_rate_hz:.7g} Hz, the others at "
            said += f"{usual.sampling_rate_hz:.7g} Hz"
        elif own < SHORT * long_s and parts[hit.source] == 1:
            said = f"its record ends after {own:.3g} s, the others after {long_s:.3g} s"
        found.append(said)
    return tuple(found)
