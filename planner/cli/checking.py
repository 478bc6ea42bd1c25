"""Whether a robot's description can be believed (`planner check`)."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import AsJson, respond, warn


def check(
    robot: Annotated[Path, typer.Argument(metavar="ROBOT_TOML", help="The robot's robot.toml.")],
    campaign: Annotated[
        Path | None,
        typer.Option(metavar="CAMPAIGN_TOML", help="Check its workspace and modes as well."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Draw the robot into this folder.")
    ] = None,
    format_: Annotated[str, typer.Option("--format", help="Of the picture: png or svg.")] = "png",
    as_json: AsJson = False,
) -> int:
    """Check a robot: masses, frequencies, limits, units, frames, collision geometry.

    Example: planner check robot/robot.toml --plot pictures
    """
    from planner.campaign.cell import examine_robot
    from planner.report.pictures import Pictures
    from planner.report.robot_check import RobotCheckReport

    pictures = Pictures(plot, format_)
    answer = RobotCheckReport.of(examine_robot(robot, campaign))
    answer = answer.with_pictures(pictures, answer.robot)
    if as_json:  # the text says them itself
        for finding in answer.findings:
            if finding.severity == "error":
                warn(finding.sentence)
    return respond(answer, as_json, 0 if answer.ok else 2)
