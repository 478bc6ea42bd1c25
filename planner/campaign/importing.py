"""Importing the hits of one pose: where they belong and what they give."""

import itertools
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace as replaced
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from planner.campaign import events, import_checks, imported_files
from planner.campaign.cell import Cell
from planner.campaign.events import REFUSED, HitRecord, Question
from planner.campaign.hit_errors import HitErrorEstimate
from planner.campaign.import_checks import Claim, contradiction, question_about
from planner.campaign.imported_files import ImportedFiles, KnownFile, record_of, superseded
from planner.campaign.labels import from_modal
from planner.campaign.model import Model
from planner.campaign.state import CampaignState, Measurement, without_entries
from planner.campaign.store import KeptRecordings
from planner.dataset.measure import MeasuredPose, measure
from planner.dataset.screened_files import FileVerdict, Source, hits_of_files
from planner.errors import InputError
from planner.progress import ProgressCallback

if TYPE_CHECKING:
    from planner.campaign.campaign import Campaign


@dataclass(frozen=True, eq=False)
class ImportReport:
    """What one import did to one pose: files, modes, and the model before and after.

    With a `question` the measurement is held, and its hits are not among the accepted ones.
    """

    pose: str
    measurement: Measurement | None
    model_before: Model
    model: Model
    hits: tuple[HitRecord, ...] = ()  # new ones
    question: Question | None = None
    already: tuple[KnownFile, ...] = ()  # files that were imported before
    left_out: tuple[HitRecord, ...] = ()  # not imported: the engineer refused them, or must answer
    measured: MeasuredPose | None = None
    remarks: tuple[str, ...] = ()
    alerts: tuple[str, ...] = ()  # of the remarks, those to be acted upon while the robot stands
    refit_seconds: float = 0.0

    @property
    def accepted(self) -> tuple[HitRecord, ...]:
        """New hits that the model uses."""
        return () if self.question else tuple(hit for hit in self.hits if hit.accepted)

    @property
    def refused(self) -> tuple[HitRecord, ...]:
        """Those that it does not: refused ones, or all while the question is open."""
        asked = self.question
        if asked is None:
            return tuple(hit for hit in self.hits if not hit.accepted)
        return tuple(replace(h, accepted=False, reason=h.reason or asked.text) for h in self.hits)

    def hit_errors(self, model: Model | None = None) -> tuple[HitErrorEstimate, ...]:
        """Of each accepted hit, as far as they are known, by this import's model or a later one."""
        files = [hit.file for hit in self.accepted]
        own = (model or self.model).hit_errors.get(self.pose, ())
        return tuple(hit for hit in own if hit.file in files)


def readback_of(cell: Cell, state: CampaignState, delivery: ImportedFiles) -> tuple[float, ...]:
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


@dataclass(frozen=True, eq=False)
class JudgedFiles:
    """New files of a delivery, judged, and the modes of all good hits of the pose, old and new.

    `old` are the earlier ones beside which they stand, without those `superseded` by good new ones.
    """

    hits: tuple[HitRecord, ...]
    sources: tuple[Source, ...]
    measured: MeasuredPose
    old: tuple[Source, ...]
    superseded: tuple[HitRecord, ...]


def judged_files(
    kept: KeptRecordings, state: CampaignState, pose: str, fresh: tuple[Source, ...]
) -> tuple[JudgedFiles | None, tuple[HitRecord, ...]]:
    """New files of a pose, judged, if any are left, and those refused as they were before.

    Nothing rests on these.
    """
    known, used = state.measurements.get(pose), state.hit_at(pose)
    accepted, left_out = used.accepted if used else (), ()
    before = {replace(h, file="") for h in (known.hits if known else ()) if not h.accepted}
    while fresh:
        newer: Sequence[Source] = fresh
        while True:
            gone = superseded(accepted, newer)
            old = tuple(kept.source(hit) for hit in accepted if hit not in gone)
            measured = _measured((*old, *fresh), kept.cell)
            hits = tuple(map(_record, measured.verdicts[len(old) :]))
            good = [s for s, hit in zip(fresh, hits, strict=True) if hit.accepted]
            if superseded(accepted, good) == gone:
                break
            newer = [source for source in newer if source in good]
        still = [replace(hit, file="") in before for hit in hits]
        if not any(still):
            return JudgedFiles(hits, fresh, measured, old, gone), left_out
        left_out += tuple(itertools.compress(hits, still))
        fresh = tuple(one for one, out in zip(fresh, still, strict=True) if not out)
    return None, left_out


def _measured(sources: tuple[Source, ...], cell: Cell) -> MeasuredPose:
    table = cell.config.modes
    return measure(sources, table.band_hz, window_rate_1_s=table.window_rate_1_s)


def _record(verdict: FileVerdict) -> HitRecord:
    """What the log keeps of a kept file once it is judged."""
    record, simulated = record_of(verdict.source, verdict.reason), verdict.simulated
    return replace(record, hit=verdict.axis, accepted=verdict.accepted, simulated=simulated)


def remarks_on(
    claim: Claim, judged: JudgedFiles, measurement: Measurement, told: tuple[str, ...]
) -> tuple[str, ...]:
    """What is to be known of an import, with what was `told` of its hits; `measurement` came."""
    state = claim.state
    return (
        *hits_of_files(judged.measured.verdicts[len(judged.old) :]),
        *judged.measured.remarks,
        *told,
        *(f"{hit.file} is set aside, {hit.replaced}." for hit in judged.superseded),
        *(
            f"{hit.file} was {REFUSED} at {state.refused[hit.sha256][0]} before; it is imported "
            f"now because it was named."
            for hit in judged.hits
            if hit.sha256 in state.refused
        ),
        *filter(None, (claim.displacement,)),
        *axes_not_hit(state, measurement),
    )


