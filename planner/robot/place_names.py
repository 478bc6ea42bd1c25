"""Words for who stands beside the robot: names of places, and which way the tool's axes point.

Places of effects, "joint_2" or "link_3", stand beside the names that the robot's URDF has for them.
"""

import re
from collections.abc import Mapping

import numpy as np

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


# Share of an axis from which a direction is named: within 60° of it, so that what lies between two
# is named by both.
NAMED = 0.5


def axes_in_the_room(robot: Robot, q: np.ndarray) -> tuple[str, str, str]:
    """Of +x, +y and +z of the tcp frame, in words, at q (dof,) in rad (m).

    "away from the base" and "towards the base" are level, left and right as seen from the base.
    """
    rotation, place = robot.forward(q)
    turning = zip(robot.joint_places(q), robot.joints.slides, strict=True)
    base = next((foot for (foot, _), slides in turning if not slides), np.zeros(3))
    up = -np.asarray(robot.config.gravity, dtype=float)
    up = up / np.linalg.norm(up) if np.any(up) else np.array([0.0, 0.0, 1.0])
    level = place - base - ((place - base) @ up) * up
    if np.linalg.norm(level) < 1e-3:  # straight above the base nothing is away from it
        level = np.array([1.0, 0.0, 0.0]) - up[0] * up
    away = level / max(np.linalg.norm(level), 1e-9)
    named = (
        (up, "up", "down"),
        (away, "away from the base", "towards the base"),
        (np.cross(up, away), "left", "right"),
    )

    def words(axis: np.ndarray) -> str:
        parts = [(float(axis @ way), *ends) for way, *ends in named]
        said = [more if part > 0 else less for part, more, less in parts if abs(part) > NAMED]
        return " and ".join(said)

    x, y, z = (words(rotation[:, k]) for k in range(3))
    return x, y, z
