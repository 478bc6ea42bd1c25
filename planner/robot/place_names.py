"""Places of effects, "joint_2" or "link_3", beside the names that the robot's URDF has for them."""

import re
from collections.abc import Mapping

from planner.robot.robot import Robot

PLACE = re.compile(r"\b(?:joint|link)_\d+\b")


def place_names(robot: Robot) -> dict[str, str]:
    """By place, the URDF's name of the joint or link; only of those that it calls otherwise."""
    names = {}
    for number, joint in enumerate(robot.joint_names, 1):
        names[f"joint_{number}"] = joint
        names[f"link_{number}"] = robot.link_of(joint)
    return {place: name for place, name in names.items() if place != name}


def with_names(text: str, names: Mapping[str, str]) -> str:
    """A text with the robot's own name behind each place: "joint_2 (shoulder)"."""

    def named(match: re.Match[str]) -> str:
        place = match.group()
        return f"{place} ({names[place]})" if place in names else place

    return PLACE.sub(named, text)
