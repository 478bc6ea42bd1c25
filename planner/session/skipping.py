"""Skipping a pose: what stands in its way is asked for; keys typed meanwhile are no commands."""

from dataclasses import replace

from planner.session import session_text
from planner.session.course import Course, PoseInProgress
from planner.session.station import Station

ESCAPE, ERASE = "\x1b", ("\x7f", "\b")
ASKED = (
    "What stands in the way? Type it, then Enter: poses around it are left out too.\n"
    "Enter alone skips this pose only, Escape goes back. "
)


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
