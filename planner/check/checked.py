"""Links, joints and poses of a robot as a check of its description found them."""

from dataclasses import dataclass

import msgspec
import numpy as np

from planner.check.examine import Examination


@dataclass(frozen=True)
class CheckedLink:
    """A link: what turns it (null: nothing), mass, centre of mass and principal moments.

    `guessed` masses have an sd, `mass_sd_kg`, as others may that robot.toml states.
    """

    link: str
    joint: str | None
    mass_kg: float
    com_m: tuple[float, ...]
    moments_kg_m2: tuple[float, ...]
    inertial: bool
    collision_shapes: int
    guessed: bool = False
    mass_sd_kg: float | None = None


@dataclass(frozen=True)
class CheckedJoint:
    """A joint's limits and its speed, in degrees and degrees a second; a slide's in mm and mm/s."""

    joint: str
    lower_deg: float
    upper_deg: float
    speed_deg_s: float
    unit: str | msgspec.UnsetType = msgspec.UNSET  # "mm" of a joint that slides


@dataclass(frozen=True)
class CheckedPose:
    """What the simulation says at a pose: frequencies and damping ratios, from the lowest."""

    pose: str
    joints_deg: tuple[float, ...]
    position_m: tuple[float, ...]
    frequency_hz: tuple[float, ...]
    damping_ratio: tuple[float, ...]


def checked_poses(found: Examination) -> tuple[CheckedPose, ...]:
    """What the simulation says at the poses that were looked at."""
    if not found.frequency_hz.size:
        return ()
    places = found.robot.forward_batch(found.q)[1]
    made = []
    for i, name in enumerate(found.poses):
        known = np.isfinite(found.frequency_hz[i])
        made.append(
            CheckedPose(
                name,
                tuple(found.robot.joints.shown(found.q[i]).round(4).tolist()),
                tuple(places[i].tolist()),
                tuple(found.frequency_hz[i][known].tolist()),
                tuple(found.damping_ratio[i][known].tolist()),
            )
        )
    return tuple(made)


def checked_links(found: Examination) -> tuple[CheckedLink, ...]:
    """Of all links."""
    return tuple(
        CheckedLink(
            b.name, b.joint or None, b.mass, tuple(b.com_m.tolist()),
            tuple(b.moments.tolist()), b.stated, b.shapes, b.guessed,
            None if b.sd_percent is None else b.mass * b.sd_percent / 100,
        )
        for b in found.links
    )  # fmt: skip


def checked_joints(found: Examination) -> tuple[CheckedJoint, ...]:
    """Of all joints that move."""
    robot = found.robot
    limits = robot.joints.shown([robot.lower_rad, robot.upper_rad, robot.velocity_rad_s]).T
    return tuple(
        CheckedJoint(name, *row, unit="mm" if robot.slides(name) else msgspec.UNSET)
        for name, row in zip(robot.joint_names, limits.tolist(), strict=True)
    )
