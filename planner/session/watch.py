"""The session's loop. All state is the campaign's: quit or kill it anywhere, and start it again."""

import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.errors import InputError, PlannerError
from planner.replay import replay
from planner.report.answer import Answer
from planner.session import session_text
from planner.session.diagnosis_process import DiagnosisProcess
from planner.session.hit_verdicts import HitVerdict, Part, Verdicts
from planner.session.inbox import FolderTable, Inbox
from planner.session.key_commands import (
    answer,
    arrive,
    import_waiting,
    interrupted,
    on_key,
    say_last_import,
)
from planner.session.pose_screen import page_with_hits
from planner.session.screen import Keys, Screen, no_keys, terminal_keys
from planner.session.session_state import PoseInProgress, RerunQueue, Session, SessionState
from planner.words import counted, short_name

if TYPE_CHECKING:
    from planner.report.rerun.campaign import RerunView

AS_PROPOSED = "Angles are taken as proposed, unless recordings.csv beside the hits states others."


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
    hits_per_pose: int | None = None,
    rrd: Path | None = None,
    viewer: bool = False,
    explain: bool = False,
    keys: Keys | None = None,
    quiet_s: float = 0.6,
    limit_s: float | None = None,
) -> SessionSummary:
    """Run a session until quit, target, no pose left, or `limit_s`.

    As many hits as campaign.toml's [cost] hits_per_axis make a pose, unless `hits_per_pose` says
    otherwise. A file is whole that stood still for `quiet_s`: a verdict comes within a second.
    `auto` imports without asking, as does a session without a keyboard. `explain` diagnoses after
    each import, beside the session, and says what the simulation lacks. Nobody else can act in the
    campaign meanwhile: InputError names who does.
    """
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder; name the one the analyser exports into.")
    with ExitStack() as stack:
        stack.enter_context(campaign.holding())
        source = keys or stack.enter_context(terminal_keys())
        story = _story(campaign, rrd, viewer, stack) if rrd is not None or viewer else None
        explaining = DiagnosisProcess(campaign.directory) if explain else None
        if explaining is not None:
            stack.callback(explaining.close)
        cell, started = campaign.cell, time.monotonic()
        verdicts = Verdicts(
            cell.config.modes.band_hz, cell.robot.points,
            FolderTable(folder, cell.robot.joints, cell.robot.points, cell.check_pose),
        )  # fmt: skip
        inbox = Inbox(folder, quiet_s, verdicts.unfit)
        return _run(Session(
            campaign, inbox, Screen(console), source, RerunQueue(campaign, story), verdicts,
            auto or source is no_keys, hits_per_pose, explaining, started,
            None if limit_s is None else started + limit_s,
        ))  # fmt: skip


def _story(campaign: Campaign, rrd: Path | None, viewer: bool, stack: ExitStack) -> "RerunView":
    """The Rerun view; of a resumed session it shows what went before, too."""
    from planner.report.rerun.campaign import RerunView

    story = RerunView(campaign.cell, rrd, viewer)
    stack.callback(story.close)
    for step in replay(campaign):
        story.log(step.entry, step.model, step.measured)
    return story


def _run(session: Session) -> SessionSummary:
    campaign, console = session.campaign, session.screen.console
    state = SessionState()
    try:
        for remark in campaign.cell.remarks:
            session.say(remark, "yellow")
        session.say(AS_PROPOSED, "dim")
        with session.screen.working("fitting the model to what was measured"):
            _ = campaign.model
        say_last_import(session)
        while not state.stop:  # an interruption loses no more than one look at folder and keys
            if state.visit is not None:
                state = _at_pose(session, state, state.visit)
            elif campaign.state.held and not session.auto:
                state = _asked(session, state)
            else:
                state = arrive(session, state)
        session.rerun_queue.show()
        if state.stop != "quit":
            with console.status("finding what the simulation lacks"):
                session.say_diagnosis(wait=True)
    except KeyboardInterrupt:
        state = replace(state, stop="quit", ended=interrupted(session))
    finally:
        with suppress(KeyboardInterrupt):
            session.rerun_queue.show()
    if state.ended:
        console.print(Text(state.ended))
    console.print(Text(f"Session ended: {state.stop}. The same command goes on with it."))
    return SessionSummary(
        state.measured,
        state.stop,
        tuple(campaign.model.frequency_sd_percent.tolist()),
        time.monotonic() - session.started,
        {p: m.question.text for p, m in campaign.state.held.items() if m.question},
    )


