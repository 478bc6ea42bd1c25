"""Progress of long work: functions that are called with a text and the share that is done."""

from collections.abc import Callable

ProgressCallback = Callable[
    [str, float], None
]  # what is being done, and the share (0 to 1) that is done


def no_progress(text: str, share: float) -> None:
    """Report nothing."""


def part_of(progress: ProgressCallback, first: float, last: float) -> ProgressCallback:
    """The `progress` of a part of the work, from the share `first` of the whole to `last`."""
    return lambda text, share: progress(text, first + (last - first) * share)
