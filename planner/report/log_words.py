"""Entries of the log in words."""

import msgspec

from planner.campaign.events import Configured, Entry, Imported, Proposed, Undone


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
        held = "; held: a question was asked" if event.question else ""
        return f"imported {used} of {len(event.hits)} hits at {event.pose}{held}"
    if isinstance(event, Undone):
        return f"took back entry {event.act}"
    told = msgspec.to_builtins(event)
    reason = f": {told['reason']}" if told.get("reason") else ""
    return f"{told['kind']} {told['pose']}{reason}"
