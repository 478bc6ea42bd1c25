"""A base without mass that gives: a little inertia, so that it moves something of its own."""

import numpy as np
import pinocchio as pin

from planner.robot.config import Payload
from planner.robot.robot import Robot

SHARE = 1e-5  # of the robot's mass: changes no frequency in the band by a millionth


def massless_base(robot: Robot) -> tuple[Payload, ...]:
    """A little mass for a base to which neither the URDF nor a [[payload]] gives any, else none.

    Many URDFs state none, as the base stands still. Where it gives beside a joint 1 that gives
    about all axes, the mass matrix would have no inverse.
    """
    model = robot.model
    if model.inertias[0].mass > 0:
        return ()
    mass = SHARE * sum(inertia.mass for inertia in model.inertias)
    reach = max(float(np.linalg.norm(place.translation)) for place in model.jointPlacements)
    moment = mass * reach**2
    fixed = [f.name for f in model.frames if f.type == pin.FrameType.BODY and f.parentJoint == 0]
    own = Payload(fixed[0], mass, (0.0, 0.0, 0.0), (moment, 0.0, 0.0, moment, 0.0, moment))
    others = any(block.link in fixed and block != own for block in robot.config.payload)
    return () if others else (own,)
