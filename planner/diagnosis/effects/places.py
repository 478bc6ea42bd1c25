"""Places of a robot, and simulations with more elastic rotations."""

from collections.abc import Sequence
from dataclasses import replace

import msgspec
import numpy as np

from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.robot.config import Compliance, Payload


def joints(simulation: Simulation) -> tuple[tuple[str, str], ...]:
    """("joint_1", name in the URDF) and so on."""
    names = simulation.robot.joint_names
    return tuple((f"joint_{i}", name) for i, name in enumerate(names, 1))


def links(simulation: Simulation) -> tuple[tuple[str, str], ...]:
    """("link_1", the joint that moves it) and so on."""
    names = simulation.robot.joint_names
    return tuple((f"link_{i}", name) for i, name in enumerate(names, 1))


def joint_of(simulation: Simulation, place: str) -> str:
    """The URDF's name of the joint at, or moving the link at, "joint_N" or "link_N"."""
    return simulation.robot.joint_names[int(place.rsplit("_", 1)[1]) - 1]


def own_axis(simulation: Simulation, joint: str) -> np.ndarray:
    """Unit vector of a joint's own axis in its frame."""
    robot = simulation.robot
    return robot.joint_axes[robot.joint_names.index(joint)]


def listed_axes(simulation: Simulation, joint: str) -> np.ndarray:
    """(k, 3) axes of a joint's elastic rotations in robot.toml."""
    blocks = simulation.robot.config.compliance
    own = [b.axis for b in blocks if b.joint == joint and not b.slide]
    return np.array(own, dtype=float).reshape(-1, 3)


def missing_axes(simulation: Simulation, joint: str, wanted: np.ndarray) -> np.ndarray:
    """Of `wanted` (k, 3), orthonormal, those that no listed rotation about the joint has."""
    there = listed_axes(simulation, joint)
    free = [a for a in wanted if not np.any(np.abs(there @ a) > 0.9)]
    return np.array(free).reshape(-1, 3)


def with_blocks(
    simulation: Simulation, blocks: Sequence[Compliance], payload: Sequence[Payload] = ()
) -> Simulation:
    """The simulation with more [[compliance]] and [[payload]] blocks, listed last."""
    robot, carried = simulation.robot, simulation.robot.config.payload
    config = msgspec.structs.replace(
        robot.config,
        compliance=(*robot.config.compliance, *blocks),
        payload=(*carried, *(block for block in payload if block not in carried)),
    )
    return Simulation(replace(robot, config=config))


def movable(simulation: Simulation, blocks: Sequence[Compliance]) -> tuple[Compliance, ...]:
    """Those that, one after the other, move an inertia of their own beside what is listed.

    A base without mass that shifts along a rail does what the rail's own spring does.
    """
    kept: tuple[Compliance, ...] = ()
    for block in blocks:
        try:
            _ = with_blocks(simulation, (*kept, block)).elastic
        except InputError:
            continue
        kept = (*kept, block)
    return kept


def stiffest(simulation: Simulation, joint: str) -> float:
    """Largest stiffness listed at a joint (N·m/rad), of the robot where it lists none."""
    return max(simulation.robot.turning_stiffness(joint))


def damping_time(simulation: Simulation) -> float:
    """Median damping per stiffness in s."""
    blocks = simulation.robot.config.compliance
    times = [b.damping / b.stiffness for b in blocks if b.damping > 0]
    return float(np.median(times)) if times else 1e-3
