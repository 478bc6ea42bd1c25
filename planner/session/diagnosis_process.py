"""The diagnosis beside a session: in a process of its own, so that nobody waits for it."""

import json
import os
import subprocess
import tempfile
from pathlib import Path
from typing import IO

from planner import program

LEAST = 3  # measured poses from which a diagnosis is asked for
NICE = 10  # the session goes first
CONSISTENT = "The simulation, once refitted, explains the recordings to within their noise."
UNEXPLAINED = "Simulation and recordings differ, and no effect known here explains it."


class Explaining:
    """Runs `planner diagnose` on a campaign, once at a time, on what is there when it starts."""

    def __init__(self, directory: Path):
        self._command = program.command("diagnose", str(directory), "--json")
        self._running: tuple[subprocess.Popen[bytes], IO[bytes]] | None = None
        self._due = False
        self._said = ""

    def ask(self) -> None:
        """Diagnose, as soon as an earlier diagnosis is through."""
        self._due = True
        self._start()

    def told(self, wait: bool = False) -> str | None:
        """What a diagnosis that has ended says, if it is not what the last one said."""
        if self._running is None:
            return None
        process, answer = self._running
        if wait:
            process.wait()
        elif process.poll() is None:
            return None
        answer.seek(0)
        text = _text(process.returncode, answer.read().decode())
        answer.close()
        self._running = None
        self._start()
        if self._running is not None and wait:
            return self.told(wait)
        new, self._said = text != self._said, text
        return text if new else None

    def close(self) -> None:
        """End what still runs."""
        if self._running is not None:
            self._running[0].kill()
            self._running[0].wait()
            self._running[1].close()
            self._running = None

    def _start(self) -> None:
        if not self._due or self._running is not None:
            return
        self._due = False
        answer = tempfile.TemporaryFile()  # noqa: SIM115, it lives as long as the process
        process = subprocess.Popen(
            self._command, stdout=answer, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL
        )
        os.setpriority(os.PRIO_PROCESS, process.pid, NICE)
        self._running = process, answer


def _text(code: int, answer: str) -> str:
    if code not in (0, 3):
        return "The diagnosis did not end; ask planner diagnose for its reason."
    found = json.loads(answer)
    said = " ".join(finding["text"] for finding in found["findings"])
    if found["verdict"] == "consistent":
        return CONSISTENT
    return f"{UNEXPLAINED} {said}".strip() if found["verdict"] == "unexplained" else said
