"""What the engineer is asked of a pose's new hits before they are believed, one thing at a time."""

from collections.abc import Iterable
from pathlib import Path

from planner.campaign.chain_question import chain_question
from planner.campaign.events import Question
from planner.campaign.model import Model
from planner.campaign.question import question
from planner.campaign.state import CampaignState
from planner.dataset.measure import MeasuredPose
from planner.recording.records import Hit
from planner.recording.repeats import Doubt, doubts, other_size


def asked_of(
    model: Model,
    state: CampaignState,
    pose: str,
    joints_deg: tuple[float, ...],
    measured: MeasuredPose,
) -> Question | None:
    """Of the first pose's hits whether the chain can be so; of others, whether pose and chain can.

    `measured` is of the new hits alone; `model` and `state` are those before the import; None:
    nothing is asked.
    """
    known = state.measurements.get(pose)
    if known is not None and known.question is not None:  # answered
        return None
    if not model.labelled:
        return chain_question(model, pose, joints_deg, measured.frf)
    return question(model, state, pose, joints_deg, measured)


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
    camps: dict[tuple[Doubt | None, tuple[int, ...]], list[int]] = {}
    disagree: dict[str, None] = {}
    for i, doubt in enumerate(found):
        if doubt is None or max(named[j][0] for j in (i, *doubt.others)) < known:
            continue
        # Hits that disagree with the same ones are told together; those of other sizes are not.
        key = (doubt if doubt.size or doubt.along else None), doubt.others
        both = {names[i], *(names[j] for j in doubt.others)}
        if key not in camps and both <= disagree.keys():  # told from the other side
            continue
        disagree |= dict.fromkeys((names[i], *(names[j] for j in doubt.others)))
        camps.setdefault(key, []).append(i)
    told = []
    for (_, others), own in camps.items():
        doubt = found[own[0]]
        assert doubt is not None
        first, rest = (_listed(names[j] for j in one) for one in (own, others))
        told.append(_told(hits[own[0]], doubt, first, rest, found[others[0]] is not None))
    if not told:
        return None
    text = (
        f"At {pose} {'; '.join(told)}: hit along it once more, take this import back, and import "
        f"all of them together. Is each of them right as it is?"
    )
    return Question(text, disagree=tuple(disagree))


def _listed(names: Iterable[str]) -> str:
    return " and ".join(Path(name).name for name in names)


def _told(hit: Hit, doubt: Doubt, first: str, others: str, both_doubted: bool) -> str:
    if doubt.size:
        return f"{first}, along {hit.axis[-1]}, {other_size(doubt.size, others).rstrip('?')}"
    if doubt.along:
        return f"{first} is said to be {hit.axis}, but answers as {others} along {doubt.along} did"
    said = f"(likeness {doubt.likeness:.2f})"
    if both_doubted:
        verb = "disagree" if " and " in first else "disagrees"
        return (
            f"along {hit.axis[-1]}, {first} {verb} with {others} {said}, and nothing tells which "
            f"is right"
        )
    return (
        f"{first}, said to be {hit.axis}, disagrees with {others} {said} and answers as hits "
        f"along another axis do"
    )
