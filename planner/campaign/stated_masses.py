"""What a URDF says of masses beside the robot's mass of its data sheet."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

from planner.errors import InputError
from planner.robot.default_properties import SAME, total_stated
from planner.robot.robot import Robot
from planner.robot.urdf_elements import link_inertia

SAME_MASS = 0.05  # relative: data sheets count cables and oil, URDFs as they like


def links_kg(robot: Robot, mass_kg: float | None) -> float:
    """What the URDF's links weigh in kg; InputError where `mass_kg` cannot be of that robot.

    Links that weigh far less than the robot are placeholders, or not all of its links: common. None
    weigh far more.
    """
    stated = total_stated(robot)
    if mass_kg is not None and stated > (1 + SAME) * mass_kg:
        raise InputError(
            f"--mass-kg is {mass_kg:g}, and the links of {robot.urdf_path} weigh {stated:.4g} kg "
            f"together; give the robot's mass in kg, or leave it out to use the URDF's masses."
        )
    return stated


def mass_conflict(robot: Robot, mass_kg: float | None, stated_kg: float) -> Iterator[str]:
    """Which masses are used where URDF and data sheet both state some, and differ."""
    if mass_kg is None or not stated_kg or abs(mass_kg / stated_kg - 1) < SAME_MASS:
        return
    guessed = [table.link for table in robot.config.link]
    links = ElementTree.fromstring(robot.urdf_text).findall("link")
    stated = [link for link in links if link_inertia(link).mass > 0]
    name = robot.urdf_path.name
    both = f"The links of {name} weigh {stated_kg:.4g} kg together, --mass-kg says {mass_kg:g} kg: "
    if not guessed:
        yield (
            f"{both}the URDF's masses are used, because they tell the links apart. Where --mass-kg "
            f"is right, correct them in [[link]] of robot.toml."
        )
    elif len(guessed) < len(stated):
        yield (
            f"{both}the URDF's masses are used, and those of {', '.join(guessed)} are guessed: "
            f"{total_stated(robot):.4g} kg in all."
        )
    else:
        yield (
            f"{both}--mass-kg is used and shared out by size, because the URDF's masses look like "
            f"placeholders."
        )
