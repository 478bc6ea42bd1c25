"""What the engineer's keys do. Each act changes the campaign and gives the session's next value."""

import time
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

from rich.text import Text

from planner.campaign.events import REFUSED, Confirmed, Imported
from planner.campaign.importing import ImportReport
from planner.campaign.state import fold
from planner.campaign.taking_back import act, last_acts
from planner.dataset.screened_files import Source
from planner.errors import NoPoseLeftError, PlannerError
from planner.report.campaign_acts import redone, undone
from planner.session import session_text
from planner.session.pose_screen import page_with_hits, page_without_hits
from planner.session.station import BAD, Course, PoseInProgress, Station
from planner.words import by_reason, counted, short_name

ENTER = ("a", "\n", "\r")
IMPORTING = "importing and refitting"
ESCAPE, ERASE = "\x1b", ("\x7f", "\b")
ASKED = (
    "What stands in the way? Type it, then Enter: poses around it are left out too.\n"
    "Enter alone skips this pose only, Escape goes back. "
)


def arrive(station: Station, course: Course) -> Course:
    """Propose a pose and show its page; pictures of what went before are made then."""
    campaign = station.campaign
    try:
        with station.screen.working("choosing the next pose"):
            proposal = campaign.next()[0]
    except NoPoseLeftError as error:
        station.say(str(error))
        return replace(course, stop="no pose left")
    station.rerun_queue.note()
    if course.left:  # what lies there before the robot can have moved
        campaign.show(course.left, station.inbox.present())
    page = page_without_hits(
        campaign, proposal, station.hits_at(proposal), station.inbox.folder, course.progress
    )
    page = page_with_hits(page, (), (), station.can_take_back, station.auto, course.progress)
    station.screen.show(page.page)
    station.rerun_queue.show()
    before = station.pose_before(proposal.pose)
    visit = PoseInProgress(proposal, page, time.monotonic(), before)
    return replace(course, visit=visit, left=proposal.pose)


def say_last_import(station: Station) -> None:
    """What the last act gave, if it was an import: an interruption may have hidden it."""
    campaign = station.campaign
    acts = last_acts(campaign.entries, decisions_only=True)
    event = acts[0].event if acts else None
    if isinstance(event, Imported) and event.pose in campaign.state.measurements:
        before = campaign.kept_model(fold(campaign.entries[: acts[0].seq - 1]))
        told = session_text.against_expected(event.pose, campaign.model, before)
        station.say(f"The last import, {event.pose}: {told}", "bold")


def on_key(station: Station, course: Course, visit: PoseInProgress, key: str | None) -> Course:
    """Act on a key at a pose; without a visit the pose is over."""
    on = _act if visit.typed is None else _on_reason_key
    try:
        return on(station, course, visit, key)
    except PlannerError as error:
        station.say(str(error), "red")
        return course


def _act(station: Station, course: Course, visit: PoseInProgress, key: str | None) -> Course:
    campaign, pose = station.campaign, visit.proposal.pose
    if key is None:
        return course
    again, visit = key == visit.asked, replace(visit, asked="")
    asked, course = replace(course, visit=replace(visit, asked=key)), replace(course, visit=visit)
    over = replace(course, visit=None)
    match key:
        case "a" | "\n" | "\r":
            if visit.any_of("good") and not visit.page.complete and not again:
                station.say(session_text.incomplete(visit.page), "yellow")
                return asked
            out = visit.any_of("late", "unsure", "unstated")
            files = [path for path in visit.whole if path not in out]
            return import_waiting(station, course, visit, files)
        case "b" if visit.any_of("late"):
            return _to_their_poses(station, course, visit)
        case "h" if visit.any_of("late", "unsure"):
            return _right_here(station, course, visit)
        case "r" if visit.whole:
            bad = visit.paths("repeat") or visit.paths(*BAD)
            if not bad and not again:
                station.say(session_text.NONE_BAD, "yellow")
                return asked
            _refuse(station, visit, bad or visit.whole)
        case "R" if visit.whole:
            _refuse(station, visit, visit.whole)
        case "s":
            campaign.star(pose)
            station.say(f"★ {pose}")
        case "k":
            return replace(course, visit=_ask_why(station, visit))
        case "u":
            return undo(station, over)
        case "U":
            return _redo(station, over)
        case "q":
            return replace(course, stop="quit")
        case "?":
            station.say(session_text.HELP)
        case _:
            station.say(session_text.not_now(key), "dim")
    return course


def _ask_why(station: Station, visit: PoseInProgress, typed: str = "") -> PoseInProgress:
    """The visit while a reason is typed, which the page shows in the place of the keys."""
    station.screen.show(replace(visit.page, keys=f"{ASKED}{typed}_").page)
    return replace(visit, typed=typed)


