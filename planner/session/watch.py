"""The session's loop. All state is the campaign's: quit or kill it anywhere, and start it again."""

import time
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
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
from planner.report.pose_screen import JudgedHit, PosePage, keys_that_do
from planner.report.rerun_story import Story
from planner.session.diagnosis_process import LEAST, DiagnosisProcess
from planner.session.inbox import Inbox
from planner.session.keys import Keys, NoKeys, terminal_keys
from planner.session.screen import Screen
from planner.session.verdicts import HitVerdict, Verdicts

POLL_S = 0.2
QUIET_S = 0.6  # a file that stood still for so long is whole: a verdict comes within a second


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
    quiet_s: float = QUIET_S,
    limit_s: float | None = None,
) -> SessionSummary:
    """Run a session until quit, target, no pose left, or `limit_s`.

    `auto` imports without asking, as does a session without a keyboard. `explain` diagnoses after
    each import, beside the session, and says what the simulation lacks. Nobody else can act in the
    campaign meanwhile: InputError names who does.
    """
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder; name the one the analyser exports into.")
    with ExitStack() as stack:
        stack.enter_context(campaign.holding())
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
        cell = campaign.cell
        self.screen = Screen(console)
        self.verdicts = Verdicts(cell.config.modes.band_hz, cell.robot.points)
        self.here: set[Path] = set()  # looked late, and were said to be of the open pose
        self.pressed = False  # accept was pressed though hits are missing
        self.before = ""  # the pose measured last in this session
        self.progress = ""
        self.story, self.auto, self.hits_per_pose = story, auto, hits_per_pose
        self.explaining = explaining
        self.started = time.monotonic()
        self.deadline = None if limit_s is None else self.started + limit_s
        self.aside: set[str] = set()  # by content: could not be imported without the engineer
        self.measured: list[str] = []
        self.history: list[float] = []
        self.stop, self.ended = "", ""
        self.noted = len(campaign.entries)
        self.untold: list[tuple[Entry, CampaignState, Model, MeasuredPose | None]] = []
        self.rung: set[tuple[Path, int]] = set()
        self.announced = False

    def run(self) -> SessionSummary:
        try:
            for remark in self.campaign.cell.remarks:
                self.screen.say(Text(remark, style="yellow"))
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
        if self.ended:
            self.console.print(Text(self.ended))
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
        self.screen.show(session_text.question_panel(question, pose, other))
        self.screen.bell(3)
        while not self.stop:
            try:
                if self._answer(self.keys.get(POLL_S), pose, other):
                    self._tell()
                    return
            except PlannerError as error:
                self.screen.say(Text(str(error), style="red"))
                return
            if self.deadline is not None and time.monotonic() > self.deadline:
                self.stop = "time limit"

    def _answer(self, key: str | None, pose: str, other: str) -> bool:
        """Act on a key while a question is open; True when it is answered."""
        match key:
            case "a" | "\n" | "\r":
                with self.screen.working("refitting"):
                    self.campaign.confirm(pose)
                    self._note()
                self.screen.say(Text(f"The hits of {pose} are used."))
                self._measured(pose)
            case "r":
                self.campaign.refuse_held(pose)
                self._note()
                self.screen.say(Text(f"The hits of {pose} are set aside; hit again."))
            case "o" if other:
                with self.screen.working("importing and refitting"):
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
        if self.before not in self.campaign.state.measurements:
            self.verdicts.forget()
            self.before = ""
        self.progress = ""
        self._note()
        kind = type(entry.event).__name__.lower()
        self.screen.say(Text(f"Took back entry {entry.seq} ({kind})."))

    def _propose(self) -> Proposal | None:
        try:
            with self.screen.working("choosing the next pose"):
                proposal = self.campaign.next()[0]
        except NoPoseLeftError as error:
            self.screen.say(Text(str(error)))
            self.stop = "no pose left"
            return None
        self._note()
        self.pressed = False
        self.page = self._page(proposal)
        self._draw((), [])
        self._tell()
        return proposal

    def _explained(self, wait: bool = False) -> None:
        """Say what the diagnosis beside the session found, once it is through."""
        text = self.explaining.told(wait) if self.explaining is not None else None
        if text is not None:
            self.screen.say(Text(f"Diagnosis: {text}", style="bold"))

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

    def _page(self, proposal: Proposal) -> PosePage:
        """What the screen says of a pose before anything was hit there."""
        model, robot = self.campaign.model, self.campaign.cell.robot
        expected = model.predict(np.deg2rad([proposal.joints_deg]))
        return PosePage(
            proposal, len(model.labelled) + 1, robot.joint_names, robot.config.tcp_frame,
            max(1, self.hits_per_pose // len(proposal.hits)), (),
            tuple(expected.frequency_hz[0].tolist()), tuple(expected.frequency_sd_hz[0].tolist()),
            self.inbox.folder, progress=self.progress, pose_before=self.before,
        )  # fmt: skip

    def _draw(self, verdicts: tuple[HitVerdict, ...], waiting: list[tuple[Path, str]]) -> None:
        """The page with what waits; rings for each new verdict."""
        hits, new = [], []
        for number, verdict in enumerate(verdicts, 1):
            late = f"answers as {self.before} did: [b] it is from there, [h] from here"
            text = late if verdict.kind == "late" else verdict.text
            hits.append(JudgedHit(number, verdict.axis, verdict.kind, text))
            if (verdict.path, number) not in self.rung:
                self.rung.add((verdict.path, number))
                new.append(verdict.kind)
        page = replace(
            self.page, hits=tuple(hits), unfinished=tuple(_named(*one) for one in waiting),
            progress=self.progress,
        )  # fmt: skip
        kinds = {hit.kind for hit in hits}
        keys = [
            ("a", "accept" if page.complete else "accept as it is", "good" in kinds),
            ("r", "refuse all", bool(hits)),
            ("b", f"late ones to {self.before}", "late" in kinds),
            ("h", "late ones are from here", "late" in kinds),
            ("s", "star", True), ("k", "skip", True), ("n", "other pose", True),
            ("u", "undo", bool(self.campaign.state.recorded or self.campaign.state.events > 2)),
            ("q", "quit", True), ("?", "help", True),
        ]  # fmt: skip
        self.page = replace(page, keys="" if self.auto else keys_that_do(keys))
        if new:
            self.screen.forget()
            self.screen.bell(3 if set(new) - {"good"} else 1)
        self.screen.show(self.page.page())

    def _at_pose(self, proposal: Proposal) -> None:
        """Wait at one pose for hits and keys, until it is measured, skipped or superseded."""
        shown: tuple | None = None
        since = time.monotonic()
        while not self.stop:
            self._explained()
            whole, waiting = self.inbox.scan(self._done())
            verdicts = self.verdicts.of(whole, frozenset(self.here))
            now = (tuple(whole), tuple(waiting), tuple(v.kind for v in verdicts))
            if now != shown:
                self._draw(verdicts, waiting)
                shown, since = now, time.monotonic()
            quiet = time.monotonic() - since > 3 * self.inbox.quiet_s
            if self.auto and whole and (len(whole) >= self.hits_per_pose or quiet):
                if self._import(proposal, whole):
                    return
                continue
            if self._key(self.keys.get(POLL_S), proposal, whole, verdicts):
                return
            if self.deadline is not None and time.monotonic() > self.deadline:
                self.stop = "time limit"

    def _done(self) -> set[str]:
        state = self.campaign.state
        return (
            self.aside | state.refused.keys() | {h.sha256 for m in state.recorded for h in m.hits}
        )

    def _key(
        self, key: str | None, proposal: Proposal, whole: list[Path],
        verdicts: tuple[HitVerdict, ...],
    ) -> bool:  # fmt: skip
        """Act on a key; True when the pose is over."""
        late = {verdict.path for verdict in verdicts if verdict.kind == "late"}
        try:
            match key:
                case "a" | "\n" | "\r":
                    good = any(verdict.kind == "good" for verdict in verdicts)
                    if good and not self.page.complete and not self.pressed:
                        self.pressed = True
                        self.screen.say(Text(session_text.incomplete(self.page), style="yellow"))
                        return False
                    return self._import(proposal, [path for path in whole if path not in late])
                case "b" if late:
                    self._to_before(sorted(late))
                case "h" if late:
                    self.here |= late
                case "r" if whole:
                    self.campaign.refuse(proposal.pose, tuple(whole))
                    self._note()
                    self.screen.say(Text(f"{len(whole)} hits set aside; hit again."))
                case "s":
                    self.campaign.star(proposal.pose)
                    self.screen.say(Text(f"★ {proposal.pose}"))
                case "k":
                    self.campaign.skip(proposal.pose, "skipped in the session")
                    self.screen.say(Text(f"{proposal.pose} will not be offered again."))
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
                    self.screen.say(Text(session_text.HELP))
        except PlannerError as error:
            self.screen.say(Text(str(error), style="red"))
        return False

    def _import(self, proposal: Proposal, whole: list[Path]) -> bool:
        """Import the waiting hits; True when the pose gave modes."""
        if not whole:
            self.screen.say(Text("No whole new file waits yet.", style="yellow"))
            return False
        table = self.inbox.folder / TABLE
        paths = (self.inbox.folder,) if table.is_file() else tuple(whole)
        try:
            with self.screen.working("importing and refitting"):
                reports = self.campaign.import_paths(
                    paths, None if table.is_file() else proposal.pose
                )
        except KeyboardInterrupt:
            self._interrupted()
            raise
        except PlannerError as error:
            self.screen.say(Text(str(error), style="red"))
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
        if done:
            self.verdicts.moved_on()
            self.before, self.here = proposal.pose, set()
        else:
            self._tell()
        return done

    def _to_before(self, late: list[Path]) -> None:
        """Import hits that came late to the pose that they are of."""
        with self.screen.working("importing and refitting"):
            reports = self.campaign.import_paths(tuple(late), self.before)
        self._note(reports)
        for report in reports:
            self.screen.say(Text(session_text.result_line(report), style="bold"))

    def _interrupted(self) -> None:
        """Say what of an import that was stopped is in the log."""
        entries = Campaign(self.campaign.directory).entries[self.noted :]
        poses = [entry.event.pose for entry in entries if isinstance(entry.event, Imported)]
        self.ended = (
            f"Stopped while importing: the hits of {', '.join(poses)} are in the log; planner undo "
            f"takes them back."
            if poses
            else "Stopped while importing: nothing of it is in the log, the hits wait."
        )

    def _held_back(self, report: ImportReport) -> None:
        """Without anybody to ask, say so; else the question comes next."""
        if self.auto and report.measured is not None and report.question is not None:
            self.screen.say(Text(f"Held back, not used: {report.question.text}", style="red"))

    def _after(self, report: ImportReport) -> None:
        if report.question is not None:  # at the pose it was moved to it does not fit either
            return
        simulated = bool(report.measurement and report.measurement.simulated)
        self.screen.show(session_text.import_panel(report, simulated))
        if self.console.is_terminal:  # the page goes with the next pose
            self.screen.say(Text(session_text.result_line(report), style="bold"))
        self._measured(report.pose)

    def _measured(self, pose: str) -> None:
        """Say how far the campaign is after one more pose."""
        state, model = self.campaign.state, self.campaign.model
        stop = self.campaign.cell.config.stop
        self.measured.append(pose)
        overall = float(np.sqrt(np.mean(model.frequency_sd_percent**2)))
        self.history.append(overall)
        per_pose = (time.monotonic() - self.started) / len(self.measured)
        left = session_text.progress_line(
            self.history, stop.frequency_sd_percent, per_pose, stop.measurements_min
        )
        self.progress = f"sd over the workspace {overall:.2f} %; {left}"
        if not self.console.is_terminal:  # there it stands on the page
            self.screen.say(left)
        if self.explaining is not None and len(state.used) >= LEAST:
            self.explaining.ask()
        if not self.announced and model.done:
            self.announced = True
            self.screen.say(Text("The target of campaign.toml is reached.", style="bold green"))
            self.stop = "target reached" if self.auto else ""
        if len(state.used) >= stop.measurements_max:
            self.stop = "as many measurements as campaign.toml allows"


def _named(path: Path, why: str) -> str:
    """What is the matter with a file, by its name alone."""
    text = why.replace(str(path), path.name)
    return text if path.name in text else f"{path.name} {text}"
