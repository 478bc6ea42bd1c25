"""What the engineer's keys do. Each act changes the campaign and gives the session's next value."""

import time
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

from rich.text import Text

from planner.campaign.events import REFUSED, Confirmed, Imported
from planner.campaign.importing import ImportReport
from planner.campaign.state import fold
from planner.campaign.undo import in_words, last_acts
from planner.dataset.screened_files import Source
from planner.errors import NoPoseLeftError, PlannerError
from planner.report.campaign_changes import taken_back
from planner.session import session_text
from planner.session.diagnosis_process import LEAST
from planner.session.pose_screen import page_with_hits, page_without_hits
from planner.session.session_state import BAD, PoseInProgress, Session, SessionState
from planner.words import by_reason, counted, short_name

IMPORTING = "importing and refitting; keys act after it"
ESCAPE, ERASE = "\x1b", ("\x7f", "\b")
ASKED = (
    "Is something in the way? Name it, then Enter: poses near this one are skipped too.\n"
    "Enter alone skips this pose only, Escape goes back. "
)


def arrive(session: Session, state: SessionState) -> SessionState:
    """Propose a pose and show its page; pictures of what went before are made then."""
    campaign = session.campaign
    try:
        with session.screen.working("choosing the next pose"):
            proposal = campaign.next()[0]
    except NoPoseLeftError as error:
        session.say(str(error))
        return replace(state, stop="no pose left")
    session.rerun_queue.note()
    if state.left:  # what lies there before the robot can have moved
        campaign.show(state.left, session.inbox.present())
    hits = session.hits_at(proposal)
    page = page_without_hits(campaign, proposal, hits, session.inbox.folder)
    page = page_with_hits(page, (), (), session.can_take_back, session.auto, state.progress)
    session.screen.show(page.page)
    session.rerun_queue.show()
    before = session.pose_before(proposal.pose)
    visit = PoseInProgress(proposal, page, time.monotonic(), before)
    return replace(state, visit=visit, left=proposal.pose)


def say_last_import(session: Session) -> None:
    """What the last act gave, if it was an import: an interruption may have hidden it."""
    campaign = session.campaign
    acts = last_acts(campaign.entries, decisions_only=True)
    event = acts[0].event if acts else None
    if isinstance(event, Imported) and event.pose in campaign.state.measurements:
        before = campaign.kept_model(fold(campaign.entries[: acts[0].seq - 1]))
        told = session_text.against_expected(event.pose, campaign.model, before)
        session.say(f"The last import, {event.pose}: {told}", "bold")


def on_key(
    session: Session, state: SessionState, visit: PoseInProgress, key: str | None
) -> SessionState:
    """Act on a key at a pose; without a visit the pose is over."""
    on = _act if visit.typed is None else _on_reason_key
    try:
        return on(session, state, visit, key)
    except PlannerError as error:
        session.say(str(error), "red")
        return state


def _act(
    session: Session, state: SessionState, visit: PoseInProgress, key: str | None
) -> SessionState:
    campaign, pose = session.campaign, visit.proposal.pose
    if key is None:
        return state
    again, visit = key == visit.asked, replace(visit, asked="")
    asked, state = replace(state, visit=replace(visit, asked=key)), replace(state, visit=visit)
    over = replace(state, visit=None)
    match key:
        case "a":
            if visit.any_of("good") and not visit.page.complete and not again:
                session.say(session_text.incomplete(visit.page), "yellow")
                return asked
            out = visit.any_of("late", "unsure", "unstated")
            files = [path for path in visit.whole if path not in out]
            return import_waiting(session, state, visit, files)
        case "b" if visit.any_of("late"):
            return _to_their_poses(session, state, visit)
        case "h" if visit.any_of("late", "unsure"):
            return _right_here(session, state, visit)
        case "r" if visit.whole:
            bad = visit.paths("repeat") or visit.paths(*BAD)
            if not bad and not again:
                session.say(session_text.NONE_BAD, "yellow")
                return asked
            _refuse(session, visit, bad or visit.whole)
        case "R" if visit.whole:
            _refuse(session, visit, visit.whole)
        case "s":
            campaign.star(pose)
            session.say(f"★ {pose}")
        case "k":
            return replace(state, visit=_ask_why(session, visit))
        case "u":
            return undo(session, over)
        case "U":
            return _redo(session, over)
        case "q":
            return replace(state, stop="quit")
        case "?":
            session.say(session_text.HELP)
        case _:
            session.say(session_text.not_now(key), "dim")
    return state