def _asked(session: Session, state: SessionState) -> SessionState:
    """Wait for what the engineer says of held hits: where are they from?"""
    held = session.campaign.state.held
    pose = state.asking or next(iter(held))
    question = held[pose].question
    assert question is not None
    other = question.fits if question.fits in session.campaign.state.open else ""
    if not state.asking:
        session.screen.show(session_text.question_panel(question, pose, other))
        session.screen.bell(3)
        state = replace(state, asking=pose)
    try:
        state = answer(session, state, session.key(), other)
    except PlannerError as error:
        session.say(str(error), "red")
        return replace(state, asking="")
    return _unless_late(session, state) if state.asking else state


def _at_pose(session: Session, state: SessionState, visit: PoseInProgress) -> SessionState:
    """See what waits at a pose, and act on a key, until it is measured, skipped or superseded."""
    session.say_diagnosis()
    visit = _looked(session, state, visit)
    state = replace(state, visit=visit)
    waited = time.monotonic() - visit.since > 3 * session.inbox.quiet_s
    unready = visit.any_of("unstated", "late")
    ready = [path for path in visit.whole if path not in unready]
    hits = sum(verdict.path in ready for verdict in visit.verdicts)
    if session.auto and ready and (hits >= session.hits_at(visit.proposal) or waited):
        return import_waiting(session, state, visit, ready)
    state = on_key(session, state, visit, session.key())
    return _unless_late(session, state) if state.visit is not None else state


def _looked(session: Session, state: SessionState, visit: PoseInProgress) -> PoseInProgress:
    """The visit with what the folder holds now; what changed is drawn, and rung for."""
    for table in session.verdicts.table.follow():
        session.say(f"{table.parent.name}/{table.name} was read again and is right now.", "green")
    refused, pose, logged = list[Path](), visit.proposal.pose, session.campaign.state.refused

    def known(path: Path, digest: str) -> bool:
        there = session.known(path, digest, state)
        if there and digest in logged and logged[digest][0] == pose:
            refused.append(path)
        return there

    whole, waiting = session.inbox.scan(known)
    waiting += session.verdicts.table.waiting
    if refused:
        files = counted(len(refused), "file")
        text = f"{files} of {pose} refused before and not changed; press [u] to take that back."
        waiting.append((refused[0], text))
    for path in session.inbox.ignored():
        session.say(f"{path.name} is no recording; ignored.", "dim")
    numbers = session.verdicts.numbered(whole, visit.numbers)
    verdicts = _shown(session, visit, whole, state.here, numbers)
    now = (tuple(whole), tuple(waiting), tuple((v.kind, v.text) for v in verdicts))
    if now == visit.shown:
        return visit
    can = session.can_take_back
    page = page_with_hits(visit.page, verdicts, waiting, can, session.auto, state.progress)
    session.screen.ring({(str(v.path), v.number): v.kind for v in verdicts})
    session.screen.show(page.page)
    seen = replace(
        visit, page=page, whole=tuple(whole), verdicts=verdicts, shown=now, since=time.monotonic(),
        numbers=numbers, asked="",
    )  # fmt: skip
    for at, files in seen.late_by_pose.items() if session.auto else ():
        names = ", ".join(short_name(path) for path in files)
        held = f"Held, not used: {names} of {at}; import --pose {at} takes them there."
        session.say(held, "yellow")
    return seen


def _shown(
    session: Session,
    visit: PoseInProgress,
    whole: Sequence[Path],
    here: frozenset[Path],
    numbers: Mapping[Part, int],
) -> tuple[HitVerdict, ...]:
    """Verdicts on what the folder holds, with the pose of each file in the log before they show.

    Of files that a table lists it says the pose.
    """
    pose, state = visit.proposal.pose, session.campaign.state
    digests = {path: session.inbox.digest(path) for path in whole}
    known = {path: digest for path, digest in digests.items() if digest in state.shown}
    shown = {path: state.came(digest, pose) for path, digest in known.items()}
    rows = ((path, session.verdicts.table.row(path)) for path in whole)
    shown |= {path: row.pose for path, row in rows if row is not None}
    verdicts = session.verdicts.of(whole, visit.before, here, numbers, shown, pose)
    new: dict[str, dict[str, None]] = {}
    for verdict in verdicts:
        if verdict.path not in shown and digests[verdict.path]:
            new.setdefault(verdict.came or pose, {})[digests[verdict.path]] = None
    for of, files in new.items():
        session.campaign.show(of, tuple(files), pose if of != pose else "")
    if new:
        session.rerun_queue.note()
    return verdicts


def _unless_late(session: Session, state: SessionState) -> SessionState:
    return replace(state, stop="time limit") if session.late and not state.stop else state