def _on_reason_key(
    station: Station, course: Course, visit: PoseInProgress, key: str | None
) -> Course:
    """One more key of the reason; the pose is over with Enter."""
    typed, pose = visit.typed or "", visit.proposal.pose
    if key is None:
        return course
    if key == ESCAPE:
        station.screen.show(visit.page.page)
        return replace(course, visit=replace(visit, typed=None))
    if key in ("\r", "\n"):
        reason = typed.strip()
        station.campaign.skip(pose, reason or "skipped in the session", neighbours=bool(reason))
        which = f"{pose} and poses around it" if reason else pose
        station.say(f"{which} will not be offered again ([u] takes that back).")
        return replace(course, visit=None)
    typed = typed[:-1] if key in ERASE else typed + key * key.isprintable()
    return replace(course, visit=_ask_why(station, visit, typed))


def _refuse(station: Station, visit: PoseInProgress, files: Collection[Path]) -> None:
    """Set files aside with what is wrong with them, and say which hits they are."""
    chosen = tuple(path for path in visit.whole if path in files)
    if not chosen:
        return
    stated = {path: _as_stated(station, visit, path) for path in chosen}
    station.campaign.refuse(visit.proposal.pose, chosen, visit.reasons(chosen), stated)
    station.rerun_queue.note()
    numbers = [str(v.number) for v in visit.verdicts if v.path in chosen]
    said = f"{counted(len(numbers), 'hit')} set aside ({', '.join(numbers)})"
    station.say(f"{said}; hit again ([u] takes that back).")


def _as_stated(station: Station, visit: PoseInProgress, path: Path) -> Source:
    """What is said of a file now, by its table or itself; "" where nothing says an axis."""
    row = station.verdicts.table.row(path)
    axes = {verdict.axis for verdict in visit.verdicts if verdict.path == path}
    said = Source(path, str(path)) if row is None else Source.of(row)
    return replace(said, hit=axes.pop() if len(axes) == 1 else None)


def import_waiting(
    station: Station, course: Course, visit: PoseInProgress, files: Sequence[Path]
) -> Course:
    """Import the waiting hits; the pose is over when it gave modes."""
    weak = frozenset(verdict.path for verdict in visit.verdicts if verdict.weak)
    files = [path for path in files if path not in weak]
    if not files:
        waiting = len(visit.any_of("late", "unsure"))
        asked = f"{counted(waiting, 'hit')} wait for your answer: [b] or [h]."
        station.say(asked if waiting else session_text.NOTHING_NEW, "yellow")
        return course
    # What the import would take as good, or ask for at every pose from here on.
    _refuse(station, visit, weak | (frozenset() if station.auto else visit.any_of("unsure")))
    try:
        with station.screen.working(IMPORTING):
            reports = _imported_files(station, files, visit.proposal.pose)
    except PlannerError as error:
        station.say(str(error), "red")
        bad = {station.mark(path) for path in files} if station.auto else set()
        return replace(course, aside=course.aside | bad)
    station.rerun_queue.note(reports)
    for report in reports:
        if report.question is not None and report.question.disagree and course.here:
            return _right(station, course, report)
        left = {hit: station.mark(Path(hit.file), hit.sha256) for hit in report.left_out}
        new = [hit for hit, mark in left.items() if mark not in course.aside]
        told = ((short_name(h.file), h.reason) for h in new if not h.reason.startswith(REFUSED))
        for one in by_reason(told):
            station.say(f"Left out: {one.rstrip('.')}.", "yellow")
        course = replace(course, aside=course.aside | set(left.values()))
        course = _imported(station, course, report)
    if not any(report.measurement and report.measurement.modes for report in reports):
        station.rerun_queue.show()
        return course
    return replace(course, visit=None, here=frozenset())


def _imported_files(station: Station, files: Sequence[Path], pose: str) -> tuple[ImportReport, ...]:
    """Import files at the poses that recordings.csv states; those it does not list at `pose`."""
    listing = {path: station.verdicts.table.listing(path) for path in files}
    bare = tuple(path for path in files if listing[path] is None)
    tables = tuple(dict.fromkeys(folder for folder in listing.values() if folder is not None))
    reports = station.campaign.import_paths(tables) if tables else ()
    return (*reports, *(station.campaign.import_paths(bare, pose) if bare else ()))


def _right(station: Station, course: Course, report: ImportReport) -> Course:
    """The engineer said before that hits which contradict others are right."""
    with station.screen.working("refitting"):
        station.campaign.confirm(report.pose)
    station.rerun_queue.note()
    station.say(f"The hits of {report.pose} are used, as you said.")
    return replace(measured(station, course, report.pose), visit=None, here=frozenset())