def _ask_why(session: Session, visit: PoseInProgress, typed: str = "") -> PoseInProgress:
    """The visit while a reason is typed, which the page shows in the place of the keys."""
    session.screen.show(replace(visit.page, keys=f"{ASKED}{typed}_").page)
    return replace(visit, typed=typed)


def _on_reason_key(
    session: Session, state: SessionState, visit: PoseInProgress, key: str | None
) -> SessionState:
    """One more key of the reason; the pose is over with Enter."""
    typed, pose = visit.typed or "", visit.proposal.pose
    if key is None:
        return state
    if key == ESCAPE:
        session.screen.show(visit.page.page)
        return replace(state, visit=replace(visit, typed=None))
    if key in ("\r", "\n"):
        reason = typed.strip()
        session.campaign.skip(pose, reason or "skipped in the session", neighbours=bool(reason))
        which = f"{pose} and poses around it" if reason else pose
        session.say(f"{which} will not be offered again ([u] takes that back).")
        return replace(state, visit=None)
    typed = typed[:-1] if key in ERASE else typed + key * key.isprintable()
    return replace(state, visit=_ask_why(session, visit, typed))


def _refuse(session: Session, visit: PoseInProgress, files: Collection[Path]) -> None:
    """Set files aside with what is wrong with them, and say which hits they are."""
    chosen = tuple(path for path in visit.whole if path in files)
    if not chosen:
        return
    stated = {}  # what is said of a file now, by its table or itself
    for path in chosen:
        row = session.verdicts.table.row(path)
        axes = {verdict.axis for verdict in visit.verdicts if verdict.path == path}
        said = Source(path, str(path)) if row is None else Source.of(row)
        stated[path] = replace(said, hit=axes.pop() if len(axes) == 1 else None)
    session.campaign.refuse(visit.proposal.pose, chosen, visit.reasons(chosen), stated)
    session.rerun_queue.note()
    numbers = [str(v.number) for v in visit.verdicts if v.path in chosen]
    said = f"{counted(len(numbers), 'hit')} refused ({', '.join(numbers)})"
    session.say(f"{said}; hit again ([u] takes that back).")


def import_waiting(
    session: Session, state: SessionState, visit: PoseInProgress, files: Sequence[Path]
) -> SessionState:
    """Import the waiting hits; the pose is over when it gave modes."""
    weak = frozenset(verdict.path for verdict in visit.verdicts if verdict.weak)
    files = [path for path in files if path not in weak]
    if not files:
        waiting = len(visit.any_of("late", "unsure"))
        asked = f"{counted(waiting, 'hit')} wait for your answer: [b] or [h]."
        session.say(asked if waiting else session_text.NOTHING_NEW, "yellow")
        return state
    # What the import would take as good, or ask for at every pose from here on.
    _refuse(session, visit, weak | (frozenset() if session.auto else visit.any_of("unsure")))
    try:
        with session.screen.working(IMPORTING):
            reports = _imported_files(session, files, visit.proposal.pose)
    except PlannerError as error:
        session.say(str(error), "red")
        bad = {session.mark(path) for path in files} if session.auto else set()
        return replace(state, aside=state.aside | bad)
    session.rerun_queue.note(reports)
    for report in reports:
        if report.question is not None and report.question.disagree and state.here:
            said = f"The hits of {report.pose} are used, as you said."
            return replace(_used(session, state, report.pose, said), visit=None, here=frozenset())
        left = {hit: session.mark(Path(hit.file), hit.sha256) for hit in report.left_out}
        new = [hit for hit, mark in left.items() if mark not in state.aside]
        told = ((short_name(h.file), h.reason) for h in new if not h.reason.startswith(REFUSED))
        for one in by_reason(told):
            session.say(f"Left out: {one.rstrip('.')}.", "yellow")
        state = replace(state, aside=state.aside | set(left.values()))
        state = _after(session, state, report)
    if not any(report.measurement and report.measurement.modes for report in reports):
        session.rerun_queue.show()
        return state
    return replace(state, visit=None, here=frozenset())


def _imported_files(session: Session, files: Sequence[Path], pose: str) -> tuple[ImportReport, ...]:
    """Import files at the poses that recordings.csv states; those it does not list at `pose`."""
    listing = {path: session.verdicts.table.listed(path)[0] for path in files}
    bare = tuple(path for path in files if listing[path] is None)
    tables = tuple(dict.fromkeys(folder for folder in listing.values() if folder is not None))
    reports = session.campaign.import_paths(tables) if tables else ()
    return (*reports, *(session.campaign.import_paths(bare, pose) if bare else ()))


