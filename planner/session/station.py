"""What a session works with: campaign, folder, screen, keys and what runs beside it."""

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.text import Text

from planner.campaign.arrivals import stated_otherwise
from planner.campaign.campaign import Campaign
from planner.campaign.events import (
    Configured,
    Confirmed,
    Entry,
    FilesPlaced,
    FilesShown,
    Imported,
    Proposal,
    Proposed,
    Refused,
)
from planner.campaign.importing import ImportReport
from planner.campaign.model import Model
from planner.campaign.state import taken_back
from planner.dataset.measure import MeasuredPose
from planner.dataset.screened_files import Source, read_one
from planner.report.rerun.story import Story
from planner.session.course import Course
from planner.session.diagnosis_process import DiagnosisProcess
from planner.session.hit_verdicts import PoseBefore, Verdicts
from planner.session.inbox import Inbox
from planner.session.keys import Keys
from planner.session.screen import Screen


class RerunQueue:
    """Keeps each new entry with the model right after it until there is time to show it."""

    def __init__(self, campaign: Campaign, story: Story):
        self._campaign, self._story = campaign, story
        self._noted = len(campaign.entries)
        self._waiting: deque[tuple[Entry, Model, MeasuredPose | None]] = deque()

    def note(self, reports: Sequence[ImportReport] = ()) -> None:
        """Keep what the log gained."""
        found = {report.pose: report.measured for report in reports}
        for entry in self._campaign.entries[self._noted :]:
            event = entry.event
            if isinstance(event, FilesShown | FilesPlaced):  # nothing that pictures show
                continue
            measured = found.get(event.pose) if isinstance(event, Imported) else None
            self._waiting.append((entry, self._campaign.model, measured))
        self._noted = len(self._campaign.entries)

    def show(self) -> None:
        """Show it; what an interruption left over is shown the next time."""
        while self._waiting:
            self._story.tell(*self._waiting[0])
            self._waiting.popleft()

    def gained(self) -> list[Entry]:
        """What the engineer did, as the log on disk has it, since it was noted last."""
        new = Campaign(self._campaign.directory).entries[self._noted :]
        return [
            entry
            for entry in new
            if not isinstance(entry.event, Configured | Proposed | FilesShown)
        ]


@dataclass(frozen=True, eq=False)
class Station:
    """Nothing of it changes in the course of a session.

    `started` and `deadline` are monotonic times (s); a diagnosis is asked for from
    `explain_from` measured poses on.
    """

    campaign: Campaign
    inbox: Inbox
    screen: Screen
    keys: Keys
    rerun_queue: RerunQueue
    verdicts: Verdicts
    auto: bool
    hits_per_pose: int | None
    explaining: DiagnosisProcess | None
    explain_from: int
    started: float
    deadline: float | None

    def hits_at(self, proposal: Proposal) -> int:
        """How many hits make this pose."""
        each = self.campaign.cell.config.cost.hits_per_axis
        return self.hits_per_pose or each * len(proposal.hits)

    def mark(self, path: Path, digest: str = "") -> tuple[str, str]:
        """A file's content hash and what a table says of it."""
        return digest or self.inbox.digest(path), str(self.verdicts.table.row(path) or "")

    def known(self, path: Path, digest: str, course: Course) -> bool:
        """Whether a file is not to be offered: it is in use, or refused as it is stated now."""
        state, row = self.campaign.state, self.verdicts.table.row(path)
        if self.mark(path, digest) in course.aside:
            return True
        hits = [hit for m in state.recorded for hit in m.hits if hit.sha256 == digest]
        if digest in state.refused:
            hits = [state.refused[digest][1]]
            row = None if hits[0].hit is None else row
        if row is None or any(hit.accepted for hit in hits):
            return bool(hits)
        return any(not stated_otherwise(Source.of(row), hit) for hit in hits)

    def pose_before(self, pose: str) -> PoseBefore:
        """Where the robot was before this pose, and the usable hits there, refused or not."""
        entries, state = self.campaign.entries, self.campaign.state
        undone = taken_back(entries)
        for entry in reversed(entries):
            event = entry.event
            if entry.seq in undone or not isinstance(event, Imported | Confirmed | Refused):
                continue
            known = state.hit_at(event.pose)
            records = [hit for at, hit in state.refused.values() if at == event.pose]
            records += known.accepted if known is not None else ()
            if records and event.pose != pose:
                kept, band = self.campaign.recordings, self.campaign.cell.config.modes.band_hz
                read = (read_one(kept.source(record), band)[1] for record in records)
                return PoseBefore(event.pose, tuple(hit for hits in read for hit in hits))
        return PoseBefore()

    def key(self) -> str | None:
        """The next key, or None after a moment."""
        return self.keys.get(timeout_s=0.2)

    @property
    def late(self) -> bool:
        """Whether the time limit is over."""
        return self.deadline is not None and time.monotonic() > self.deadline

    def say(self, sentence: str, style: str = "") -> None:
        """A sentence under the page."""
        self.screen.say(Text(sentence, style=style))

    def say_diagnosis(self, wait: bool = False) -> None:
        """Say what the diagnosis beside the session found, once it is through."""
        text = self.explaining.told(wait) if self.explaining is not None else None
        if text is not None:
            self.say(f"Diagnosis: {text}", "bold")
