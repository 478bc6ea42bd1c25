"""Progress of long work: functions that are called with a text and the share that is done."""

from collections.abc import Callable

Tell = Callable[[str, float], None]  # what is being done, and the share (0 to 1) that is done


def quietly(text: str, share: float) -> None:
    """Report nothing."""


def within(tell: Tell, first: float, last: float) -> Tell:
    """The `tell` of a part of the work, from the share `first` of the whole to `last`."""
    return lambda text, share: tell(text, first + (last - first) * share)
