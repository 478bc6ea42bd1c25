"""The page of a pose: what the campaign expects there, hits that wait, a reason that is typed."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from planner.campaign.campaign import Campaign
from planner.campaign.events import Proposal
from planner.campaign.taking_back import last_acts, last_undone
from planner.robot.place_names import axes_in_the_room
from planner.session import session_text
from planner.session.course import BAD, Course, PoseInProgress
from planner.session.hit_verdicts import HitVerdict
from planner.session.pose_screen import PosePage, keys_that_do
from planner.session.station import Station
from planner.words import counted, short_name

ESCAPE, ERASE = "\x1b", ("\x7f", "\b")
ASKED = (
    "What stands in the way? Type it, then Enter: poses around it are left out too.\n"
    "Enter alone skips this pose only, Escape goes back. "
)


def can_take_back(campaign: Campaign) -> tuple[bool, bool]:
    """Whether there is an act to take back, and one that was and can hold again."""
    entries = campaign.entries
    return bool(last_acts(entries, decisions_only=True)), bool(last_undone(entries)[0])


def page_without_hits(
    campaign: Campaign, proposal: Proposal, hits_per_pose: int, folder: Path, course: Course
) -> PosePage:
    """What the screen says of a pose before anything was hit there."""
    model, robot = campaign.model, campaign.cell.robot
    q = robot.joints.internal([proposal.joints_deg])
    expected = model.predict(q)
    return PosePage(
        proposal, len(model.labelled) + 1, robot.joints, robot.config.tcp_frame,
        max(1, hits_per_pose // len(proposal.hits)), (),
        tuple(expected.frequency_hz[0].tolist()), tuple(expected.frequency_sd_hz[0].tolist()),
        folder, progress=course.progress, room=axes_in_the_room(robot, q[0]),
    )  # fmt: skip


def page_with_hits(
    page: PosePage,
    verdicts: Sequence[HitVerdict],
    waiting: Sequence[tuple[Path, str]],
    can: tuple[bool, bool],
    auto: bool,
    course: Course,
) -> PosePage:
    """The page with the hits that wait, the files that are not whole yet, and keys that do."""
    names = [one.path.name for one in verdicts]
    hits = tuple(_judged(one, names) for one in verdicts)
    unfinished = tuple((short_name(path), _named(path, why)) for path, why in waiting)
    page = replace(
        page, hits=hits, unfinished=unfinished, progress=course.progress, streams=_streams(verdicts)
    )
    return replace(page, keys="" if auto else _keys(page, can))


def _judged(verdict: HitVerdict, names: Sequence[str]) -> HitVerdict:
    said = f"answers as {verdict.came} did" if verdict.alike else f"came at {verdict.came}"
    late = f"{said}: [b] it is from there, [h] from here"
    text = late if verdict.kind == "late" else verdict.text
    if verdict.kind == "elsewhere":
        text = f"of {verdict.came} by recordings.csv, goes there with [a]"
    if verdict.kind == "unsure":
        text = f"{text}, or [h]: it is right"
    for name in names:
        text = text.replace(name, short_name(name))
    return replace(verdict, text=text)


def _streams(verdicts: Sequence[HitVerdict]) -> tuple[str, ...]:
    """How many hits of records of several are good."""
    kinds: dict[Path, list[str]] = {}
    for verdict in verdicts:
        if verdict.at_s is not None:
            kinds.setdefault(verdict.path, []).append(verdict.kind)
    return tuple(
        f"{counted(len(own), 'hit')} in {short_name(path)}: {own.count('good')} good"
        for path, own in kinds.items()
    )


def _keys(page: PosePage, can: tuple[bool, bool]) -> str:
    kinds = {hit.kind for hit in page.hits}
    late = {hit.came for hit in page.hits if hit.kind == "late"}
    usable = bool(kinds & {"good", "elsewhere"})
    return keys_that_do([
        ("a", "accept" if page.complete else "accept as it is", usable),
        ("r", "refuse bad hits", bool(kinds & {*BAD})),
        ("R", "refuse all", bool(page.hits)),
        ("b", f"late ones to {' and '.join(sorted(late))}", "late" in kinds),
        ("h", _right_here(kinds), bool(kinds & {"late", "unsure"})),
        ("s", "mark for a second look", True), ("k", "skip this pose", True),
        ("u", "undo", can[0]), ("U", "redo", can[1]), ("q", "quit", True), ("?", "help", True),
    ])  # fmt: skip


def _right_here(kinds: set[str]) -> str:
    if "late" not in kinds:
        return "those asked about are right"
    asked = ", those asked about right" if "unsure" in kinds else ""
    return f"late ones are from here{asked}"


def _named(path: Path, why: str) -> str:
    """What is the matter with a file, by its name alone."""
    name = short_name(path)
    text = why.replace(str(path), name).replace(path.name, name)
    return text if name in text else f"{name} {text}"


def ask_why(station: Station, visit: PoseInProgress, typed: str = "") -> PoseInProgress:
    """The visit while a reason is typed, which the page shows in the place of the keys."""
    station.screen.show(replace(visit.page, keys=f"{ASKED}{typed}_").page)
    return replace(visit, typed=typed)


def on_reason_key(
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
        station.say(session_text.never_again(which))
        return replace(course, visit=None)
    typed = typed[:-1] if key in ERASE else typed + key * key.isprintable()
    return replace(course, visit=ask_why(station, visit, typed))
