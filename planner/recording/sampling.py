"""When channels were sampled: rates from times, and channels that do not begin together."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.recording.records import Channel

UNEVEN = 1e-3  # share of a step by which sampling times may scatter beside their rounding
MOST_DIGITS = 15
LEAST_SAMPLES = 8


def sampling_rate(path: Path, time_s: np.ndarray) -> float:
    """Rate in Hz of sampling times (n,) in s; InputError if they are not evenly spaced.

    Times are even if none is farther from a straight line than it may be rounded.
    """
    count = len(time_s)
    if count < LEAST_SAMPLES:
        raise InputError(f"{path} holds {count} samples; a hit has hundreds: export again.")
    step = (time_s[-1] - time_s[0]) / (count - 1)
    if not step > 0:
        raise InputError(f"{path}: the time column does not increase; check the columns.")
    middle = np.arange(count) - (count - 1) / 2
    step = float(middle @ time_s / (middle @ middle))
    off = np.abs(time_s - np.mean(time_s) - step * middle)
    digits = 4 * np.finfo(np.float32).eps * max(abs(time_s[0]), abs(time_s[-1]))
    if np.any(off > np.maximum(max(UNEVEN * step, digits), 1.2 * rounding(time_s))):
        steps = np.abs(np.diff(time_s) - step)
        row = int(np.argmax(steps)) + 2
        raise InputError(
            f"{path}: time step {row} differs from the others; samples must be evenly spaced."
        )
    return 1 / step


def rounding(values: np.ndarray) -> np.ndarray:
    """By how much each of `values` (n,) may have been rounded, as they were written.

    To decimals (0.001 of 1.234, 2.5) or to significant digits (1e-4 of 10.9995 beside 9.00049).
    """
    magnitude = np.floor(np.log10(np.maximum(np.abs(values), 1e-300)))
    decimals = _first_whole(values, np.zeros(len(values)))
    return np.maximum(decimals, _first_whole(values, magnitude)) / 2


def _first_whole(values: np.ndarray, magnitude: np.ndarray) -> np.ndarray:
    """The coarsest decimal place, counted from each one's `magnitude`, at which all are whole."""
    for digits in range(MOST_DIGITS):
        place = 10.0 ** (magnitude - digits)
        scaled = values / place
        if np.all(np.abs(scaled - np.round(scaled)) < 1e-4):
            return place
    return np.zeros(len(values))


def aligned(
    path: Path, channels: Sequence[Channel], start_s: Mapping[str, float], rate_hz: float
) -> tuple[tuple[Channel, ...], tuple[str, ...]]:
    """Channels over the time that all of them have, and what was left out, in words.

    `start_s` says when a channel begins, by name. Raises InputError where channels without a start
    differ in length, and where they have no time in common.
    """
    names = [channel.name for channel in channels]
    begin = np.array([start_s.get(name, 0.0) for name in names])
    lengths = np.array([len(channel.samples) for channel in channels])
    late = np.max(begin) - begin
    if not np.any(late > 0.01 / rate_hz):
        if len(set(lengths)) > 1 and not start_s:
            raise InputError(f"{path} has columns of several lengths; export them together.")
        late = np.zeros_like(late)
    skip = np.round(late * rate_hz).astype(int)
    count = int(np.min(lengths - skip))
    first, last = names[int(np.argmin(begin))], names[int(np.argmax(begin))]
    apart = f"{path}: {first} and {last} begin {np.max(late):.3g} s apart"
    if count < LEAST_SAMPLES:
        raise InputError(f"{apart} and have no time in common; export what was sampled together.")
    cut = tuple(
        replace(channel, samples=channel.samples[at : at + count])
        for channel, at in zip(channels, skip, strict=True)
    )
    remarks = []
    if np.any(skip):
        remarks.append(
            f"{apart}: what all channels have in common, {count / rate_hz:.4g} s, is used."
        )
    rest = float(np.max(np.abs(late * rate_hz - skip), initial=0.0))
    if rest > 0.05:
        remarks.append(f"{first} and {last} were sampled {rest / rate_hz:.2g} s apart for good.")
    return cut, tuple(remarks)
