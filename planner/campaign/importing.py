"""Importing the hits of one pose: where they belong, which are new, what they give."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import replace as replaced
from pathlib import Path

from msgspec.structs import replace

from planner.campaign import store
from planner.campaign.cell import Cell
from planner.campaign.config import ModesTable
from planner.campaign.deliveries import Delivery
from planner.campaign.events import REFUSED, HitRecord, Question
from planner.campaign.hit_habits import HitMiss, misses_of
from planner.campaign.model import Model
from planner.campaign.state import CampaignState, Measurement
from planner.dataset.measure import MeasuredPose, measure
from planner.dataset.screened_files import Source
from planner.errors import InputError
from planner.recording.joints import JointUnits

Kept = tuple[Source, str, str]  # a file with its sha256 and suffix


@dataclass(frozen=True)
class KeptFiles:
    """Files of one delivery: new ones, names of those imported before, and those left out."""

    fresh: tuple[Kept, ...]
    already: tuple[str, ...]
    left_out: tuple[HitRecord, ...]


@dataclass(frozen=True, eq=False)
class ImportReport:
    """What one import did to one pose: files, modes, and the model before and after.

    With a `question` the measurement is held, and its hits are not among the accepted ones.
    """

    pose: str
    accepted: tuple[HitRecord, ...]
    refused: tuple[HitRecord, ...]
    already: tuple[str, ...]  # files that were imported before
    measurement: Measurement | None
    measured: MeasuredPose | None
    model_before: Model
    model: Model
    refit_seconds: float
    remarks: tuple[str, ...] = ()
    left_out: tuple[HitRecord, ...] = ()  # not imported: the engineer refused them, or must answer
    question: Question | None = None
    alerts: tuple[str, ...] = ()  # of the remarks, those to be acted upon while the robot stands

    def misses(self, model: Model | None = None) -> tuple[HitMiss, ...]:
        """How each accepted hit missed, by this import's model or a later one."""
        files = [hit.file for hit in self.accepted]
        return misses_of((model or self.model).misses, self.pose, files)


def place(cell: Cell, state: CampaignState, delivery: Delivery) -> tuple[float, ...]:
    """Readback angles (°) of a delivery, checked against robot, proposal and earlier hits.

    Raises InputError where they are not known or contradict each other.
    """
    known = state.hit_at(delivery.pose) or state.held.get(delivery.pose)
    if delivery.joints_deg is None:
        stated = known or state.proposals.get(delivery.pose)
        if stated is None:
            raise InputError(
                f"No joint angles are known for pose {delivery.pose}; give recordings.csv columns "
                f"of the joints, or name a proposed pose."
            )
        return stated.joints_deg
    cell.check_pose(delivery.joints_deg, delivery.row)
    if known is not None:
        off = cell.robot.joints.apart(known.joints_deg, delivery.joints_deg)
        if off:
            raise InputError(
                f"{delivery.row}: pose {delivery.pose} was imported before with a joint {off} "
                f"away; give the new measurement another name."
            )
    return delivery.joints_deg


def keep_files(
    directory: Path, delivery: Delivery, state: CampaignState, named: frozenset[Path]
) -> KeptFiles:
    """Keep the raw files; those imported before at this pose are only named.

    A file that the engineer refused is new only where it is itself among the `named` paths; one
    that cannot be read is left out.
    Raises InputError for a recording that belongs to another pose already.
    """
    owner = {h.sha256: m.pose for m in state.recorded for h in m.hits}
    fresh: list[Kept] = []
    already, left_out = [], []
    seen: set[str] = set()
    for source in delivery.sources:
        try:
            digest = store.sha256(store.read_recording(source.path))
        except InputError as error:  # one bad file does not keep the others out
            left_out.append(_left(source, "", str(error)))
            continue
        if owner.get(digest, delivery.pose) != delivery.pose:
            raise InputError(
                f"{source.path} was imported before as a recording of pose {owner[digest]}; "
                f"it cannot belong to {delivery.pose} too."
            )
        if digest in owner or (digest in seen and not source.part):
            already.append(source.name)
        elif reason := _reason_against(delivery.pose, digest, source.path in named, state):
            left_out.append(_left(source, digest, reason))
        else:
            seen.add(digest)
            digest, suffix = store.store_recording(directory, source.path)
            kept = replaced(source, path=store.recording_path(directory, digest, suffix))
            fresh += [(part, digest, suffix) for part in kept.parts()]
    return KeptFiles(tuple(fresh), tuple(already), tuple(left_out))


