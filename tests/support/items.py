"""Work for other processes to do; in a module of its own, so that they can import it."""

import os
import signal
from pathlib import Path


def doubled(shared: int, item: int) -> int:
    return shared * item


def dying_once(shared: str, item: int) -> int:
    """Its process is killed at the first attempt at item 2."""
    marker = Path(shared) / "killed"
    if item == 2 and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return item


def deadly(shared: None, item: int) -> int:
    if item == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return item


def failing(shared: None, item: int) -> int:
    if item == 1:
        raise ValueError("too odd")
    return item


def process_of(shared: None, item: int) -> int:
    return os.getpid()
