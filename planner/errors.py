"""Errors that reach the user: one plain sentence each, and the exit code that goes with it."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path


class PlannerError(Exception):
    """Base of every error whose message is meant for the engineer's eyes."""

    exit_code = 2


class InputError(PlannerError):
    """Bad usage or bad input; the message names file, row (where there is one) and remedy."""

    exit_code = 2


class ForeignFileError(InputError):
    """A file is no recording at all, not one that is damaged."""


class AxisNotStatedError(InputError):
    """A hit is whole, and nothing says along which axis it was made."""


class RefusedError(PlannerError):
    """A recording was read but cannot be used as a measurement."""

    exit_code = 3


class NoPoseLeftError(PlannerError):
    """No reachable pose is left to propose."""

    exit_code = 4


class JournalError(PlannerError):
    """The campaign's log is damaged beyond the tail that can be repaired."""

    exit_code = 5


@dataclass(frozen=True)
class RefusedFile:
    """A recording that could not be used, and why."""

    file: str
    reason: str


@contextmanager
def writing(where: Path, another: str = "another") -> Iterator[None]:
    """Around what writes a file or folder: InputError with a remedy where that is impossible."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{where} cannot be written ({error.strerror}); name {another}.") from None
