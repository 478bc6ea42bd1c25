"""The diagnosis beside a session: in a process of its own, so that nobody waits for it."""

import os
from concurrent.futures import CancelledError, Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path

from loky import ProcessPoolExecutor

from planner.errors import PlannerError
from planner.inference import parallel
from planner.report.diagnosis import DiagnosisReport

LEAST = 3  # measured poses from which a diagnosis is asked for
UNEXPLAINED = (
    "The robot differs from the simulation, and none of the effects that planner knows explains it."
)
FAILED = "The diagnosis did not end; ask planner diagnose for its reason."


class DiagnosisProcess:
    """Diagnoses a campaign, once at a time, on what is there when it starts."""

    def __init__(self, directory: Path):
        self._directory = directory
        self._pool: ProcessPoolExecutor | None = None
        self._running: Future[DiagnosisReport] | None = None
        self._due = False
        self._said = ""

    def ask(self) -> None:
        """Diagnose, as soon as an earlier diagnosis is through."""
        self._due = True
        self._start()

    def answer(self, wait: bool = False) -> str | None:
        """What a diagnosis that has ended says, if it is not what the last one said."""
        if self._running is None or not (wait or self._running.done()):
            return None
        text = self._text(self._running)
        self._running = None
        self._start()
        if self._running is not None and wait:
            return self.answer(wait)
        new, self._said = text != self._said, text
        return text if new else None

    def close(self) -> None:
        """End what still runs."""
        if self._pool is not None:
            self._pool.shutdown(kill_workers=True)
        self._pool = self._running = None

    def _start(self) -> None:
        if not self._due or self._running is not None:
            return
        self._due = False
        if self._pool is None:
            self._pool = parallel.process(os.nice, 10)  # the session goes first
        self._running = self._pool.submit(diagnose_measured, self._directory)

    def _text(self, ended: "Future[DiagnosisReport]") -> str:
        try:
            found = ended.result()
        except PlannerError as error:
            return f"{error}"
        except (BrokenProcessPool, CancelledError):
            self.close()
            return FAILED
        except Exception:
            return FAILED
        said = " ".join(finding.text for finding in found.findings)
        if found.verdict == "consistent":
            return "The simulation, once refitted, explains the recordings to within their noise."
        return f"{UNEXPLAINED} {said}".strip() if found.verdict == "unexplained" else said


def diagnose_measured(directory: Path) -> DiagnosisReport:
    """The diagnosis of a campaign as it stands, without its fits: those stay in the process."""
    from planner.api import diagnose_source
    from planner.campaign.recordings_source import recordings_source

    return replace(diagnose_source(recordings_source(directory, None, 0.0)), diagnosis=None)
