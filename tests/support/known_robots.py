"""Robot folders of known industrial arms, under the name by which the tests call them."""

from pathlib import Path

from planner.truth.arms import ARMS, IRB6640, KR10, KR210, Arm, Body, Joint

KnownRobot = Arm
KNOWN_ROBOTS = ARMS

__all__ = ["IRB6640", "KNOWN_ROBOTS", "KR10", "KR210", "Arm", "Body", "Joint", "KnownRobot"]


def kr10_folder(directory: Path, per_joint: int = 1) -> Path:
    """robot.toml of the KR10-like robot in a new folder `directory`/robot."""
    return KR10.write(directory / "robot", per_joint)


def kr210_folder(directory: Path, per_joint: int = 1) -> Path:
    """robot.toml of the KR210-like robot in a new folder `directory`/robot."""
    return KR210.write(directory / "robot", per_joint)


def irb6640_folder(directory: Path, per_joint: int = 1) -> Path:
    """robot.toml of the IRB 6640-like robot in a new folder `directory`/robot."""
    return IRB6640.write(directory / "robot", per_joint)