def _used(session: Session, state: SessionState, pose: str, said: str) -> SessionState:
    """The engineer says, or said before, that held hits are right."""
    with session.screen.working("refitting"):
        session.campaign.confirm(pose)
        session.rerun_queue.note()
    session.say(said)
    return measured(session, state, pose)


def undo(session: Session, state: SessionState) -> SessionState:
    """Take back the last act of the engineer."""
    taken = session.campaign.undo(decisions_only=True)
    session.rerun_queue.note()
    session.screen.forget()
    session.say(str(taken_back(taken, "undone").said))
    return state.undone(session.campaign.state)


def _redo(session: Session, state: SessionState) -> SessionState:
    """Let hold again what was taken back last."""
    again = session.campaign.redo()
    session.rerun_queue.note()
    session.screen.forget()
    session.say(str(taken_back(again, "redone").said))
    event = again[0].event
    if isinstance(event, Imported | Confirmed):
        return measured(session, state, event.pose)
    return state


def answer(session: Session, state: SessionState, key: str | None, other: str) -> SessionState:
    """Act on a key while a question is open; `other` is the open pose the hits may be from.

    Once it is answered, `asking` is empty.
    """
    campaign, pose = session.campaign, state.asking
    answered = replace(state, asking="")
    if key == "a":
        answered = _used(session, answered, pose, f"The hits of {pose} are used.")
    elif key == "r":
        campaign.refuse_held(pose)
        session.rerun_queue.note()
        session.say(
            f"The hits of {pose} are refused: mend the cause, then hit or export again ([u] takes "
            f"that back)."
        )
    elif key == "o" and other:
        with session.screen.working(IMPORTING):
            report = campaign.move(pose, other)
        session.rerun_queue.note([report])
        answered = _after(session, answered, report)
    elif key == "u":
        answered = undo(session, answered)
    elif key == "q":
        return replace(state, stop="quit")
    else:
        session.say(session_text.not_now(key), "dim") if key else None
        return state
    session.rerun_queue.show()
    return answered


def measured(session: Session, state: SessionState, pose: str) -> SessionState:
    """Say how far the campaign is after one more pose."""
    logged, model = session.campaign.state, session.campaign.model
    seconds = time.monotonic() - session.started
    further = state.after(pose, model, logged, seconds, session.auto)
    if not session.screen.console.is_terminal:  # there it stands on the page
        session.say(further.progress.split("; ", 1)[1])
    if session.explaining is not None and len(logged.used) >= LEAST:
        session.explaining.ask()
    if further.announced and not state.announced:
        session.say("The target of campaign.toml is reached: [q] ends.", "bold green")
    return further


def _to_their_poses(session: Session, state: SessionState, visit: PoseInProgress) -> SessionState:
    """Import hits that came late to the poses that they are of."""
    for pose, late in visit.late_by_pose.items():
        with session.screen.working(IMPORTING):
            reports = session.campaign.import_paths(late, pose)
        session.rerun_queue.note(reports)
        names = ", ".join(path.name for path in late)
        session.say(f"{counted(len(late), 'file')} moved to {pose}: {names}.")
        for report in reports:
            session.say(session_text.result_line(report), "bold")
    return state


def _right_here(session: Session, state: SessionState, visit: PoseInProgress) -> SessionState:
    """The engineer says that late hits are of this pose, and unsure ones right."""
    if late := visit.any_of("late"):
        files = [session.inbox.digest(path) for path in sorted(late)]
        session.campaign.place(visit.proposal.pose, files)
        session.rerun_queue.note()
    return replace(state, here=state.here | visit.any_of("unsure"))


def interrupted(session: Session) -> str:
    """Which acts of the engineer an interruption left in the log, in a sentence."""
    said = [in_words(entry) for entry in session.rerun_queue.gained()]
    if not said:
        return "Stopped: nothing that was begun is in the log; hits that were not imported wait."
    there = ", ".join(dict.fromkeys(said))
    return f"Stopped: {there}: that is in the log; planner undo takes the last act back."


def _after(session: Session, state: SessionState, report: ImportReport) -> SessionState:
    if report.question is not None:
        # Without anybody to ask, say so; else the question comes next.
        if session.auto and report.measured is not None:
            session.say(f"Held back, not used: {report.question.text}", "red")
        return state
    if not report.accepted and not report.refused:
        return state
    simulated = bool(report.measurement and report.measurement.simulated)
    notes = [Text(alert, style="yellow") for alert in report.alerts]
    notes += [Text(session_text.refusals(report), style="red")] if report.refused else []
    notes += [Text(session_text.result_line(report), style="bold")]
    session.screen.leave(session_text.import_panel(report, simulated), notes)
    return measured(session, state, report.pose)
