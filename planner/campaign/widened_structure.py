"""A simulation's structure with every spring that may be missing: of joints, floor and links."""

from dataclasses import replace

import msgspec
import numpy as np

from planner.diagnosis.effects.extra_compliance import across, triple
from planner.diagnosis.effects.places import movable
from planner.dynamics.simulation import Simulation
from planner.identification.extended_structure import (
    DAMPING_S,
    FLOOR,
    STIFFNESS,
    ExtendedModel,
    extended,
)
from planner.identification.parameters import place_name
from planner.robot.config import Compliance

Spring = tuple[Compliance, dict[str, tuple[float, float]]]  # and its priors' bounds, by name

SHORT = 0.1  # of the longest link: what is shorter does not bend
BEND = 0.3  # of the joint's stiffness: the scale of a link's, whose prior is STIFFNESS times this


def widened(structure: ExtendedModel) -> ExtendedModel:
    """Beside tilts of joints and floor the base's turn and shifts, and links that bend."""
    if not structure.added:
        structure = extended(structure.simulation, structure.priors)
    robot = structure.simulation.robot
    stated = robot.config.compliance[: len(robot.config.compliance) - structure.added]
    turning = [block for block in stated if not block.slide]
    stiffest = max((b.stiffness for b in turning), default=max(robot.turning_stiffness()))
    ways = _links(structure.simulation)
    longest = max((float(np.linalg.norm(way)) for _, _, way in ways), default=0.0) or robot.reach_m
    listed = {place_name(block) for block in robot.config.compliance}
    springs = [_spring(FLOOR, np.eye(3)[2], stiffest)]
    springs += [_spring(FLOOR, a, stiffest / (2 * longest) ** 2, slide=True) for a in np.eye(3)]
    for link, joint, way in ways:
        length = np.linalg.norm(way)
        if length > SHORT * longest:
            own = [b.stiffness for b in stated if b.joint == joint and not robot.slides_along(b)]
            own = own or [stiffest]
            axes = (*across(way / length), way / length)
            springs += [_spring(link, axis, BEND * max(own)) for axis in axes]
    springs = [(b, limits) for b, limits in springs if place_name(b) not in listed]
    movables = movable(structure.simulation, [b for b, _ in springs])
    springs = [(b, limits) for b, limits in springs if b in movables]
    bounds = dict(structure.priors.bounds)
    for _, limits in springs:
        bounds |= limits
    added = tuple(block for block, _ in springs)
    config = msgspec.structs.replace(robot.config, compliance=(*robot.config.compliance, *added))
    simulation = Simulation(replace(robot, config=config))
    return ExtendedModel(
        simulation, replace(structure.priors, bounds=bounds), structure.added + len(added)
    )


def _links(simulation: Simulation) -> list[tuple[str, str, np.ndarray]]:
    """Links that carry a joint: name, the joint that moves it, and the way (3,) to the next."""
    robot, found = simulation.robot, []
    for joint in robot.joint_names:
        link = robot.link_of(joint)
        carried = robot.carries(link)
        if carried is not None and link not in robot.joint_names:
            way = np.array(robot.model.jointPlacements[carried[1]].translation)
            found.append((link, joint, way))
    return found


def _spring(joint: str, axis: np.ndarray, scale: float, slide: bool = False) -> Spring:
    low, high = (scale * factor for factor in STIFFNESS)
    least, most = low * DAMPING_S[0], high * DAMPING_S[1]
    medians = float(np.sqrt(low * high)), float(np.sqrt(least * most))
    block = Compliance(joint, triple(axis), *medians, slide=slide)
    place = place_name(block)
    return block, {f"stiffness of {place}": (low, high), f"damping of {place}": (least, most)}
