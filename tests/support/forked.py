"""Commands in forked children of a process that has imported all: killed, starved, or left alone.

JAX must not have started in the parent: a child of a process whose backend runs hangs.
"""

import importlib
import json
import os
import pkgutil
import resource
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jax._src import xla_bridge

import planner

CPU_S, LARGEST_GIB = 10, 2  # no command of these small cases may take more
HANGS_S = 120.0  # without work, on a machine that others load
POLL_S = 0.002
CHANGES = ("os.rename", "os.remove", "os.truncate", "os.mkdir", "os.rmdir")


@dataclass(frozen=True)
class Outcome:
    """How a child ended: its exit code, negative where a signal ended it, and what it said."""

    code: int
    out: str
    err: str
    cpu_s: float
    peak_gib: float
    hung: bool = False

    @property
    def killed(self) -> bool:
        """Whether it was killed as was meant."""
        return self.code == -signal.SIGKILL and not self.hung

    @property
    def answer(self) -> Any:
        """The JSON document that it said; None where it did not come so far."""
        try:
            return json.loads(self.out)
        except ValueError:
            return None

    def faults(self, codes: tuple[int, ...] = (0, 2, 3, 4)) -> list[str]:
        """What no command may do, whatever befalls it."""
        said = self.out + self.err
        found = [text for text in ("Traceback", "failed inside") if text in said]
        if self.hung:
            found.append(f"no end within {HANGS_S} s")
        elif self.code == -signal.SIGXCPU:
            found.append(f"more than {CPU_S} s")
        elif not self.killed and self.code not in codes:
            found.append(f"exit code {self.code}")
        if self.peak_gib > LARGEST_GIB:
            found.append(f"{self.peak_gib:.1f} GiB")
        if found:
            found.append(self.err[-300:])
        return found


def preload() -> None:
    """Import all of the program, so that no child has to."""
    for module in pkgutil.walk_packages(planner.__path__, "planner."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    assert not xla_bridge._backends


def forked(
    act: Callable[[], int],
    folder: Path,
    at_change: int = 0,
    after_s: float = 0.0,
    signal_sent: int = signal.SIGKILL,
    full: int = 0,
    largest: int = 0,
) -> Outcome:
    """Run `act` in a child whose words go to `folder`.

    It is sent a signal before its `at_change`-th change of the disk, or each from there on fails
    with the error `full`; it is killed after so many seconds; no file grows beyond `largest` bytes.
    0: never.
    """
    names = folder / "out", folder / "err"
    child = os.fork()
    if child == 0:
        code = 1
        try:
            for handle, name in enumerate(names, 1):
                os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), handle)
            sys.stdout, sys.stderr = (os.fdopen(h, "w", closefd=False) for h in (1, 2))
            os.setsid()
            resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S))
            signal.signal(signal.SIGINT, signal.default_int_handler)
            if largest:
                resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))
            if at_change:
                _stop_at(at_change, signal_sent, full)
            code = act()
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os._exit(code)
    end = time.monotonic() + (after_s or HANGS_S)
    ended, status, used = os.wait4(child, os.WNOHANG)
    while not ended and time.monotonic() < end:
        time.sleep(POLL_S)
        ended, status, used = os.wait4(child, os.WNOHANG)
    hung = not ended and not after_s
    if not ended:
        os.kill(child, signal.SIGKILL)
        _, status, used = os.wait4(child, 0)
    out, err = (name.read_text("utf-8", "replace") for name in names)
    cpu = used.ru_utime + used.ru_stime
    return Outcome(os.waitstatus_to_exitcode(status), out, err, cpu, used.ru_maxrss / 2**20, hung)


def _stop_at(change: int, signal_sent: int, full: int) -> None:
    """A signal, or errors, from the `change`-th time that this process changes the disk."""
    left = [change]

    def count() -> None:
        left[0] -= 1
        if full and left[0] <= 0:
            raise OSError(full, os.strerror(full))
        if not left[0]:
            os.kill(os.getpid(), signal_sent)

    def heard(event: str, arguments: tuple) -> None:
        writes = event == "open" and (arguments[2] or 0) & (os.O_WRONLY | os.O_RDWR)
        if writes or event in CHANGES:
            count()

    synced = os.fsync

    def sync(handle: int) -> None:
        count()
        synced(handle)
        count()

    os.fsync = sync
    sys.addaudithook(heard)
