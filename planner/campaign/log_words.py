"""Entries of the log in words."""

import msgspec

from planner.campaign.events import (
    Configured,
    Entry,
    FilesPlaced,
    FilesShown,
    Imported,
    Proposed,
    Refused,
    Undone,
)
from planner.words import counted


def act(entry: Entry) -> str:
    """What an entry of the log says, in words."""
    event = entry.event
    if isinstance(event, Configured):
        return f"configured, with planner {event.planner}"
    if isinstance(event, Proposed):
        poses = ", ".join(p.pose for p in event.proposals)
        return f"proposed {poses} by {event.acquisition}"
    if isinstance(event, Imported):
        used = sum(hit.accepted for hit in event.hits)
        if event.unhit:
            return f"refused all of {counted(len(event.hits), 'hit')} at {event.pose}"
        hits = counted(len(event.hits), "hit")
        if event.question:
            return f"held {hits} at {event.pose} until a question is answered"
        return f"imported {used} of {hits} at {event.pose}"
    if isinstance(event, Refused):
        return f"refused {counted(len(event.hits), 'hit')} at {event.pose}"
    if isinstance(event, Undone):
        return f"took back entry {event.act}"
    if isinstance(event, FilesShown | FilesPlaced):
        if isinstance(event, FilesPlaced):
            return f"{counted(len(event.files), 'file')} said to be of {event.pose}"
        like = f", like those of {event.pose}" if event.at else ""
        return f"{counted(len(event.files), 'file')} shown at {event.at or event.pose}{like}"
    told = msgspec.to_builtins(event)
    reason = f": {told['reason']}" if told.get("reason") else ""
    return f"{told['kind']} {told['pose']}{reason}"
