"""How a campaign begins (`planner new`)."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.acts import Directory
from planner.cli.answer import AsJson, respond
from planner.errors import InputError


def new(
    directory: Directory,
    robot: Annotated[
        Path | None, typer.Option(metavar="ROBOT_TOML", help="The robot's robot.toml.")
    ] = None,
    campaign: Annotated[
        Path | None, typer.Option(metavar="CAMPAIGN_TOML", help="Workspace, modes, acquisition.")
    ] = None,
    example: Annotated[
        bool,
        typer.Option("--example", help="Write robot.toml, campaign.toml and a URDF to change."),
    ] = False,
    urdf: Annotated[
        Path | None,
        typer.Option(metavar="ARM.urdf", help="Begin from a maker's URDF; the rest is guessed."),
    ] = None,
    mass_kg: Annotated[
        float | None, typer.Option(help="With --urdf: the robot's mass, of its data sheet.")
    ] = None,
    payload_kg: Annotated[
        float | None, typer.Option(help="With --urdf: its rated payload, which tells its gears.")
    ] = None,
    tool_mass_kg: Annotated[
        float | None, typer.Option(help="With --urdf: mass of the spindle on its flange.")
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
    from planner.report.campaign_acts import ExampleFolder, NewCampaign

    if (robot is not None) + example + (urdf is not None) != 1:
        raise InputError(
            "planner new needs one of --robot ROBOT_TOML, --urdf ARM.urdf and --example; give one."
        )
    weights = StatedMasses(mass_kg, payload_kg, tool_mass_kg)
    if urdf is None and weights != StatedMasses():
        raise InputError("--mass-kg, --payload-kg and --tool-mass-kg go with --urdf; give that.")
    if urdf is not None:
        begun, guessed = new_from_urdf(directory, urdf, weights, campaign)
        return respond(NewCampaign.of(begun, guessed), as_json)
    if robot is not None:
        return respond(NewCampaign.of(Campaign.new(directory, robot, campaign)), as_json)
    return respond(ExampleFolder(*write_example(directory)), as_json)