def axes_not_hit(state: CampaignState, measurement: Measurement) -> tuple[str, ...]:
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
            f"{measurement.pose} has no accepted hit along {' and '.join(missing)}, so that what "
            f"moves that way alone is missing: hit along it too, at the same pose."
        )
    if once := [axis for axis in wanted if counts[axis] == 1]:
        said.append(
            f"{measurement.pose} has only one accepted hit along {' and '.join(once)}, and no "
            f"repeat confirms it: hit along it again."
        )
    return tuple(said)


def import_paths(
    campaign: "Campaign", given: tuple[Path, ...], pose: str | None, progress: ProgressCallback,
    from_names: bool,
) -> tuple[ImportReport, ...]:  # fmt: skip
    """Import within an act of the campaign, see `Campaign.import_paths`."""
    cell, state = campaign.cell, campaign.state
    # A folder that has the name of an open proposal is of that pose.
    open_ = [p for p in state.open if len(given) == 1 and given[0].is_dir() and given[0].name == p]
    default = (open_ or state.open)[0] if len(open_ or state.open) == 1 else None
    deliveries = imported_files.sort_paths(given, cell.robot, pose, default)
    deliveries = imported_files.at_their_poses(deliveries, state)
    placed = [(d, readback_of(cell, state, d)) for d in deliveries]
    named = frozenset(path for path in given if path.is_file())
    reports = []
    for number, (delivery, joints_deg) in enumerate(placed):
        progress(delivery.pose, number / len(placed))
        sources = tuple(replaced(s, from_name=from_names) for s in delivery.sources)
        delivery = replaced(delivery, sources=sources)
        reports.append(import_pose(campaign, delivery, joints_deg, named))
    return tuple(reports)


def _held_before(
    campaign: "Campaign", delivery: ImportedFiles
) -> tuple[tuple[int, ...], ImportedFiles]:
    """Held imports of which a delivery says something else now: all is judged anew.

    Their numbers, and the delivery with the held files of its pose that it lacks.
    """
    instead = []
    for held_at in campaign.state.held:
        entry, event = campaign.held_import(held_at)
        lacks = imported_files.replaced_hits(delivery, event, campaign.cell.robot.joints)
        if lacks is not None:
            instead.append(entry.seq)
            more = tuple(map(campaign.recordings.source, lacks))
            delivery = replaced(delivery, sources=(*delivery.sources, *more))
    return tuple(instead), delivery


def import_pose(
    campaign: "Campaign", delivery: ImportedFiles, joints_deg: tuple[float, ...],
    named: frozenset[Path],
) -> ImportReport:  # fmt: skip
    """Judge the files of one pose, ask what is to be asked, write the import and fit again."""
    started, pose = time.perf_counter(), delivery.pose
    instead, delivery = _held_before(campaign, delivery)
    before, state = campaign.model, without_entries(campaign.entries, instead)
    known = state.hit_at(pose)
    fresh, already, left_out = imported_files.new_files(campaign.directory, delivery, state, named)
    judged, refused_again = judged_files(campaign.recordings, state, pose, fresh)
    left_out += refused_again
    if judged is None:
        held = campaign.state.held.get(pose)
        return ImportReport(
            pose, held or state.measurements.get(pose), before, before, (),
            held.question if held else None, already, left_out,
        )  # fmt: skip
    claim = Claim(before, state, pose, known.joints_deg if known else joints_deg)
    event, told = _event(claim, judged)
    campaign.append(replace(event, instead=instead))
    measurement = (campaign.state.held if event.question else campaign.state.measurements)[pose]
    model = campaign.model
    stood = replaced(claim, joints_deg=joints_deg)
    remarks = remarks_on(stood, judged, measurement, told)
    if not event.question and any(hit.accepted for hit in judged.hits):
        remarks += (*import_checks.unexpected_modes(before, model, pose), *model.remarks)
    return ImportReport(
        pose, measurement, before, model, judged.hits, event.question, already, left_out,
        judged.measured, remarks, alerts=told, refit_seconds=time.perf_counter() - started,
    )  # fmt: skip


def _event(claim: Claim, judged: JudgedFiles) -> tuple[events.Imported, tuple[str, ...]]:
    """What the log gains by new files, and remarks to be acted upon while the robot stands."""
    measured = alone = judged.measured
    # Among earlier hits, wrong ones would not stand out; one that was replaced is no new visit.
    if judged.old and not judged.superseded:
        alone = _measured(judged.sources, claim.model.cell)
    new_modes = from_modal(alone.modal)
    asked = contradiction(claim.pose, measured, len(judged.old)) or question_about(claim, alone)
    again, drift = "", ""
    if asked is None:
        again, drift = import_checks.suspected_drift(claim, new_modes)
    event = events.Imported(
        pose=claim.pose,
        joints_deg=claim.joints_deg,
        hits=judged.hits,
        modes=from_modal(measured.modal),
        remarks=measured.remarks,
        amplitude=measured.homogeneity,
        question=asked,
        again=again,
        replaced=tuple(hit.sha256 for hit in judged.superseded),
    )
    return event, import_checks.alerts(claim, event, measured, new_modes, drift)
