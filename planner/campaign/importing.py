"""Importing the hits of one pose: where they belong and what they give."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import replace as replaced
from pathlib import Path

from msgspec.structs import replace

from planner.campaign import store
from planner.campaign.arrivals import (
    Kept,
    record_of,
    still_refused,
    superseded,
    without,
)
from planner.campaign.cell import Cell
from planner.campaign.config import ModesTable
from planner.campaign.deliveries import Delivery
from planner.campaign.events import REFUSED, HitRecord, Question
from planner.campaign.hit_errors import HitErrorEstimate
from planner.campaign.kept_recordings import KeptRecordings
from planner.campaign.model import Model
from planner.campaign.state import CampaignState, Measurement
from planner.dataset.measure import MeasuredPose, measure
from planner.dataset.screened_files import Source
from planner.errors import InputError
from planner.recording.joints import JointUnits


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

    def hit_errors(self, model: Model | None = None) -> tuple[HitErrorEstimate, ...]:
        """Of each accepted hit, as far as they are known, by this import's model or a later one."""
        files = [hit.file for hit in self.accepted]
        poses = (model or self.model).hit_errors
        own = next((found.hits for found in poses if found.pose == self.pose), ())
        return tuple(hit for hit in own if hit.file in files)


def place(cell: Cell, state: CampaignState, delivery: Delivery) -> tuple[float, ...]:
    """Readback angles (°) of a delivery, checked against robot, proposal and earlier hits.

    Raises InputError where they are not known or contradict each other.
    """
    known = state.hit_at(delivery.pose)
    if delivery.joints_deg is None:
        stated = known or state.held.get(delivery.pose) or state.proposals.get(delivery.pose)
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
                f"away; if that was typed wrong, take its import back first (planner undo); else "
                f"give the new measurement another name."
            )
    return delivery.joints_deg


def refusals(
    directory: Path,
    paths: tuple[Path, ...],
    reasons: Mapping[Path, str],
    stated: Mapping[Path, Source],
) -> tuple[HitRecord, ...]:
    """The engineer's refusal of each of these files, which are kept like any other.

    `stated` is what a table said of some of them.
    """
    said = {path: f"{text} ({REFUSED})" for path, text in reasons.items() if text}
    found = []
    for path in paths:
        digest, suffix = store.store_recording(directory, path)
        source = replaced(stated.get(path, Source(path, "")), name=str(path))
        found.append(record_of(source, digest, suffix, said.get(path, REFUSED)))
    return tuple(found)


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


@dataclass(frozen=True, eq=False)
class JudgedFiles:
    """New files of a pose, judged; `still` are those refused as before, which nothing rests on.

    `old` are the earlier ones beside which they stand, without those `superseded` by good new ones.
    """

    fresh: tuple[Kept, ...]
    hits: tuple[HitRecord, ...]
    measured: MeasuredPose
    still: tuple[HitRecord, ...]
    old: tuple[Source, ...]
    superseded: dict[HitRecord, str]

    @classmethod
    def of(
        cls,
        pose: str,
        state: CampaignState,
        kept: KeptRecordings,
        fresh: tuple[Kept, ...],
        table: ModesTable,
    ) -> "JudgedFiles":
        """Verdicts on the new files, and the modes of all good hits of the pose, old and new."""
        known = state.hit_at(pose)
        before = known.accepted if known else ()
        newer, hits = [source for source, _, _ in fresh], ()
        while True:
            gone = superseded(before, newer)
            old = tuple(kept.source(hit) for hit in before if hit not in gone)
            hits, measured = measure_files(old, fresh, table)
            good = [s for (s, _, _), hit in zip(fresh, hits, strict=True) if hit.accepted]
            if superseded(before, good) == gone:
                break
            newer = [source for source in newer if source in good]
        still = still_refused(hits, pose, state)
        left = without(fresh, still)
        if still and left:
            return replaced(cls.of(pose, state, kept, left, table), still=still)
        return cls(left, hits if left else (), measured, still, old, gone)


def measure_files(
    old: tuple[Source, ...], fresh: tuple[Kept, ...], table: ModesTable
) -> tuple[tuple[HitRecord, ...], MeasuredPose]:
    """Verdicts on the new files, and the modes of all good hits of the pose, old and new."""
    new = tuple(source for source, _, _ in fresh)
    measured = measure((*old, *new), table.band_hz, window_rate_1_s=table.window_rate_1_s)
    verdicts = zip(measured.verdicts[len(old) :], fresh, strict=True)
    records = tuple(
        replace(
            record_of(source, digest, suffix, verdict.reason),
            hit=verdict.axis,
            accepted=verdict.accepted,
            simulated=verdict.simulated,
        )
        for verdict, (source, digest, suffix) in verdicts
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
