"""Hits of a pose that contradict each other, where nothing tells which of them is right."""

from planner.campaign.events import Question
from planner.dataset.measure import MeasuredPose
from planner.recording.records import Hit
from planner.recording.repeat_sizes import other_size
from planner.recording.repeats import Doubt, doubts


def contradiction(pose: str, measured: MeasuredPose, known: int) -> Question | None:
    """What to ask of hits that contradict each other; None: nothing.

    The first `known` files of the pose were imported, and asked about, before.
    """
    files = measured.files
    named = [
        (number, source.name, hit)
        for number, (source, own) in enumerate(zip(measured.sources, files.hits, strict=True))
        for hit in own
        if any(hit is kept for kept in files.agreeing)
    ]
    names, hits = [name for _, name, _ in named], tuple(hit for *_, hit in named)
    found = doubts(hits, measured.band_hz) if len(hits) > 1 else ()
    told, disagree = [], dict[str, None]()
    for i, doubt in enumerate(found):
        if doubt is None or max(named[j][0] for j in (i, *doubt.others)) < known:
            continue
        both = (names[i], *(names[j] for j in doubt.others))
        if set(both) <= disagree.keys():  # told from the other side
            continue
        disagree |= dict.fromkeys(both)
        told.append(_told(hits[i], doubt, both, both_doubted=found[doubt.others[0]] is not None))
    if not told:
        return None
    text = (
        f"At {pose} {'; '.join(told)}: hit along it once more, take this import back, and import "
        f"all of them together. Is each of them right as it is?"
    )
    return Question(text, disagree=tuple(disagree))


def _told(hit: Hit, doubt: Doubt, names: tuple[str, ...], both_doubted: bool) -> str:
    first, others = names[0], " and ".join(names[1:])
    if doubt.size:
        return f"{first}, along {hit.axis[-1]}, {other_size(doubt.size, others).rstrip('?')}"
    if doubt.along:
        return f"{first} is said to be {hit.axis}, but answers as {others} along {doubt.along} did"
    said = f"(likeness {doubt.likeness:.2f})"
    if both_doubted:
        return (
            f"{first} and {others} are {'both' if len(names) == 2 else 'all'} said to be along "
            f"{hit.axis[-1]} but disagree {said}, "
            f"and nothing tells which is right"
        )
    return (
        f"{first}, said to be {hit.axis}, disagrees with {others} {said} and answers as hits "
        f"along another axis do"
    )
