"""What an engineer says of a campaign's poses: confirm, withdraw, skip, undo, redo."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import AsJson, refusals, respond

Directory = Annotated[Path, typer.Argument(metavar="DIR", help="Campaign folder.")]
PoseArgument = Annotated[str, typer.Argument(metavar="POSE", help="Name of the pose.")]


def confirm(
    directory: Directory,
    pose: PoseArgument,
    at: Annotated[
        str | None, typer.Option("--at", metavar="POSE", help="Where they are from instead.")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Use the held hits of a pose: they are from there indeed, or from another pose.

    Those of a withdrawn pose are used again.

    Example: planner confirm cell7 P014 --at P009
    """
    from planner.campaign.campaign import Campaign
    from planner.report.imports import ImportedPoses

    campaign = Campaign(directory)
    report = campaign.confirm(pose) if at is None else campaign.move(pose, at)
    answer = ImportedPoses.of((report,), campaign.state.simulated)
    return respond(answer, as_json, refusals(answer.refused, answer.to_be_answered(directory)))


def undo(directory: Directory, as_json: AsJson = False) -> int:
    """Take back the last act.

    Example: planner undo cell7
    """
    from planner.campaign.campaign import Campaign
    from planner.report.campaign_acts import undone

    return respond(undone(Campaign(directory).undo()), as_json)


def redo(directory: Directory, as_json: AsJson = False) -> int:
    """Let the act hold again that undo took back last, while nothing else was decided since.

    Example: planner redo cell7
    """
    from planner.campaign.campaign import Campaign
    from planner.report.campaign_acts import redone

    return respond(redone(Campaign(directory).redo()), as_json)


def withdraw(
    directory: Directory,
    pose: PoseArgument,
    reason: Annotated[str, typer.Option(help="Why; kept in the log.")] = "",
    as_json: AsJson = False,
) -> int:
    """Set a measured pose aside; its recordings stay.

    Example: planner withdraw cell7 P003 --reason "loose sensor"
    """
    from planner.campaign.campaign import Campaign
    from planner.report.campaign_acts import withdrawn

    Campaign(directory).withdraw(pose, reason)
    return respond(withdrawn(directory, pose, reason), as_json)


def skip(
    directory: Directory,
    pose: PoseArgument,
    reason: Annotated[str, typer.Option(help="Why; kept in the log.")] = "",
    as_json: AsJson = False,
) -> int:
    """Say that a proposed pose cannot be measured; it is not offered again.

    With a reason its neighbours are not offered either: what stands in the way there does so
    around it too.

    Example: planner skip cell7 P007 --reason "hose in the way"
    """
    from planner.campaign.campaign import Campaign
    from planner.report.answer import Done

    Campaign(directory).skip(pose, reason, neighbours=bool(reason))
    return respond(
        Done({"skipped": pose, "reason": reason}, f"Pose {pose} will not be offered again."),
        as_json,
    )
