"""Answer of `replay`: each step of the log and whether computing it again gave the same."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from rich.console import Group
from rich.table import Table
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.compare.counterfactual import OtherAcquisition
from planner.progress import ProgressCallback
from planner.recording.joints import JointUnits
from planner.replay import Step, replay
from planner.report.answer import Done
from planner.report.text import table


def replayed(
    campaign: Campaign,
    until: int | None,
    rrd: Path | None,
    viewer: bool,
    progress: ProgressCallback,
    acquisition: str | None = None,
) -> Done:
    """Answer of `replay`: compute every step again, up to entry `until`, and show it in Rerun.

    "check" of a step: "identical", "close", "differs" or "kept"; with an `acquisition` also what
    that would have proposed, and saved. Sds (count,) in % are over the workspace. Raises InputError
    where a recording is missing or changed.
    """
    steps, story = [], None
    with ExitStack() as stack:
        if rrd is not None or viewer:
            from planner.report.rerun.campaign import RerunView

            story = RerunView(campaign.cell, rrd, viewer, campaign.state.simulated)
            stack.callback(story.close)
        for step in replay(campaign, until, acquisition):
            last = until or len(campaign.entries)
            progress(f"entry {step.entry.seq}, {step.detail}", step.entry.seq / last)
            if story is not None:
                story.log(step.entry, step.model, step.measured)
            steps.append(replace(step, measured=None))  # recordings are large
    if acquisition is not None:
        progress(f"playing {acquisition} on what was measured", 1.0)
    otherwise = OtherAcquisition.of(campaign, acquisition) if acquisition else None
    return _answer(campaign, steps, str(rrd.resolve()) if rrd else None, otherwise)


def _answer(
    campaign: Campaign, steps: Sequence[Step], file: str | None, otherwise: OtherAcquisition | None
) -> Done:
    told = [
        {
            "seq": one.entry.seq, "time": one.entry.time,
            "event": one.entry.event.kind, "check": one.check, "detail": one.detail,
            "measurements": len(one.model.labelled),
            "frequency_sd_percent": one.model.frequency_sd_percent, "instead": one.instead,
        }
        for one in steps
    ]  # fmt: skip
    joints, reproduced = campaign.cell.robot.joints, all(one.check != "differs" for one in steps)
    keys = {
        "campaign": str(campaign.directory), "steps": told, "reproduced": reproduced, "rrd": file,
        "frequency_sd_percent": told[-1]["frequency_sd_percent"] if told else None,
        "otherwise": otherwise, "joint_units": joints.declared,
    }  # fmt: skip
    parts = [_table(steps, joints)]
    lines = [f"The log was {'' if reproduced else 'NOT '}reproduced."]
    lines += [f"Rerun recording: {file}"] if file else []
    if otherwise is not None:
        parts.append(_curves(otherwise))
        lines.append(otherwise.text)
    return Done(keys, Group(*parts, Text("\n".join(lines))))


def _table(steps: Sequence[Step], joints: JointUnits) -> Table:
    asked = any(step.instead for step in steps)
    more = ["instead, joints at"] if asked else []
    made = table("Replay", "entry", "event", "check", "what", "sd of frequencies (%)", *more)
    for step in steps:
        sd = "  ".join(f"{v:.2f}" for v in step.model.frequency_sd_percent)
        poses = [joints.listed(pose.joints_deg, 0) for pose in step.instead]
        made.add_row(
            str(step.entry.seq), step.entry.event.kind, step.check, step.detail, sd,
            *(["\n".join(poses)] if asked else []),
            style="red" if step.check == "differs" else None,
        )  # fmt: skip
    return made


def _curves(other: OtherAcquisition) -> Table:
    counts = next(iter(other.runs.values()))["n"]
    title = "Frequency RMSE (%) on poses not yet used, by measurements"
    made = table(title, "order", *map(str, counts))
    for name, run in other.runs.items():
        made.add_row(name, *(f"{v:.2f}" for v in run["frequency_rmse_percent"]))
    return made
