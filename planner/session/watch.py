"""The session's loop. All state is the campaign's: quit or kill it anywhere, and start it again."""

import time
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.campaign.events import Entry, Imported, Proposal
from planner.campaign.importing import ImportReport
from planner.campaign.model import Model
from planner.campaign.state import CampaignState
from planner.dataset.measure import MeasuredPose
from planner.errors import InputError, NoPoseLeftError, PlannerError
from planner.recording.folder import TABLE
from planner.replay import replay
from planner.report import session_text
from planner.report.answer import Answer
from planner.report.rerun_story import Story
from planner.session.diagnosis_process import LEAST, DiagnosisProcess
from planner.session.inbox import Inbox
from planner.session.keys import Keys, NoKeys, terminal_keys

POLL_S = 0.2


@dataclass(frozen=True)
class SessionSummary(Answer):
    """How a session ended."""

    measured: tuple[str, ...]
    stopped: str
    frequency_sd_percent: tuple[float, ...]
    seconds: float
    questions: dict[str, str]  # not answered, by pose: the hits they speak of are held


def watch(
    campaign: Campaign,
    folder: Path,
    *,
    console: Console,
    auto: bool = False,
    hits_per_pose: int = 12,
    rrd: Path | None = None,
    viewer: bool = False,
    explain: bool = False,
    keys: Keys | None = None,
    quiet_s: float = 1.0,
    limit_s: float | None = None,
) -> SessionSummary:
    """Run a session until quit, target, no pose left, or `limit_s`.

    `auto` imports without asking, as does a session without a keyboard. `explain` diagnoses after
    each import, beside the session, and says what the simulation lacks.
    """
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder; name the one the analyser exports into.")
    with ExitStack() as stack:
        source = keys or stack.enter_context(terminal_keys())
        story = stack.enter_context(Story(campaign.cell, rrd, viewer))
        if rrd is not None or viewer:  # a resumed session shows what went before, too
            for step in replay(campaign):
                story.tell(step.entry, step.state, step.model, step.measured)
        explaining = DiagnosisProcess(campaign.directory) if explain else None
        if explaining is not None:
            stack.callback(explaining.close)
        session = _Session(
            campaign, Inbox(folder, quiet_s), console, source, story,
            auto or isinstance(source, NoKeys), hits_per_pose, limit_s, explaining,
        )  # fmt: skip
        return session.run()


