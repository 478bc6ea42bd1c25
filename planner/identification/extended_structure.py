"""A simulation's structure with every compliance that robot.toml leaves out.

Bearings and links let a joint tilt, and the floor gives way, whatever the description says. Springs
not stated are expected to be stiffer than those that are, by a factor nobody knows.
"""

from dataclasses import dataclass, replace

import msgspec
import numpy as np

from planner.dynamics.simulation import Simulation
from planner.identification.parameters import Priors, axis_name
from planner.robot.config import Compliance

# Stiffness of what is not stated, in that of the stiffest spring stated at the joint (the floor:
# of the whole robot), and damping in seconds of stiffness: 0.1 to 3 % of critical at 5 to 30 Hz.
STIFFNESS = 1.0, 300.0
DAMPING_S = 1e-4, 3e-3
ALONG = 0.5  # cosine above which a stated axis already covers this one
FLOOR = "base"


@dataclass(frozen=True, eq=False)
class ExtendedModel:
    """A simulation whose parameters can be identified, and what is known of them before.

    Its last `added` springs are not in robot.toml.
    """

    simulation: Simulation
    priors: Priors
    added: int = 0


def extended(simulation: Simulation, priors: Priors) -> ExtendedModel:
    """Three rotations at every joint that has any, and two tilts of the floor."""
    config, slides = simulation.robot.config, simulation.robot.slides_along
    # The own springs of joints that slide say nothing of rotations there.
    stated = config.compliance
    turning = [block for block in stated if not slides(block)]
    largest = max(simulation.robot.turning_stiffness())
    stiffest = max((block.stiffness for block in turning), default=largest)
    joints = dict.fromkeys([*(block.joint for block in stated), FLOOR])
    added: list[Compliance] = []
    bounds = dict(priors.bounds)
    for joint in joints:
        mine = [block for block in turning if block.joint == joint]
        scale = max((block.stiffness for block in mine), default=stiffest)
        for axis in np.eye(3)[: 2 if joint == FLOOR else 3]:
            if any(abs(float(np.dot(axis, block.axis))) > ALONG for block in mine):
                continue
            block, limits = _spring(joint, axis, scale)
            added.append(block)
            bounds |= limits
    wider = msgspec.structs.replace(config, compliance=(*stated, *added))
    robot = replace(simulation.robot, config=wider)
    return ExtendedModel(Simulation(robot), replace(priors, bounds=bounds), len(added))


def _spring(
    joint: str, axis: np.ndarray, scale: float
) -> tuple[Compliance, dict[str, tuple[float, float]]]:
    low, high = (scale * factor for factor in STIFFNESS)
    least, most = low * DAMPING_S[0], high * DAMPING_S[1]
    x, y, z = map(float, axis)
    block = Compliance(joint, (x, y, z), float(np.sqrt(low * high)), float(np.sqrt(least * most)))
    place = f"{joint} about {axis_name(block.axis)}"
    return block, {f"stiffness of {place}": (low, high), f"damping of {place}": (least, most)}