def undo(station: Station, course: Course) -> Course:
    """Take back the last act of the engineer."""
    taken = station.campaign.undo(decisions_only=True)
    station.rerun_queue.note()
    station.screen.forget()
    station.say(undone(taken).text())
    return course.undone(station.campaign.state)


def _redo(station: Station, course: Course) -> Course:
    """Let hold again what was taken back last."""
    again = station.campaign.redo()
    station.rerun_queue.note()
    station.screen.forget()
    station.say(redone(again).text())
    event = again[0].event
    if isinstance(event, Imported | Confirmed):
        return measured(station, course, event.pose)
    return course


def answer(station: Station, course: Course, key: str | None, other: str) -> Course:
    """Act on a key while a question is open; `other` is the open pose the hits may be from.

    Once it is answered, `asking` is empty.
    """
    campaign, pose = station.campaign, course.asking
    answered = replace(course, asking="")
    if key in ENTER:
        with station.screen.working("refitting"):
            campaign.confirm(pose)
            station.rerun_queue.note()
        station.say(f"The hits of {pose} are used.")
        answered = measured(station, answered, pose)
    elif key == "r":
        campaign.refuse_held(pose)
        station.rerun_queue.note()
        station.say(f"The hits of {pose} are set aside; hit again ([u] takes that back).")
    elif key == "o" and other:
        with station.screen.working(IMPORTING):
            report = campaign.move(pose, other)
        station.rerun_queue.note([report])
        answered = _after(station, answered, report)
    elif key == "u":
        answered = undo(station, answered)
    elif key == "q":
        return replace(course, stop="quit")
    else:
        station.say(session_text.not_now(key), "dim") if key else None
        return course
    station.rerun_queue.show()
    return answered


def measured(station: Station, course: Course, pose: str) -> Course:
    """Say how far the campaign is after one more pose."""
    state, model = station.campaign.state, station.campaign.model
    seconds = time.monotonic() - station.started
    further = course.after(pose, model, state, seconds, station.auto)
    if not station.screen.console.is_terminal:  # there it stands on the page
        station.say(further.progress.split("; ", 1)[1])
    if station.explaining is not None and len(state.used) >= station.explain_from:
        station.explaining.ask()
    if further.announced and not course.announced:
        station.say("The target of campaign.toml is reached.", "bold green")
    return further


def _to_their_poses(station: Station, course: Course, visit: PoseInProgress) -> Course:
    """Import hits that came late to the poses that they are of."""
    for pose, late in visit.late_by_pose.items():
        with station.screen.working(IMPORTING):
            reports = station.campaign.import_paths(late, pose)
        station.rerun_queue.note(reports)
        names = ", ".join(path.name for path in late)
        station.say(f"{counted(len(late), 'file')} moved to {pose}: {names}.")
        for report in reports:
            station.say(session_text.result_line(report), "bold")
    return course


def _right_here(station: Station, course: Course, visit: PoseInProgress) -> Course:
    """The engineer says that late hits are of this pose, and unsure ones right."""
    if late := visit.any_of("late"):
        files = [station.inbox.digest(path) for path in sorted(late)]
        station.campaign.place(visit.proposal.pose, files)
        station.rerun_queue.note()
    return replace(course, here=course.here | visit.any_of("unsure"))


def interrupted(station: Station) -> str:
    """Which acts of the engineer an interruption left in the log, in a sentence."""
    said = [act(entry) for entry in station.rerun_queue.gained()]
    if not said:
        return "Stopped: nothing that was begun is in the log; hits that were not imported wait."
    there = ", ".join(dict.fromkeys(said))
    return f"Stopped: {there}: that is in the log; planner undo takes the last act back."


def _imported(station: Station, course: Course, report: ImportReport) -> Course:
    if report.question is not None:
        # Without anybody to ask, say so; else the question comes next.
        if station.auto and report.measured is not None:
            station.say(f"Held back, not used: {report.question.text}", "red")
        return course
    return _after(station, course, report) if report.accepted or report.refused else course


def _after(station: Station, course: Course, report: ImportReport) -> Course:
    if report.question is not None:  # at the pose it was moved to it does not fit either
        return course
    simulated = bool(report.measurement and report.measurement.simulated)
    notes = [Text(alert, style="yellow") for alert in report.alerts]
    notes += [Text(session_text.refusals(report), style="red")] if report.refused else []
    notes += [Text(session_text.result_line(report), style="bold")]
    station.screen.leave(session_text.import_panel(report, simulated), notes)
    return measured(station, course, report.pose)