class _Session:
    def __init__(
        self, campaign: Campaign, inbox: Inbox, console: Console, keys: Keys, story: Story,
        auto: bool, hits_per_pose: int, limit_s: float | None, explaining: DiagnosisProcess | None,
    ):  # fmt: skip
        self.campaign, self.inbox, self.console, self.keys = campaign, inbox, console, keys
        self.story, self.auto, self.hits_per_pose = story, auto, hits_per_pose
        self.explaining = explaining
        self.started = time.monotonic()
        self.deadline = None if limit_s is None else self.started + limit_s
        self.aside: set[str] = set()  # by content: could not be imported without the engineer
        self.measured: list[str] = []
        self.history: list[float] = []
        self.stop = ""
        self.noted = len(campaign.entries)
        self.untold: list[tuple[Entry, CampaignState, Model, MeasuredPose | None]] = []
        self.shown_count = 0
        self.told_of: set[tuple[Path, str]] = set()
        self.announced = False

    def run(self) -> SessionSummary:
        try:
            for remark in self.campaign.cell.remarks:
                self.console.print(Text(remark, style="yellow"))
            while not self.stop:
                held = () if self.auto else tuple(self.campaign.state.held)
                if held:
                    self._ask(held[0])
                elif (proposal := self._propose()) is not None:
                    self._at_pose(proposal)
            self._tell()
            if self.stop != "quit":
                with self.console.status("finding what the simulation lacks"):
                    self._explained(wait=True)
        except KeyboardInterrupt:
            self.stop = "quit"
        finally:
            with suppress(KeyboardInterrupt):
                self._tell()
        self.console.print(Text(f"Session ended: {self.stop}. Go on with the same command."))
        return SessionSummary(
            tuple(self.measured),
            self.stop,
            tuple(self.campaign.model.frequency_sd_percent.tolist()),
            time.monotonic() - self.started,
            {p: m.question.text for p, m in self.campaign.state.held.items() if m.question},
        )

    def _ask(self, pose: str) -> None:
        """Wait until the engineer has said of held hits where they are from."""
        question = self.campaign.state.held[pose].question
        assert question is not None
        other = question.fits if question.fits in self.campaign.state.open else ""
        self.console.print(session_text.question_panel(question, pose, other))
        while not self.stop:
            try:
                if self._answer(self.keys.get(POLL_S), pose, other):
                    self._tell()
                    return
            except PlannerError as error:
                self.console.print(Text(str(error), style="red"))
                return
            if self.deadline is not None and time.monotonic() > self.deadline:
                self.stop = "time limit"

    def _answer(self, key: str | None, pose: str, other: str) -> bool:
        """Act on a key while a question is open; True when it is answered."""
        match key:
            case "a" | "\n" | "\r":
                with self.console.status("refitting"):
                    self.campaign.confirm(pose)
                    self._note()
                self.console.print(Text(f"The hits of {pose} are used."))
                self._measured(pose)
            case "r":
                self.campaign.refuse_held(pose)
                self._note()
                self.console.print(Text(f"The hits of {pose} are set aside; hit again."))
            case "o" if other:
                with self.console.status("importing and refitting"):
                    report = self.campaign.move(pose, other)
                self._note([report])
                self._after(report)
            case "u":
                self._undo()
            case "q":
                self.stop = "quit"
                return False
            case _:
                return False
        return True

    def _undo(self) -> None:
        entry = self.campaign.undo(decisions_only=True)
        self._note()
        kind = type(entry.event).__name__.lower()
        self.console.print(Text(f"Took back entry {entry.seq} ({kind})."))

    def _propose(self) -> Proposal | None:
        try:
            with self.console.status("choosing the next pose"):
                proposal = self.campaign.next()[0]
        except NoPoseLeftError as error:
            self.console.print(Text(str(error)))
            self.stop = "no pose left"
            return None
        self._note()
        number = len(self.campaign.model.labelled) + 1
        self.console.print(session_text.proposal_panel(proposal, self.campaign.model, number))
        self._tell()
        return proposal

    def _explained(self, wait: bool = False) -> None:
        """Say what the diagnosis beside the session found, once it is through."""
        text = self.explaining.told(wait) if self.explaining is not None else None
        if text is not None:
            self.console.print(Text(f"Diagnosis: {text}", style="bold"))

    def _note(self, reports: Sequence[ImportReport] = ()) -> None:
        """Keep what the log gained until there is time to show it."""
        found = {report.pose: report.measured for report in reports}
        for entry in self.campaign.entries[self.noted :]:
            event = entry.event
            measured = found.get(event.pose) if isinstance(event, Imported) else None
            self.untold.append((entry, self.campaign.state, self.campaign.model, measured))
        self.noted = len(self.campaign.entries)

    def _tell(self) -> None:
        """Show it in Rerun: pictures take seconds, so once the next pose is on the screen."""
        while self.untold:
            self.story.tell(*self.untold[0])
            self.untold.pop(0)

    def _at_pose(self, proposal: Proposal) -> None:
        """Wait at one pose for hits and keys, until it is measured, skipped or superseded."""
        shown: tuple = ()
        since = time.monotonic()
        if not self.auto:
            self.console.print(Text(session_text.KEYS, style="dim"))
        while not self.stop:
            self._explained()
            whole, waiting = self.inbox.scan(self._done())
            now = (tuple(whole), tuple(p for p, _ in waiting))
            if now != shown:
                self._arrived(whole, waiting)
                shown, since = now, time.monotonic()
            quiet = time.monotonic() - since > 3 * self.inbox.quiet_s
            if self.auto and whole and (len(whole) >= self.hits_per_pose or quiet):
                if self._import(proposal, whole):
                    return
                continue
            if self._key(self.keys.get(POLL_S), proposal, whole):
                return
            if self.deadline is not None and time.monotonic() > self.deadline:
                self.stop = "time limit"

    def _done(self) -> set[str]:
        state = self.campaign.state
        return (
            self.aside | state.refused.keys() | {h.sha256 for m in state.recorded for h in m.hits}
        )

    def _arrived(self, whole: list[Path], waiting: list[tuple[Path, str]]) -> None:
        if len(whole) != self.shown_count:
            self.shown_count = len(whole)
            names = ", ".join(p.name for p in whole[-4:])
            text = f"{len(whole)} of {self.hits_per_pose} hits wait ({names})"
            self.console.print(Text(text, style="green"))
        for path, why in waiting:
            if why != "is being written" and (path, why) not in self.told_of:
                self.told_of.add((path, why))
                self.console.print(Text(f"not whole yet: {why}", style="dim"))

    def _key(self, key: str | None, proposal: Proposal, whole: list[Path]) -> bool:
        """Act on a key; True when the pose is over."""
        try:
            match key:
                case "a" | "\n" | "\r":
                    return self._import(proposal, whole)
                case "r":
                    self.campaign.refuse(proposal.pose, tuple(whole))
                    self._note()
                    self.console.print(Text(f"{len(whole)} hits set aside; hit again."))
                case "s":
                    self.campaign.star(proposal.pose)
                    self.console.print(Text(f"★ {proposal.pose}"))
                case "k":
                    self.campaign.skip(proposal.pose, "skipped in the session")
                    self.console.print(Text(f"{proposal.pose} will not be offered again."))
                    return True
                case "u":
                    self._undo()
                    return True
                case "n":
                    self.campaign.skip(proposal.pose, "another was asked for")
                    return True
                case "q":
                    self.stop = "quit"
                case "?":
                    self.console.print(Text(session_text.HELP))
        except PlannerError as error:
            self.console.print(Text(str(error), style="red"))
        return False

    def _import(self, proposal: Proposal, whole: list[Path]) -> bool:
        """Import the waiting hits; True when the pose gave modes."""
        if not whole:
            self.console.print(Text("No whole new file waits yet.", style="yellow"))
            return False
        table = self.inbox.folder / TABLE
        paths = (self.inbox.folder,) if table.is_file() else tuple(whole)
        try:
            with self.console.status("importing and refitting"):
                reports = self.campaign.import_paths(
                    paths, None if table.is_file() else proposal.pose
                )
        except PlannerError as error:
            self.console.print(Text(str(error), style="red"))
            self.aside |= {self.inbox.digest(path) for path in whole} if self.auto else set()
            return False
        self._note(reports)
        for report in reports:
            self.aside |= {hit.sha256 for hit in report.left_out}
            if report.question is not None:
                self._held_back(report)
            elif report.accepted or report.refused:
                self._after(report)
        done = any(report.measurement and report.measurement.modes for report in reports)
        if not done:
            self._tell()
        return done

    def _held_back(self, report: ImportReport) -> None:
        """Without anybody to ask, say so; else the question comes next."""
        if self.auto and report.measured is not None and report.question is not None:
            self.console.print(Text(f"Held back, not used: {report.question.text}", style="red"))

    def _after(self, report: ImportReport) -> None:
        if report.question is not None:  # at the pose it was moved to it does not fit either
            return
        simulated = bool(report.measurement and report.measurement.simulated)
        self.console.print(session_text.import_panel(report, simulated))
        self._measured(report.pose)

    def _measured(self, pose: str) -> None:
        """Say how far the campaign is after one more pose."""
        state, model = self.campaign.state, self.campaign.model
        stop = self.campaign.cell.config.stop
        self.measured.append(pose)
        overall = float(np.sqrt(np.mean(model.frequency_sd_percent**2)))
        self.history.append(overall)
        per_pose = (time.monotonic() - self.started) / len(self.measured)
        self.console.print(
            session_text.progress_line(
                self.history, stop.frequency_sd_percent, per_pose, stop.measurements_min
            )
        )
        if self.explaining is not None and len(state.used) >= LEAST:
            self.explaining.ask()
        if not self.announced and model.done:
            self.announced = True
            self.console.print(Text("The target of campaign.toml is reached.", style="bold green"))
            self.stop = "target reached" if self.auto else ""
        if len(state.used) >= stop.measurements_max:
            self.stop = "as many measurements as campaign.toml allows"
