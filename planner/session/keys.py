"""Keys of the terminal, one at a time, without waiting for Enter."""

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Keys(Protocol):
    """Where keys come from."""

    def get(self, timeout_s: float) -> str | None:
        """The next key, or None if none came in time."""
        ...


class NoKeys:
    """Nobody is at the keyboard."""

    def get(self, timeout_s: float) -> str | None:
        """Never a key; takes the time all the same."""
        time.sleep(timeout_s)
        return None


class TerminalKeys:
    """Keys of a POSIX terminal in cbreak mode."""

    def get(self, timeout_s: float) -> str | None:
        """The next key, or None."""
        import select

        ready, _, _ = select.select([sys.stdin], [], [], timeout_s)
        if not ready:
            return None
        return os.read(sys.stdin.fileno(), 1).decode("utf-8", "ignore") or "q"


@contextmanager
def terminal_keys() -> Iterator[Keys]:
    """Keys of this terminal, restored whatever happens; NoKeys where there is no terminal."""
    if not sys.stdin.isatty():
        yield NoKeys()
        return
    try:
        import termios
        import tty
    except ImportError:  # not a POSIX system
        yield NoKeys()
        return
    handle = sys.stdin.fileno()
    before = termios.tcgetattr(handle)
    try:
        tty.setcbreak(handle)
        yield TerminalKeys()
    finally:
        termios.tcsetattr(handle, termios.TCSADRAIN, before)
