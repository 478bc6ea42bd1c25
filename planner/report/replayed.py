"""Answer of `replay`: each step of the log and whether computing it again gave the same."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from rich.console import Group
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.campaign.events import Proposal
from planner.compare.counterfactual import OtherAcquisition
from planner.progress import ProgressCallback
from planner.recording.joints import JointUnits
from planner.replay import Step, replay
from planner.report.answer import Answer
from planner.report.text import table


@dataclass(frozen=True, eq=False)
class ReplayedStep:
    """An entry of the log; `check` is "identical", "close" (rounding), "differs" or "kept"."""

    seq: int
    time: str
    event: str
    check: str
    detail: str
    measurements: int
    frequency_sd_percent: np.ndarray
    instead: tuple[Proposal, ...]  # of another acquisition

    @classmethod
    def of(cls, step: Step) -> "ReplayedStep":
        """Of a step of `planner.replay`."""
        entry = step.entry
        return cls(
            entry.seq, entry.time, msgspec.to_builtins(entry.event)["kind"], step.check,
            step.detail, len(step.model.labelled), step.model.frequency_sd_percent, step.instead,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class ReplayReport(Answer):
    """Answer of `replay`."""

    campaign: str
    steps: tuple[ReplayedStep, ...]
    reproduced: bool
    rrd: str | None
    frequency_sd_percent: np.ndarray | None
    otherwise: OtherAcquisition | None
    joint_units: Any = msgspec.UNSET

    def _stands(self, pose: Proposal) -> str:
        names = [""] * len(pose.joints_deg)
        return JointUnits.declared_as(names, self.joint_units).listed(pose.joints_deg, 0)

    def text(self) -> Group:
        """The steps, the verdict, and what another acquisition would have saved."""
        asked = any(step.instead for step in self.steps)
        more = ["instead, joints at"] if asked else []
        made = table("Replay", "entry", "event", "check", "what", "sd of frequencies (%)", *more)
        for step in self.steps:
            sd = "  ".join(f"{v:.2f}" for v in step.frequency_sd_percent)
            poses = [self._stands(pose) for pose in step.instead]
            made.add_row(
                str(step.seq), step.event, step.check, step.detail, sd,
                *(["\n".join(poses)] if asked else []),
                style="red" if step.check == "differs" else None,
            )  # fmt: skip
        lines = [f"The log was {'' if self.reproduced else 'NOT '}reproduced."]
        if self.rrd:
            lines.append(f"Rerun recording: {self.rrd}")
        other = self.otherwise
        if other is None:
            return Group(made, Text("\n".join(lines)))
        counts = next(iter(other.runs.values())).n
        curves = table("Frequency RMSE (%) on poses not yet used, by measurements", "order",
                       *map(str, counts))  # fmt: skip
        for name, run in other.runs.items():
            curves.add_row(name, *(f"{v:.2f}" for v in run.frequency_rmse_percent))
        return Group(made, curves, Text("\n".join([*lines, other.text])))


def replayed(
    campaign: Campaign,
    until: int | None,
    rrd: Path | None,
    viewer: bool,
    progress: ProgressCallback,
    acquisition: str | None = None,
) -> ReplayReport:
    """Compute every step of the log again, up to entry `until`, and show it in Rerun.

    With an `acquisition` also what that would have proposed, and saved. Raises InputError where
    a recording is missing or changed.
    """
    from planner.report.rerun.event_logger import EventLogger

    steps = []
    simulated = campaign.state.simulated
    with EventLogger(campaign.cell, rrd, viewer, simulated) as story:
        for step in replay(campaign, until, acquisition):
            last = until or len(campaign.entries)
            progress(f"entry {step.entry.seq}, {step.detail}", step.entry.seq / last)
            story.log(step.entry, step.model, step.measured)
            steps.append(ReplayedStep.of(step))
    if acquisition is not None:
        progress(f"playing {acquisition} on what was measured", 1.0)
    return ReplayReport(
        campaign=str(campaign.directory),
        steps=tuple(steps),
        reproduced=all(step.check != "differs" for step in steps),
        rrd=str(rrd.resolve()) if rrd else None,
        frequency_sd_percent=steps[-1].frequency_sd_percent if steps else None,
        otherwise=OtherAcquisition.of(campaign, acquisition) if acquisition else None,
        joint_units=campaign.cell.robot.joints.declared,
    )