def _left(source: Source, digest: str, reason: str) -> HitRecord:
    return HitRecord(source.name, digest, "", source.hit, source.repeat, False, reason)


def _reason_against(pose: str, digest: str, named: bool, state: CampaignState) -> str:
    """Why a new file is not imported; empty: it is."""
    if pose in state.held:
        return f"hits of {pose} wait for an answer: {_asked_of(state.held[pose])}"
    if digest in state.refused and not named:
        return f"{REFUSED} before; to import it all the same, name the file itself"
    return ""


def _asked_of(held: Measurement) -> str:
    return held.question.text if held.question else ""


def refusals(
    directory: Path, paths: tuple[Path, ...], reasons: Mapping[Path, str]
) -> tuple[HitRecord, ...]:
    """The engineer's refusal of each of these files, which are kept like any other."""
    said = {path: f"{text} ({REFUSED})" for path, text in reasons.items() if text}
    kept = [(path, *store.store_recording(directory, path)) for path in paths]
    return tuple(
        HitRecord(str(path), digest, suffix, accepted=False, reason=said.get(path, REFUSED))
        for path, digest, suffix in kept
    )


def not_used(hits: tuple[HitRecord, ...], asked: Question | None) -> tuple[HitRecord, ...]:
    """Those of new hits that the model does not use: refused ones, or all while it is `asked`."""
    if asked is None:
        return tuple(hit for hit in hits if not hit.accepted)
    return tuple(replace(h, accepted=False, reason=h.reason or asked.text) for h in hits)


def taken_after_all(state: CampaignState, fresh: tuple[Kept, ...]) -> tuple[str, ...]:
    """A remark on each file that the engineer had refused and then named."""
    return tuple(
        f"{source.name} was {REFUSED} at {state.refused[digest][0]} before; it is imported now "
        f"because it was named."
        for source, digest, _ in fresh
        if digest in state.refused
    )


def measure_files(
    old: tuple[Source, ...], fresh: tuple[Kept, ...], table: ModesTable
) -> tuple[tuple[HitRecord, ...], MeasuredPose]:
    """Verdicts on the new files, and the modes of all good hits of the pose, old and new."""
    new = tuple(source for source, _, _ in fresh)
    measured = measure((*old, *new), table.band_hz, window_rate_1_s=table.window_rate_1_s)
    records = tuple(
        HitRecord(
            file=source.name,
            sha256=digest,
            suffix=suffix,
            hit=verdict.axis,
            repeat=source.repeat,
            accepted=verdict.accepted,
            reason=verdict.reason,
            simulated=verdict.simulated,
            hit_point=source.stated.hit_point,
            response_points=source.stated.response_points,
            part=source.part,
            response=source.response,
            from_name=source.from_name,
        )
        for verdict, (source, digest, suffix) in zip(
            measured.verdicts[len(old) :], fresh, strict=True
        )
    )
    return records, measured


def displacement(
    joints: JointUnits, state: CampaignState, delivery: Delivery, joints_deg: tuple[float, ...]
) -> tuple[str, ...]:
    """A remark if the robot stood elsewhere than proposed."""
    proposal = state.proposals.get(delivery.pose)
    if proposal is None:
        return ()
    off = joints.apart(proposal.joints_deg, joints_deg)
    if not off:
        return ()
    return (
        f"The readback of {delivery.pose} is up to {off} from its setpoint; the readback is used.",
    )


def lacking(state: CampaignState, measurement: Measurement) -> tuple[str, ...]:
    """Remarks on axes that were not hit, or once only, of those that the pose is to be hit along.

    Files of FRFs say nothing of single hits and are not remarked upon.
    """
    counts = Counter(hit.hit[-1] for hit in measurement.accepted if hit.hit)
    if not counts:
        return ()
    proposal = state.proposals.get(measurement.pose)
    wanted = proposal.hits if proposal else ("x", "y", "z")
    said = []
    if missing := [axis for axis in wanted if not counts[axis]]:
        said.append(
            f"{measurement.pose} was not hit along {' and '.join(missing)}: what moves that way "
            f"only is missing; hit along it too, at the same pose."
        )
    if once := [axis for axis in wanted if counts[axis] == 1]:
        said.append(
            f"{measurement.pose} has one hit only along {' and '.join(once)}, which no repeat "
            f"confirms; hit again."
        )
    return tuple(said)
