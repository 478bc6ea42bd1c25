"""Answer of `status`: what was measured, what is open, how sure the model is."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.campaign.events import Proposal
from planner.campaign.model_status import DecisionStatus, LeftOutValues, found_without, left_out
from planner.campaign.state import Measurement
from planner.design.stopping import Forecast
from planner.report.answer import NOT_IN_JSON, Answer
from planner.report.imports import asked_of
from planner.report.proposals import forecast_json, standing, unanswered
from planner.report.saved_diagnosis import diagnosis_of, read_diagnosis, two_answers
from planner.report.springs import COLUMNS, NOT_KNOWN, RefittedSpring, refitted_springs
from planner.report.text import ending, sds_over_workspace, table
from planner.words import by_reason, counted, local_time, significant

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from planner.campaign.model import Model
    from planner.campaign.model_comparison import LeftOutModel
    from planner.campaign.state import CampaignState
    from planner.progress import ProgressCallback


@dataclass(frozen=True)
class MeasuredPoseStatus:
    """A measured pose: how many hits are in use and refused, frequencies of its modes."""

    pose: str
    joints_deg: tuple[float, ...]
    hits: int
    refused: int
    frequency_hz: tuple[float, ...]
    withdrawn: bool
    starred: bool
    simulated: bool
    time: str
    remarks: tuple[str, ...]
    # Of held hits, until it is answered.
    question: dict[str, Any] | msgspec.UnsetType = msgspec.UNSET

    @classmethod
    def of(cls, m: Measurement, starred: bool, held: bool = False) -> "MeasuredPoseStatus":
        """Of a measurement."""
        found = tuple(mode.frequency_hz for mode in m.modes if mode.likely)
        asked = asked_of(m.pose, m.question) if held else None
        return cls(
            m.pose, m.joints_deg, len(m.accepted), len(m.refused), found, m.withdrawn, starred,
            m.simulated, m.time, m.remarks, asked or msgspec.UNSET,
        )  # fmt: skip

    @property
    def cells(self) -> tuple[str, ...]:
        """A row of the table."""
        mark = (" ★" if self.starred else "") + (" withdrawn" if self.withdrawn else "")
        found = "  ".join(f"{f:.2f}" for f in self.frequency_hz) or "none"
        return self.pose + mark, str(self.hits), str(self.refused), found, local_time(self.time)


@dataclass(frozen=True)
class SkippedProposal:
    """A proposed pose that shall not be measured."""

    pose: str
    reason: str


@dataclass(frozen=True)
class RefusedHit:
    """A recording of a measured pose that is not used, and why."""

    pose: str
    file: str
    reason: str


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelStatus:
    """What `status` says of the model; sds (count,) in % are over the workspace, mode by mode."""

    robot: str
    joint_names: tuple[str, ...]
    frequency_sd_percent: np.ndarray
    target_frequency_sd_percent: float
    done: bool
    forecast: Forecast
    remarks: tuple[str, ...]
    leave_one_out: LeftOutValues
    decision: DecisionStatus | None = None  # where the campaign is for a cut
    joint_units: tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET
    springs: tuple[RefittedSpring, ...] = ()  # none where the simulation does not learn
    waits_for: str = ""  # what lacks until the target is reached
    frf_sd_percent: tuple[float, ...] = ()  # of predicted FRFs, and of their common scale
    not_predicted: str = ""  # modes that every pose shows beside those predicted

    @classmethod
    def of(cls, model: "Model") -> "ModelStatus":
        """Of a campaign's model."""
        cell = model.cell
        return cls(
            robot=cell.robot.name,
            joint_names=tuple(cell.robot.joint_names),
            frequency_sd_percent=model.frequency_sd_percent,
            target_frequency_sd_percent=cell.config.stop.frequency_sd_percent,
            done=bool(model.done),
            forecast=model.forecast,
            remarks=model.remarks,
            leave_one_out=left_out(model),
            decision=DecisionStatus.of(model),
            joint_units=cell.robot.joints.declared,
            springs=refitted_springs(model),
            waits_for=model.waits_for,
            frf_sd_percent=model.frf_sd_percent,
            not_predicted=model.not_predicted,
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class StatusReport(ModelStatus, Answer):
    """Answer of `status`; `used` of the measured poses are those that the model rests on."""

    campaign: str
    simulated: bool
    measurements: tuple[MeasuredPoseStatus, ...]
    open: tuple[Proposal, ...]
    skipped: tuple[SkippedProposal, ...]
    refused: tuple[RefusedHit, ...]
    log: Mapping[str, int]  # entries; torn_bytes of a last line that a crash has torn
    stored_but_not_imported: tuple[str, ...]
    held: tuple[MeasuredPoseStatus, ...]  # not used until a question is answered
    used: int
    plots: tuple[str, ...] = ()
    rrd: str | None = None
    models: tuple["LeftOutModel", ...] | msgspec.UnsetType = msgspec.UNSET  # where asked for
    model: "Callable[[], Model]" = field(repr=False, metadata=NOT_IN_JSON)

    def to_json(self) -> dict[str, Any]:
        """With the forecast's sentence; "decision" where there is one."""
        said = super().to_json() | {"forecast": forecast_json(self.forecast)}
        return said if self.decision else {k: v for k, v in said.items() if k != "decision"}

    def drawings(self) -> "dict[str, Figure]":
        """Each pose as predicted without it."""
        if not self.leave_one_out.values:
            return {}
        from planner.report.campaign_plots import left_out_figure

        title = "Each measured pose, predicted without it"
        return {"leave_one_out": left_out_figure(*found_without(self.model()), title)}

    def with_models(self, progress: "ProgressCallback") -> "StatusReport":
        """The same once every model of `[surrogate]` has predicted poses left out."""
        from planner.campaign.model_comparison import compared_models

        return replace(self, models=compared_models(self.model(), progress=progress))

    def text(self) -> Group:
        """Measured poses as a table, then all else line by line."""
        measured = table(
            f"{self.campaign}: {self._counts()}",
            *("pose", "hits", "refused", "frequencies (Hz)", "time"),
            rows=(pose.cells for pose in self.measurements),
        )
        parts: list[RenderableType] = [measured]
        if self.springs:
            title = "Stiffnesses of the simulation, refitted to all recordings"
            each = (spring.cells for spring in self.springs)
            parts += [table(title, *COLUMNS, rows=each), Text(f"  {NOT_KNOWN}")]
        parts += [] if self.models is msgspec.UNSET else models_text(self.models)
        return Group(*parts, Text("\n".join(self._lines())), *ending(vars(self)))

    def _counts(self) -> str:
        """How many poses the model uses, as report and predict count them, and others."""
        away = sum(pose.withdrawn for pose in self.measurements)
        without = len(self.measurements) - self.used - away
        more = f", {away} withdrawn" if away else ""
        more += f", {without} without modes" if without else ""
        return f"{counted(self.used, 'pose')} measured{more}"

    def _lines(self) -> list[str]:
        held = ", ".join(h.pose for h in self.held)
        waiting = f"; hit, and waiting for your answer: {held}" if held else ""
        lines = [
            "open: " + (", ".join(p.pose for p in self.open) or "none") + waiting,
            "skipped: " + (", ".join(s.pose for s in self.skipped) or "none"),
            sds_over_workspace(self.frequency_sd_percent, self.target_frequency_sd_percent),
            standing(self.forecast, self.waits_for, self.not_predicted),
            f"log: {counted(self.log['entries'], 'entry', 'entries')}",
        ]
        if self.frf_sd_percent:
            whole, scale = map(significant, self.frf_sd_percent)
            lines.insert(3, f"sd of FRFs over the workspace: {whole} %, of which {scale} % is a "
                            f"scale common to all (gains and masses)")  # fmt: skip
        if self.log["torn_bytes"]:
            lines.append("The log's last line was torn by a crash; the next act sets it aside.")
        if self.stored_but_not_imported:
            lines.append(
                f"{counted(len(self.stored_but_not_imported), 'recording')} stored, but the "
                f"program stopped before the import: import again."
            )
        lines += [unanswered(h.question["text"]) for h in self.held if isinstance(h.question, dict)]
        lines += [self.decision.text] if self.decision else []
        lines += [*self.remarks, *self.leave_one_out.text]
        told = by_reason((r.file, r.reason) for r in self.refused)
        return lines + [f"refused {one}" for one in told]


def _still_refused(state: "CampaignState") -> tuple[RefusedHit, ...]:
    """Refused hits of which no corrected file was accepted since."""
    told = [(m.pose, hit) for m in state.recorded for hit in m.refused]
    known = {m.pose: m for m in state.recorded}
    told += [
        (pose, hit)
        for pose, hit in state.refused.values()
        if pose not in known or not known[pose].replaced(hit)
    ]
    return tuple(RefusedHit(pose, hit.file, hit.reason) for pose, hit in told)


def status(campaign: Campaign, diagnosis: Path | None = None) -> StatusReport:
    """Of a campaign as it is now, beside a kept `diagnosis` (by default its own)."""
    state = campaign.state
    believed = campaign.of_model("status", ModelStatus, ModelStatus.of)
    kept = diagnosis or diagnosis_of(campaign.directory)
    beside = two_answers(believed.springs, read_diagnosis(kept)) if kept else ""
    remarks = (*believed.remarks, *filter(None, (beside,)))
    return StatusReport(
        **(vars(believed) | {"remarks": remarks}),
        campaign=str(campaign.directory),
        simulated=state.simulated,
        measurements=tuple(
            MeasuredPoseStatus.of(m, m.pose in state.starred) for m in state.measured
        ),
        open=tuple(state.proposals[pose] for pose in state.open),
        skipped=tuple(SkippedProposal(p, r) for p, r in state.skipped.items()),
        refused=_still_refused(state),
        log={"entries": state.events, "torn_bytes": campaign.torn_bytes},
        stored_but_not_imported=tuple(campaign.orphans()),
        held=tuple(
            MeasuredPoseStatus.of(m, m.pose in state.starred, held=True)
            for m in state.held.values()
            if m.question
        ),
        used=len(state.used),
        model=lambda: campaign.model,
    )


def models_text(rows: "Sequence[LeftOutModel]") -> list[RenderableType]:
    """Models side by side, and which one predicts poses left out best."""
    if not rows:
        return [Text("Models can be compared once two poses are measured.")]
    columns = "model", "RMSE (%)", "in 95 %", "log density", "log evidence", "fit (s)"
    made = table("Natural frequencies of each pose, predicted from the others alone", *columns)
    for row in rows:
        evidence = "" if row.log_evidence is None else f"{row.log_evidence:.1f}"
        made.add_row(
            row.model + (" ★" if row.campaign else ""), significant(row.rmse_percent),
            f"{100 * row.coverage95:.0f} %", f"{row.log_density:.1f}", evidence,
            significant(row.seconds),
        )  # fmt: skip
    best, used = rows[0], next((row for row in rows if row.campaign), rows[0])
    powers = (best.log_density - used.log_density) / math.log(10)
    said = f"Likeliest for poses left out: {best.model}, {best.about}."
    if best is not used:
        said += f" The campaign's own (★) is less likely by {powers:.1f} powers of ten."
    return [made, Text(said)]


def model_beside(campaign: Campaign, found: Mapping[str, Any]) -> str:
    """What to say where the campaign's model and a diagnosis of it, as JSON, give two answers."""
    return two_answers(campaign.of_model("status", ModelStatus, ModelStatus.of).springs, found)
