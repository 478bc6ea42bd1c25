"""Which files of a delivery are new, which are in use, and why others are not imported.

"Known before" is only what is in use, or held. What was refused is judged again each time: its
row, its place or its neighbours may have changed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace as replaced
from pathlib import Path

from msgspec.structs import replace

from planner.campaign import store
from planner.campaign.deliveries import Delivery
from planner.campaign.events import REFUSED, HitRecord, Imported
from planner.campaign.state import CampaignState
from planner.dataset.screened_files import Source
from planner.errors import InputError
from planner.recording.joints import JointUnits
from planner.words import command

REPLACED = "replaced by a newer"
Kept = tuple[Source, str, str]  # a file with its sha256 and suffix


@dataclass(frozen=True)
class KeptFiles:
    """Files of one delivery: new ones, names of those imported before, and those left out."""

    fresh: tuple[Kept, ...]
    already: tuple[str, ...]
    left_out: tuple[HitRecord, ...]


def record_of(source: Source, digest: str, suffix: str, reason: str) -> HitRecord:
    """What the log keeps of a file, and of what is said of it; for a `reason` it is refused."""
    return HitRecord(
        source.name, digest, suffix, source.hit, source.repeat, not reason, reason,
        hit_point=source.stated.hit_point, response_points=source.stated.response_points,
        part=source.part, response=source.response, from_name=source.from_name,
    )  # fmt: skip


def at_their_poses(deliveries: tuple[Delivery, ...], state: CampaignState) -> tuple[Delivery, ...]:
    """Files of which nobody says the pose go where they were imported before, if they were.

    Raises InputError where it is not clear at which pose the others were recorded.
    """
    owner = _owners(state)
    found: list[Delivery] = []
    for delivery in deliveries:
        if delivery.said:
            found.append(delivery)
            continue
        poses: dict[str, list[Source]] = {}
        for source in delivery.sources:
            poses.setdefault(owner.get(_digest(source), delivery.pose), []).append(source)
        if "" in poses:
            raise InputError(
                f"{poses[''][0].path}: it is not clear at which pose it was recorded; say "
                f"--pose ID."
            )
        found += [replaced(delivery, pose=p, sources=tuple(s)) for p, s in poses.items()]
    return tuple(found)


def keep_files(
    directory: Path, delivery: Delivery, state: CampaignState, named: frozenset[Path]
) -> KeptFiles:
    """Keep the raw files; those in use at this pose are only named.

    A file that the engineer refused, or that was shown at another pose, is new only where it is
    itself among the `named` paths or its table says so; one that cannot be read is left out, as is
    a recording that is in use at another pose. Raises InputError where all are.
    """
    owner = _owners(state)
    known = state.measurements.get(delivery.pose)
    withdrawn = ""
    if known is not None and known.withdrawn:
        again = command("planner", "confirm", directory, known.pose)
        withdrawn = f"{known.pose} was withdrawn; to use its hits again: {again}; else give the "
        withdrawn += "new measurement another pose name, in recordings.csv or by --pose"
    fresh: list[Kept] = []
    already, left_out, elsewhere = [], [], []
    seen: set[str] = set()
    for source in delivery.sources:
        try:
            digest = store.recording_hash(source.path)
        except InputError as error:  # one bad file does not keep the others out
            left_out.append(record_of(source, "", "", str(error)))
            continue
        if owner.get(digest, delivery.pose) != delivery.pose:
            reason = (
                f"it was imported before as a recording of pose {owner[digest]} and cannot belong "
                f"to {delivery.pose} too; delete it, or put the right file there"
            )
            if len(delivery.sources) == 1 + len(elsewhere):
                raise InputError(f"{source.path}: {reason}.")
            elsewhere.append(record_of(source, digest, "", reason))
            continue
        named_itself = source.path in named
        reason = withdrawn or _reason_against(delivery, source, digest, named_itself, state)
        if reason:
            left_out.append(record_of(source, digest, "", reason))
        elif digest in owner or (digest in seen and not source.part):
            already.append(source.name)
        else:
            seen.add(digest)
            digest, suffix = store.store_recording(directory, source.path)
            kept = replaced(source, path=store.recording_path(directory, digest, suffix))
            fresh += [(part, digest, suffix) for part in kept.parts()]
    return KeptFiles(tuple(fresh), tuple(already), (*left_out, *elsewhere))


def superseded(before: Sequence[HitRecord], sources: Sequence[Source]) -> dict[HitRecord, str]:
    """Which hits of a pose newer files take the place of, and why.

    Those written over, and those of the same name for the same axis and repeat of a table.
    """
    found = {}
    for hit in before:
        name = hit.file.rpartition(" (hit ")[0] if hit.part else hit.file
        for source in sources:
            same = Path(source.whole_name).name == Path(name).name
            if source.hit is None or source.repeat is None:
                same = source.whole_name == name
            elif (source.hit, source.repeat) != (hit.hit, hit.repeat):
                same = False
            if same:
                found[hit] = f"{REPLACED} {Path(name).name}"
                break
    return found


def stated_otherwise(source: Source, record: HitRecord) -> bool:
    """Whether a table says something else of a file now than when it was judged."""
    points = source.stated.hit_point, source.stated.response_points, source.response
    known = record.hit_point, record.response_points, record.response
    return points != known or (source.hit is not None and source.hit != (record.hit or ""))


def let_go(delivery: Delivery, held: Imported, joints: JointUnits) -> tuple[HitRecord, ...] | None:
    """Files of a held import that a delivery brings anew, to be judged again; None: it does not.

    It does where a table says something else of one of them, or of the pose's joints, where one has
    other content now, or where all are said to be of another pose. Those given are the held hits
    that the delivery lacks.
    """
    brought = {_digest(source): source for source in delivery.sources}
    lacking = [hit for hit in held.hits if hit.sha256 not in brought]
    if delivery.pose != held.pose:
        return () if delivery.said and not lacking else None
    both = ((brought[hit.sha256], hit) for hit in held.hits if hit.sha256 in brought)
    gone = superseded(lacking, delivery.sources)
    stood = delivery.joints_deg
    moved = stood is not None and joints.apart(held.joints_deg, stood)
    anew = gone or moved or any(stated_otherwise(*one) for one in both)
    return tuple(hit for hit in lacking if hit not in gone) if anew else None


def still_refused(
    hits: tuple[HitRecord, ...], pose: str, state: CampaignState
) -> tuple[HitRecord, ...]:
    """Of hits judged again those that are refused as they were before."""
    measurement = state.measurements.get(pose)
    before = {_hit_of(h): h for h in (measurement.hits if measurement else ()) if not h.accepted}
    return tuple(
        hit for hit in hits
        if (known := before.get(_hit_of(hit))) and replace(hit, file="") == replace(known, file="")
    )  # fmt: skip


def without(fresh: tuple[Kept, ...], hits: tuple[HitRecord, ...]) -> tuple[Kept, ...]:
    """New files without those of these hits."""
    out = {_hit_of(hit) for hit in hits}
    return tuple(one for one in fresh if (one[1], one[0].part) not in out)


def _hit_of(hit: HitRecord) -> tuple[str, int]:
    return hit.sha256, hit.part


def _owners(state: CampaignState) -> dict[str, str]:
    """Poses of all that is in use, or is held, by sha256."""
    held = {h.sha256: pose for pose, m in state.held.items() for h in m.hits}
    used = (m for m in state.measurements.values() if not m.withdrawn)
    return held | {h.sha256: m.pose for m in used for h in m.accepted}


def _digest(source: Source) -> str:
    """Content hash; "" where the file cannot be read."""
    try:
        return store.recording_hash(source.path)
    except InputError:
        return ""


def _reason_against(
    delivery: Delivery, source: Source, digest: str, named: bool, state: CampaignState
) -> str:
    """Why a file is not imported; empty: it is, or it is in use."""
    pose, known = delivery.pose, state.measurements.get(delivery.pose)
    held = state.held.get(pose)
    before = [h for h in (known.hits if known else ()) if h.sha256 == digest]
    if any(hit.accepted for hit in before):
        return ""
    if not named and (gone := [hit.reason for hit in before if hit.reason.startswith(REPLACED)]):
        return f"{gone[0]}; to use it again, name the file itself"
    if held is not None:
        if any(hit.sha256 == digest for hit in held.hits):
            return ""
        return f"hits of {pose} wait for an answer: {held.question.text if held.question else ''}"
    certain = bool(delivery.row) or (delivery.said and named)
    shown = state.came(digest, pose)
    if shown != pose and not certain:
        return (
            f"it came at {shown}, and nobody said that it is of {pose}; to import it there, name "
            f"the file itself and --pose {pose}"
        )
    if digest in state.refused:
        at, record = state.refused[digest]
        elsewhere = delivery.said and at != pose
        # Where the record has no axis, not even "", nobody kept what was said of the file then.
        otherwise = record.hit is not None and stated_otherwise(source, record)
        if not (named or elsewhere or otherwise):
            return f"{REFUSED} before; to import it all the same, name the file itself"
    return "" if delivery.said else _refused_elsewhere(pose, digest, state)


def _refused_elsewhere(pose: str, digest: str, state: CampaignState) -> str:
    """What is said of a file that was refused at another pose, where nobody says its pose."""
    for measurement in state.measurements.values():
        for hit in measurement.hits if measurement.pose != pose else ():
            if hit.sha256 == digest and not hit.accepted:
                return (
                    f"refused at {measurement.pose} before: {hit.reason.rstrip('.')}; to have it "
                    f"judged at {pose}, say --pose {pose}"
                )
    return ""
