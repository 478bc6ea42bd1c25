"""Commands on a campaign's folder: begin one, say what holds of its poses, write it for others."""

from pathlib import Path
from typing import Annotated

from planner.cli.answer import AsJson, Directory, argument, option, progress_bar, refusals, respond
from planner.errors import InputError


def new(
    directory: Directory,
    robot: Annotated[Path | None, option("The robot's robot.toml.", "ROBOT_TOML")] = None,
    campaign: Annotated[
        Path | None, option("Workspace, modes, acquisition.", "CAMPAIGN_TOML")
    ] = None,
    example: Annotated[
        bool, option("Write robot.toml, campaign.toml and a URDF to change.", None, "--example")
    ] = False,
    urdf: Annotated[
        Path | None, option("Begin from a maker's URDF; the rest is guessed.", "ARM.urdf")
    ] = None,
    mass_kg: Annotated[
        float | None, option("With --urdf: the robot's mass, of its data sheet.")
    ] = None,
    payload_kg: Annotated[
        float | None, option("With --urdf: its rated payload, which tells its gears.")
    ] = None,
    tool_mass_kg: Annotated[
        float | None, option("With --urdf: mass of the spindle on its flange.")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Start a campaign from robot.toml or from a maker's URDF, or write files to begin one with.

    The robot is checked: what looks wrong is said, what cannot work is refused.

    Example: planner new cell7 --urdf arm.urdf --mass-kg 1068 --payload-kg 210
    """
    from planner.campaign.campaign import Campaign
    from planner.campaign.from_urdf import StatedMasses, new_from_urdf
    from planner.campaign.store import write_example
    from planner.report.campaign_changes import begun
    from planner.report.campaign_changes import example as example_folder

    if (robot is not None) + example + (urdf is not None) != 1:
        raise InputError(
            "planner new needs one of --robot ROBOT_TOML, --urdf ARM.urdf and --example; give one."
        )
    weights = StatedMasses(mass_kg, payload_kg, tool_mass_kg)
    if urdf is None and weights != StatedMasses():
        raise InputError("--mass-kg, --payload-kg and --tool-mass-kg go with --urdf; give that.")
    if urdf is not None:
        return respond(begun(*new_from_urdf(directory, urdf, weights, campaign)), as_json)
    if robot is not None:
        return respond(begun(Campaign.new(directory, robot, campaign)), as_json)
    return respond(example_folder(*write_example(directory)), as_json)


PoseArgument = Annotated[str, argument("Name of the pose.", "POSE")]


def confirm(
    directory: Directory,
    pose: PoseArgument,
    at: Annotated[str | None, option("Where they are from instead.", "POSE")] = None,
    as_json: AsJson = False,
) -> int:
    """Use the held hits of a pose: they are from there indeed, or from another pose.

    Those of a withdrawn pose are used again.

    Example: planner confirm cell7 P014 --at P009
    """
    from planner.campaign.campaign import Campaign
    from planner.report.imports import imported

    campaign = Campaign(directory)
    report = campaign.confirm(pose) if at is None else campaign.move(pose, at)
    answer, refused, asked = imported((report,), directory, campaign.state.simulated)
    return respond(answer, as_json, refusals(refused, asked))


def undo(directory: Directory, as_json: AsJson = False) -> int:
    """Take back the last act.

    Example: planner undo cell7
    """
    from planner.campaign.campaign import Campaign
    from planner.report.campaign_changes import taken_back

    return respond(taken_back(Campaign(directory).undo(), "undone"), as_json)


def redo(directory: Directory, as_json: AsJson = False) -> int:
    """Let the act hold again that undo took back last, while nothing else was decided since.

    Example: planner redo cell7
    """
    from planner.campaign.campaign import Campaign
    from planner.report.campaign_changes import taken_back

    return respond(taken_back(Campaign(directory).redo(), "redone"), as_json)


def withdraw(
    directory: Directory,
    pose: PoseArgument,
    reason: Annotated[str, option("Why; kept in the log.")] = "",
    as_json: AsJson = False,
) -> int:
    """Set a measured pose aside, or hits that are held; their recordings stay.

    Example: planner withdraw cell7 P003 --reason "loose sensor"
    """
    from planner.campaign.campaign import Campaign
    from planner.report.campaign_changes import withdrawn

    campaign = Campaign(directory)
    held = pose in campaign.state.held
    campaign.withdraw(pose, reason)
    return respond(withdrawn(directory, pose, reason, held), as_json)


def skip(
    directory: Directory,
    pose: PoseArgument,
    reason: Annotated[str, option("Why; kept in the log.")] = "",
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


def report(
    directory: Directory,
    out: Annotated[
        Path | None, option("Where it goes (default: DIR/report.html).", "FILE.html")
    ] = None,
    diagnosis: Annotated[
        Path | None, option("What planner diagnose --out has written.", "FOLDER")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Write all of a campaign into one HTML file: works offline, prints to PDF.

    Example: planner report cell7 --out cell7.html
    """
    from planner.campaign.campaign import Campaign
    from planner.report.page import write_report

    with progress_bar("writing", quiet=as_json) as progress:
        progress("the report", 0.0)
        answer = write_report(Campaign(directory), out, diagnosis)
    return respond(answer, as_json)


def export(
    directory: Directory,
    kind: Annotated[
        str,
        argument(
            "Poses to drive to: krl, rapid, urscript, poses (CSV). Results: uff (58 and 55), "
            "mat, csv, model (one small file).",
            "KIND",
        ),
    ],
    out: Annotated[Path | None, option("Where it goes (default: DIR/export).", "FOLDER")] = None,
    poses: Annotated[
        Path | None, option("These poses instead of open or measured ones.", "POSES_CSV")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Write proposals for the robot's controller, or results for other programs.

    Axes, signs and offsets of the controller stand in robot.toml, [controller].

    Example: planner export cell7 krl --out usb
    """
    from planner.campaign.campaign import Campaign
    from planner.report.exports import export as write

    return respond(write(Campaign(directory), kind, out, poses), as_json)
