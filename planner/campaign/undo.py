"""Entries of the log in words; what `undo` takes back, and what `redo` lets hold again."""

from collections.abc import Sequence
from itertools import takewhile

from planner.campaign import events
from planner.campaign.events import Entry
from planner.campaign.state import fold, taken_back
from planner.words import counted, listed

ACTS = (
    events.Proposed, events.Imported, events.Confirmed, events.Refused, events.Withdrawn,
    events.Skipped, events.FilesPlaced, events.Starred,
)  # fmt: skip


def last_acts(entries: Sequence[Entry], decisions_only: bool = False) -> tuple[Entry, ...]:
    """What `undo` would take back: the last act; a proposal is one, too.

    With `decisions_only` the last decision, and the proposals that followed it: in a session they
    follow of themselves, also after an act that was interrupted.
    """
    undone = taken_back(entries)
    acts = [e for e in entries if isinstance(e.event, ACTS) and e.seq not in undone]
    if not decisions_only:
        return tuple(acts[-1:])
    proposals = [*takewhile(lambda e: isinstance(e.event, events.Proposed), reversed(acts))][::-1]
    if len(proposals) == len(acts):
        return ()
    decision = acts[-1 - len(proposals)]
    before = fold(entries[: decision.seq - 1])
    return (decision, *(() if before.unchanged_by(decision.event) else proposals))


def last_undone(entries: Sequence[Entry]) -> tuple[Entry | None, tuple[Entry, ...]]:
    """What `redo` would let hold again, and the proposals made since, which it takes back.

    That is the last `undo`, or the one before where that was done again; None where a decision was
    made since.
    """
    undone = taken_back(entries)
    since: list[Entry] = []
    for entry in reversed(entries):
        event = entry.event
        if entry.seq in undone or not isinstance(event, (*ACTS, events.Undone)):
            continue
        if isinstance(event, events.Proposed):
            since.append(entry)
        elif not isinstance(event, events.Undone):
            break
        elif not any(isinstance(entries[act - 1].event, events.Undone) for act in event.acts):
            return entry, tuple(since)
    return None, ()


def in_short(entry: Entry | None) -> str:
    """What an act was, and of which pose, where it is of one: "imported P004"; "" of none."""
    return f"{entry.event.kind} {getattr(entry.event, 'pose', '')}".strip() if entry else ""


def in_words(entry: Entry) -> str:
    """What an entry of the log says, in words."""
    event = entry.event
    if isinstance(event, events.Configured):
        return f"configured, with planner {event.planner}"
    if isinstance(event, events.Proposed):
        poses = ", ".join(p.pose for p in event.proposals)
        return f"proposed {poses} by {event.acquisition}"
    if isinstance(event, events.Imported):
        used = sum(hit.accepted for hit in event.hits)
        if event.unhit:
            return f"refused all of {counted(len(event.hits), 'hit')} at {event.pose}"
        hits = counted(len(event.hits), "hit")
        if event.question:
            return f"held {hits} at {event.pose} until a question is answered"
        return f"imported {used} of {hits} at {event.pose}"
    if isinstance(event, events.Refused):
        return f"refused {counted(len(event.hits), 'hit')} at {event.pose}"
    if isinstance(event, events.Undone):
        which = "entry" if len(event.acts) == 1 else "entries"
        return f"took back {which} {listed([str(act) for act in event.acts])}"
    if isinstance(event, events.FilesShown | events.FilesPlaced):
        if isinstance(event, events.FilesPlaced):
            return f"{counted(len(event.files), 'late file')} taken as {event.pose}'s"
        like = f", like those of {event.pose}" if event.at else ""
        return f"{counted(len(event.files), 'file')} shown at {event.at or event.pose}{like}"
    reason = getattr(event, "reason", "")
    return f"{event.kind} {event.pose}{f': {reason}' if reason else ''}"
