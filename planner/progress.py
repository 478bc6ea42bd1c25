"""What is being done, and which share of it is, for whoever waits."""

from collections.abc import Callable

Tell = Callable[[str, float], None]


def quietly(text: str, share: float) -> None:
    """To nobody."""


def within(tell: Tell, first: float, last: float) -> Tell:
    """To whom it is told of work that is only a part, from one share of the whole to another."""
    return lambda text, share: tell(text, first + (last - first) * share)
