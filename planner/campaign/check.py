"""A robot held against what a campaign asks of it, before the campaign begins."""

from pathlib import Path

from planner.campaign.config import CampaignConfig, load_campaign_config
from planner.check.examine import Examination, Plan, examine
from planner.errors import InputError
from planner.robot.robot import Robot


def examine_robot(robot_toml: Path, campaign_toml: Path | None = None) -> Examination:
    """Check a robot, and a campaign.toml if one is named.

    Raises InputError where a file cannot be read at all.
    """
    robot = Robot.load(robot_toml)
    if campaign_toml is None:
        return examine(robot)
    return examine(robot, plan_of(load_campaign_config(campaign_toml), campaign_toml.name))


def plan_of(config: CampaignConfig, file: str) -> Plan:
    """What campaign.toml asks of a robot."""
    table, simulated = config.modes, config.fidelity.simulation != "none"
    return Plan(file, config.workspace, table.band_hz, table.count, simulated)


def refuse_errors(found: Examination) -> None:
    """InputError with the first error of a check, if there is one."""
    if found.errors:
        raise InputError(found.errors[0].sentence)
