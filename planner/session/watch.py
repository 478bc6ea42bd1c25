"""The session's loop. All state is the campaign's: quit or kill it anywhere, and start it again."""

import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.errors import InputError, PlannerError
from planner.replay import replay
from planner.report.answer import Answer
from planner.report.rerun.story import Story
from planner.session import session_text
from planner.session.acts import (
    answer,
    arrive,
    import_waiting,
    interrupted,
    on_key,
    say_last_import,
)
from planner.session.diagnosis_process import LEAST, DiagnosisProcess
from planner.session.hit_verdicts import HitVerdict, Part, Verdicts
from planner.session.inbox import FolderTable, Inbox
from planner.session.pose_screen import page_with_hits
from planner.session.screen import Keys, NoKeys, Screen, terminal_keys
from planner.session.station import Course, PoseInProgress, RerunQueue, Station
from planner.words import short_name


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
        story = stack.enter_context(Story(campaign.cell, rrd, viewer))
        if rrd is not None or viewer:  # a resumed session shows what went before, too
            for step in replay(campaign):
                story.tell(step.entry, step.model, step.measured)
        explaining = DiagnosisProcess(campaign.directory) if explain else None
        if explaining is not None:
            stack.callback(explaining.close)
        cell, started = campaign.cell, time.monotonic()
        verdicts = Verdicts(
            cell.config.modes.band_hz, cell.robot.points,
            FolderTable(folder, cell.robot.joints, cell.robot.points, cell.check_pose),
        )  # fmt: skip
        inbox = Inbox(folder, quiet_s, verdicts.unfit)
        return _run(Station(
            campaign, inbox, Screen(console), source, RerunQueue(campaign, story), verdicts,
            auto or isinstance(source, NoKeys), hits_per_pose, explaining, LEAST, started,
            None if limit_s is None else started + limit_s,
        ))  # fmt: skip


def _run(station: Station) -> SessionSummary:
    campaign, console = station.campaign, station.screen.console
    course = Course()
    try:
        for remark in campaign.cell.remarks:
            station.say(remark, "yellow")
        with station.screen.working("fitting the model to what was measured"):
            _ = campaign.model
        say_last_import(station)
        while not course.stop:
            course = _step(station, course)
        station.rerun_queue.show()
        if course.stop != "quit":
            with console.status("finding what the simulation lacks"):
                station.say_diagnosis(wait=True)
    except KeyboardInterrupt:
        course = replace(course, stop="quit", ended=interrupted(station))
    finally:
        with suppress(KeyboardInterrupt):
            station.rerun_queue.show()
    if course.ended:
        console.print(Text(course.ended))
    console.print(Text(f"Session ended: {course.stop}. Go on with the same command."))
    return SessionSummary(
        course.measured,
        course.stop,
        tuple(campaign.model.frequency_sd_percent.tolist()),
        time.monotonic() - station.started,
        {p: m.question.text for p, m in campaign.state.held.items() if m.question},
    )


def _step(station: Station, course: Course) -> Course:
    """One look at folder and keys; an interruption loses no more than this."""
    if course.visit is not None:
        return _at_pose(station, course, course.visit)
    if station.campaign.state.held and not station.auto:
        return _asked(station, course)
    return arrive(station, course)


def _asked(station: Station, course: Course) -> Course:
    """Wait for what the engineer says of held hits: where are they from?"""
    held = station.campaign.state.held
    pose = course.asking or next(iter(held))
    question = held[pose].question
    assert question is not None
    other = question.fits if question.fits in station.campaign.state.open else ""
    if not course.asking:
        station.screen.show(session_text.question_panel(question, pose, other))
        station.screen.bell(3)
        course = replace(course, asking=pose)
    try:
        course = answer(station, course, station.key(), other)
    except PlannerError as error:
        station.say(str(error), "red")
        return replace(course, asking="")
    return _unless_late(station, course) if course.asking else course


def _at_pose(station: Station, course: Course, visit: PoseInProgress) -> Course:
    """See what waits at a pose, and act on a key, until it is measured, skipped or superseded."""
    station.say_diagnosis()
    visit = _looked(station, course, visit)
    course = replace(course, visit=visit)
    waited = time.monotonic() - visit.since > 3 * station.inbox.quiet_s
    unready = visit.any_of("unstated", "late")
    ready = [path for path in visit.whole if path not in unready]
    hits = sum(verdict.path in ready for verdict in visit.verdicts)
    if station.auto and ready and (hits >= station.hits_at(visit.proposal) or waited):
        return import_waiting(station, course, visit, ready)
    course = on_key(station, course, visit, station.key())
    return _unless_late(station, course) if course.visit is not None else course


def _looked(station: Station, course: Course, visit: PoseInProgress) -> PoseInProgress:
    """The visit with what the folder holds now; what changed is drawn, and rung for."""
    for table in station.verdicts.table.follow():
        station.say(f"{table.parent.name}/{table.name} was read again and is right now.", "green")
    whole, waiting = station.inbox.scan(lambda path, digest: station.known(path, digest, course))
    waiting += station.verdicts.table.waiting
    for path in station.inbox.ignored():
        station.say(f"{path.name} is no recording; ignored.", "dim")
    numbers = station.verdicts.numbered(whole, visit.numbers)
    verdicts = _shown(station, visit, whole, course.here, numbers)
    now = (tuple(whole), tuple(waiting), tuple((v.kind, v.text) for v in verdicts))
    if now == visit.shown:
        return visit
    can = station.can_take_back
    page = page_with_hits(visit.page, verdicts, waiting, can, station.auto, course.progress)
    station.screen.ring({(str(v.path), v.number): v.kind for v in verdicts})
    station.screen.show(page.page)
    seen = replace(
        visit, page=page, whole=tuple(whole), verdicts=verdicts, shown=now, since=time.monotonic(),
        numbers=numbers, asked="",
    )  # fmt: skip
    for at, files in seen.late_by_pose.items() if station.auto else ():
        names = ", ".join(short_name(path) for path in files)
        held = f"Held, not used: {names} of {at}; import --pose {at} takes them there."
        station.say(held, "yellow")
    return seen


def _shown(
    station: Station,
    visit: PoseInProgress,
    whole: Sequence[Path],
    here: frozenset[Path],
    numbers: Mapping[Part, int],
) -> tuple[HitVerdict, ...]:
    """Verdicts on what the folder holds, with the pose of each file in the log before they show.

    Of files that a table lists it says the pose.
    """
    pose, state = visit.proposal.pose, station.campaign.state
    digests = {path: station.inbox.digest(path) for path in whole}
    known = {path: digest for path, digest in digests.items() if digest in state.shown}
    shown = {path: state.came(digest, pose) for path, digest in known.items()}
    rows = ((path, station.verdicts.table.row(path)) for path in whole)
    shown |= {path: row.pose for path, row in rows if row is not None}
    verdicts = station.verdicts.of(whole, visit.before, here, numbers, shown, pose)
    new: dict[str, dict[str, None]] = {}
    for verdict in verdicts:
        if verdict.path not in shown and digests[verdict.path]:
            new.setdefault(verdict.came or pose, {})[digests[verdict.path]] = None
    for of, files in new.items():
        station.campaign.show(of, tuple(files), pose if of != pose else "")
    if new:
        station.rerun_queue.note()
    return verdicts


def _unless_late(station: Station, course: Course) -> Course:
    return replace(course, stop="time limit") if station.late and not course.stop else course
