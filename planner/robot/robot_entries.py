"""What robot.toml says of a robot, against what its URDF has."""

from typing import TYPE_CHECKING

import numpy as np

from planner.errors import InputError
from planner.robot.config import BASE

if TYPE_CHECKING:
    from planner.robot.robot import Robot


def check_entries(robot: "Robot") -> None:
    """Raise InputError where robot.toml names what there is not, or a joint has no range."""
    for entry, name, number in (
        ("tcp_frame", robot.config.tcp_frame, robot.tcp_id),
        ("sensor_frame", robot.config.sensor_frame, robot.sensor_id),
    ):
        if robot.model.frames[number].parentJoint == 0:
            raise InputError(
                f'{robot.path}: {entry} "{name}" is fixed to the base and never moves; name a '
                f"frame on the tool."
            )
    for block in robot.config.compliance:
        if block.joint not in (*robot.joint_names, BASE) and not robot.carries(block.joint):
            fault = f"is no actuated joint of {robot.urdf_path.name}, nor a link with one beyond"
            if block.joint in robot.linkage.names:
                fault = "follows another (<mimic>), with which it gives"
            raise InputError(
                f'{robot.path}: [[compliance]] joint "{block.joint}" {fault}; name one of '
                f"{', '.join(robot.joint_names)}."
            )
    for block in (*robot.config.resonator, *robot.config.harmonic):
        if block.joint not in robot.joint_names:
            raise InputError(
                f'{robot.path}: [[effects]] joint "{block.joint}" is no actuated joint of '
                f"{robot.urdf_path.name}; it has {', '.join(robot.joint_names)}."
            )
    for block in robot.config.payload:
        robot.frame_id("[[payload]] link", block.link)
    for table in robot.config.link:
        robot.frame_id("[[link]] link", table.link)
    bad = np.flatnonzero(~(robot.lower_rad < robot.upper_rad))
    if bad.size:
        raise InputError(
            f"{robot.urdf_path}: {robot.joint_names[bad[0]]} has no range between its limits; "
            f"give lower and upper in {'m' if robot.joints.slides[bad[0]] else 'rad'}."
        )
