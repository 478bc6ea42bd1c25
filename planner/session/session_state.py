"""What a session works with, and how far it is, as values: each act gives the next one."""

import time
from collections import deque
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rich.text import Text

from planner.campaign import events
from planner.campaign.campaign import Campaign
from planner.campaign.imported_files import differs_from_table
from planner.campaign.importing import ImportReport
from planner.campaign.model import Model
from planner.campaign.state import CampaignState, taken_back
from planner.campaign.undo import in_short, last_acts, last_undone
from planner.dataset.measure import MeasuredPose
from planner.dataset.screened_files import Source, read_one
from planner.session import session_text
from planner.session.diagnosis_process import DiagnosisProcess
from planner.session.hit_verdicts import BAD, Before, HitVerdict, Part, Verdicts
from planner.session.inbox import Inbox
from planner.session.pose_screen import PosePage
from planner.session.screen import Keys, Screen

if TYPE_CHECKING:
    from planner.report.rerun.campaign import RerunView


@dataclass(frozen=True, eq=False)
class PoseInProgress:
    """A pose while the robot stands there: what is on the page, and which files wait.

    `since` is when (monotonic, s) the files were last seen to change; `asked` is the key that was
    pressed and acts only when pressed once more, until another is or files change. `numbers` are
    those of its hits, as they came; `typed` is the reason for a skip as far as it is typed, None
    where none is asked for; `before` is the pose measured last.
    """

    proposal: events.Proposal
    page: PosePage
    since: float
    before: Before = field(default_factory=dict)
    whole: tuple[Path, ...] = ()
    verdicts: tuple[HitVerdict, ...] = ()
    shown: tuple | None = None
    asked: str = ""
    numbers: dict[Part, int] = field(default_factory=dict)
    typed: str | None = None

    def paths(self, *kinds: str) -> frozenset[Path]:
        """Files of which every hit is of one of these kinds."""
        others = {verdict.path for verdict in self.verdicts if verdict.kind not in kinds}
        return frozenset(verdict.path for verdict in self.verdicts) - others

    def any_of(self, *kinds: str) -> frozenset[Path]:
        """Files with a hit of one of these kinds."""
        return frozenset(verdict.path for verdict in self.verdicts if verdict.kind in kinds)

    def reasons(self, files: Collection[Path]) -> dict[Path, str]:
        """What is wrong with the hits in these files, where something is."""
        return {
            path: " ".join(v.text for v in self.verdicts if v.path == path and v.kind in BAD)
            for path in files
        }

    @property
    def late_by_pose(self) -> dict[str, tuple[Path, ...]]:
        """Files that are of another pose, until the engineer says otherwise, by that pose."""
        late = [verdict for verdict in self.verdicts if verdict.kind == "late"]
        return {
            pose: tuple(dict.fromkeys(v.path for v in late if v.came == pose))
            for pose in dict.fromkeys(v.came for v in late)
        }


@dataclass(frozen=True, eq=False)
class SessionState:
    """How far a session is. All else is the campaign's, so that it may end anywhere.

    `asking` is the pose whose question is on the page; `here` are files that looked unsure and are
    right; `left` is the pose where the robot was before; `aside`, by content and row, what could
    not be imported without the engineer; `announced`: the target was.
    """

    visit: PoseInProgress | None = None
    asking: str = ""
    left: str = ""
    here: frozenset[Path] = frozenset()
    aside: frozenset[tuple[str, str]] = frozenset()
    measured: tuple[str, ...] = ()
    progress: str = ""
    announced: bool = False
    stop: str = ""
    ended: str = ""

    def undone(self, state: CampaignState) -> "SessionState":
        """After an act was taken back: what was measured may be gone with it."""
        measured = tuple(pose for pose in self.measured if pose in state.measurements)
        return replace(self, measured=measured, progress="", here=frozenset())

    def after(
        self, pose: str, model: Model, state: CampaignState, seconds: float, auto: bool
    ) -> "SessionState":
        """After one more measurement, `seconds` into the session."""
        measured, ends = (*self.measured, pose), self.stop
        if model.done and not self.announced:
            ends = "target reached" if auto else ""
        if len(state.used) >= model.cell.config.stop.measurements_max:
            ends = "as many measurements as campaign.toml allows"
        progress = session_text.progress_line(model, seconds / 60 / len(measured))
        told = self.announced or model.done
        return replace(self, measured=measured, announced=told, progress=progress, stop=ends)


