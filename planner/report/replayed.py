"""Answer of `replay`: each step of the log and whether computing it again gave the same."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.compare.counterfactual import OtherAcquisition
from planner.progress import ProgressCallback
from planner.replay import Step, replay
from planner.report.answer import Answer, plain
from planner.report.campaign_changes import kind_of
from planner.report.text import table


@dataclass(frozen=True, eq=False)
class ReplayReport(Answer):
    """Answer of `replay`; "check" of a step: "identical", "close", "differs" or "kept"."""

    campaign: Campaign
    steps: tuple[Step, ...]
    rrd: Path | None
    otherwise: OtherAcquisition | None

    @property
    def reproduced(self) -> bool:
        """Whether no step differs."""
        return all(step.check != "differs" for step in self.steps)

    def to_json(self) -> dict[str, Any]:
        """Step by step; sds (count,) in % are over the workspace."""
        steps = [
            {
                "seq": one.entry.seq, "time": one.entry.time,
                "event": kind_of(one.entry), "check": one.check, "detail": one.detail,
                "measurements": len(one.model.labelled),
                "frequency_sd_percent": one.model.frequency_sd_percent, "instead": one.instead,
            }
            for one in self.steps
        ]  # fmt: skip
        said = {
            "campaign": str(self.campaign.directory), "steps": steps,
            "reproduced": self.reproduced, "rrd": str(self.rrd.resolve()) if self.rrd else None,
            "frequency_sd_percent": steps[-1]["frequency_sd_percent"] if steps else None,
            "otherwise": self.otherwise, "joint_units": self.campaign.cell.robot.joints.declared,
        }  # fmt: skip
        return plain(said)

    def text(self) -> Group:
        """The steps, the verdict, and what another acquisition would have saved."""
        asked = any(step.instead for step in self.steps)
        more = ["instead, joints at"] if asked else []
        made = table("Replay", "entry", "event", "check", "what", "sd of frequencies (%)", *more)
        for step in self.steps:
            sd = "  ".join(f"{v:.2f}" for v in step.model.frequency_sd_percent)
            joints = self.campaign.cell.robot.joints
            poses = [joints.listed(pose.joints_deg, 0) for pose in step.instead]
            made.add_row(
                str(step.entry.seq), kind_of(step.entry), step.check, step.detail, sd,
                *(["\n".join(poses)] if asked else []),
                style="red" if step.check == "differs" else None,
            )  # fmt: skip
        lines = [f"The log was {'' if self.reproduced else 'NOT '}reproduced."]
        if self.rrd:
            lines.append(f"Rerun recording: {self.rrd.resolve()}")
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
            steps.append(replace(step, measured=None))  # recordings are large
    if acquisition is not None:
        progress(f"playing {acquisition} on what was measured", 1.0)
    otherwise = OtherAcquisition.of(campaign, acquisition) if acquisition else None
    return ReplayReport(campaign, tuple(steps), rrd, otherwise)
