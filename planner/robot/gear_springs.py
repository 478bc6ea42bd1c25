"""Springs and dampers of a robot of which nothing is stated: as its gears and bearings have them.

A gear is chosen by the torque that it carries, and gives by about a milliradian under that, whoever
makes it: cycloidal and strain wave gears of 50 to 3,000 N·m rated torque are between 0.9 and
1.1 mrad (rated torque over torsional stiffness, as their catalogues state both).
"""

import msgspec
import numpy as np
import pinocchio as pin

from planner.robot.config import Compliance
from planner.robot.elastic_model import ElasticModel
from planner.robot.robot import Robot

GIVES_RAD, GIVES_M = 1e-3, 1e-4  # under what it carries: a gear, a rail's drive
ACROSS = 3.0  # stiffness of a bearing across its axis, of the gear's; published arms have 2 to 5
SD_PERCENT = 200.0  # e^sd of 3: another robot of the same payload may well differ by that
DAMPING_RATIO = 0.03  # of each spring alone; measured arms have 1 to 5 %
RIGID_HZ = 5e3  # alone, of what is no spring to a hammer: a bare flange on a large gear
POSES = 200  # at which the torque that a gear carries is looked for
PAYLOAD_KG_M3 = 2500.0  # payload charts have a cube of this density lie on the flange


def guessed_springs(robot: Robot, payload_kg: float, joints: tuple[str, ...]) -> Robot:
    """The robot with a gear spring at each of its joints, and its bearings' tilts."""
    loads = carried(robot, payload_kg)
    blocks = [
        block
        for name, axis, load in zip(robot.joint_names, robot.joint_axes, loads, strict=True)
        if name in joints
        for block in _springs(robot, name, axis, float(load))
    ]
    elastic = _with(robot, blocks)
    middle = (robot.lower_rad + robot.upper_rad) / 2
    inertia = np.diagonal(ElasticModel(elastic).matrices(middle).mass[0])
    damped = [
        msgspec.structs.replace(b, damping=_rounded(2 * DAMPING_RATIO * np.sqrt(b.stiffness * i)))
        for b, i in zip(blocks, _alike(blocks, inertia), strict=True)
        if np.sqrt(b.stiffness / i) < 2 * np.pi * RIGID_HZ
    ]
    return _with(robot, damped)


def carried(robot: Robot, payload_kg: float) -> np.ndarray:
    """Largest static torque (dof,) in N·m that robot and payload put on each joint, slides: N.

    Whichever way the base is mounted, at any of a spread of poses.
    """
    model, gravity = robot.model.copy(), 9.81
    tcp = model.frames[robot.tcp_id]
    lever = (payload_kg / PAYLOAD_KG_M3) ** (1 / 3) / 2
    load = pin.Inertia(payload_kg, np.zeros(3), np.zeros((3, 3)))
    model.appendBodyToJoint(tcp.parentJoint, load, tcp.placement)
    data, rng = model.createData(), np.random.default_rng(0)
    largest = np.zeros(len(robot.joint_names))
    for _ in range(POSES):
        at = robot.linkage.at(rng.uniform(robot.lower_rad, robot.upper_rad))
        pin.centerOfMass(model, data, at, True)
        for i, axis in enumerate(robot.joint_axes):
            joint = robot.linkage.leads[i] + 1
            mass = data.mass[joint]
            moment = mass * np.linalg.norm(np.cross(axis, data.com[joint]))
            carries = i in robot.tool_joints
            torque = gravity * (moment + carries * payload_kg * lever)
            force = gravity * mass
            largest[i] = max(largest[i], force if robot.joints.slides[i] else torque)
    return largest


def _springs(robot: Robot, name: str, axis: np.ndarray, load: float) -> list[Compliance]:
    """A joint's own spring, and two across it: as stiff by guess, in truth each as it is."""
    own = _direction(axis)
    if robot.slides(name):
        k = _rounded(load / GIVES_M)
        return [Compliance(name, own, k, 0.0, slide=True, stiffness_sd_percent=SD_PERCENT)]
    k = _rounded(load / GIVES_RAD)
    blocks = [Compliance(name, own, k, 0.0, stiffness_sd_percent=SD_PERCENT)]
    across = np.linalg.svd(axis[None])[2][1:]
    k_across = _rounded(ACROSS * load / GIVES_RAD)
    for direction in across:
        tilt = _direction(direction)
        blocks.append(Compliance(name, tilt, k_across, 0.0, stiffness_sd_percent=SD_PERCENT))
    return blocks


def _direction(axis: np.ndarray) -> tuple[float, float, float]:
    """An axis (3,) in numbers as they are written."""
    x, y, z = (round(float(v), 9) + 0.0 for v in axis)
    return x, y, z


def _alike(blocks: list[Compliance], inertia: np.ndarray) -> list[float]:
    """Inertia of each spring, of a bearing's two their mean."""
    places = [(block.joint, block.stiffness) for block in blocks]
    return [float(np.mean([v for p, v in zip(places, inertia, strict=True) if p == place]))
            for place in places]  # fmt: skip


def _with(robot: Robot, blocks: list[Compliance]) -> Robot:
    return Robot.of(msgspec.structs.replace(robot.config, compliance=tuple(blocks)), robot.path)


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")