class RerunQueue:
    """Keeps each new entry with the model right after it until there is time to tell the story."""

    def __init__(self, campaign: Campaign, story: "RerunView | None"):
        self._campaign, self._story = campaign, story
        self._noted = len(campaign.entries)
        self._waiting: deque[tuple[events.Entry, Model, MeasuredPose | None]] = deque()

    def note(self, reports: Sequence[ImportReport] = ()) -> None:
        """Keep what the log gained."""
        found = {report.pose: report.measured for report in reports}
        for entry in self._campaign.entries[self._noted :]:
            event = entry.event
            # Nothing that pictures show.
            if isinstance(event, events.FilesShown | events.FilesPlaced):
                continue
            measured = found.get(event.pose) if isinstance(event, events.Imported) else None
            self._waiting.append((entry, self._campaign.model, measured))
        self._noted = len(self._campaign.entries)

    def show(self) -> None:
        """Show it; what an interruption left over is shown the next time."""
        while self._waiting:
            if self._story is not None:
                self._story.log(*self._waiting[0])
            self._waiting.popleft()

    def gained(self) -> list[events.Entry]:
        """What the engineer did, as the log on disk has it, since it was noted last."""
        new = Campaign(self._campaign.directory).entries[self._noted :]
        return [
            entry
            for entry in new
            if not isinstance(entry.event, events.Configured | events.Proposed | events.FilesShown)
        ]


@dataclass(frozen=True, eq=False)
class Session:
    """Nothing of it changes in the course of a session.

    `started` and `deadline` are monotonic times (s).
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
    started: float
    deadline: float | None

    def hits_at(self, proposal: events.Proposal) -> int:
        """How many hits make this pose."""
        each = self.campaign.cell.config.cost.hits_per_axis
        return self.hits_per_pose or each * len(proposal.hits)

    def mark(self, path: Path, digest: str = "") -> tuple[str, str]:
        """A file's content hash and what a table says of it."""
        return digest or self.inbox.digest(path), str(self.verdicts.table.row(path) or "")

    def known(self, path: Path, digest: str, state: SessionState) -> bool:
        """Whether a file is not to be offered: it is in use, or refused as it is stated now."""
        logged, row = self.campaign.state, self.verdicts.table.row(path)
        if self.mark(path, digest) in state.aside:
            return True
        hits = [hit for m in logged.recorded for hit in m.hits if hit.sha256 == digest]
        if digest in logged.refused:
            hits = [logged.refused[digest][1]]
            row = None if hits[0].hit is None else row
        if row is None or any(hit.accepted for hit in hits):
            return bool(hits)
        return any(not differs_from_table(Source.of(row), hit) for hit in hits)

    def pose_before(self, pose: str) -> Before:
        """Where the robot was before this pose, and the usable hits there, refused or not."""
        entries, state = self.campaign.entries, self.campaign.state
        undone = taken_back(entries)
        for entry in reversed(entries):
            event = entry.event
            if entry.seq in undone or not isinstance(
                event, events.Imported | events.Confirmed | events.Refused
            ):
                continue
            known = state.hit_at(event.pose)
            records = [hit for at, hit in state.refused.values() if at == event.pose]
            records += known.accepted if known is not None else ()
            if records and event.pose != pose:
                kept, band = self.campaign.recordings, self.campaign.cell.config.modes.band_hz
                read = (read_one(kept.source(record), band)[1] for record in records)
                return {event.pose: tuple(hit for hits in read for hit in hits)}
        return {}

    @property
    def can_take_back(self) -> tuple[str, str]:
        """The act that can be undone, and the one that can be redone, in a word or two; ""s."""
        entries = self.campaign.entries
        acts, undone = last_acts(entries, decisions_only=True), last_undone(entries)[0]
        again = undone.event.acts[:1] if undone and isinstance(undone.event, events.Undone) else ()
        redone = entries[again[0] - 1] if again else None
        return in_short(acts[0] if acts else None), in_short(redone)

    def key(self) -> str | None:
        """The next key, or None after a moment."""
        return self.keys(0.2)

    @property
    def late(self) -> bool:
        """Whether the time limit is over."""
        return self.deadline is not None and time.monotonic() > self.deadline

    def say(self, sentence: str, style: str = "") -> None:
        """A sentence under the page."""
        self.screen.say(Text(sentence, style=style))

    def say_diagnosis(self, wait: bool = False) -> None:
        """Say what the diagnosis beside the session found, once it is through."""
        text = self.explaining.answer(wait) if self.explaining is not None else None
        if text is not None:
            self.say(f"Diagnosis: {text}", "bold")
