"""Springs and bodies that a fit moved far from what robot.toml states: something is missing."""

from collections.abc import Iterator

import numpy as np

from planner.fit.structure import RobotStructure
from planner.robot.virtual_joints import OUTER
from planner.words import significant

DEPARTED = 4.0  # prior sds
TOLD = 3  # at most


def away(structure: RobotStructure, x: np.ndarray) -> np.ndarray:
    """(D,) by how many prior sds stiffnesses and bodies are off what is stated; 0 of all else."""
    out = np.zeros(len(x))
    for own in (slice(0, structure.stiffnesses), structure.inertial):
        out[own] = (x[own] - structure.mean[own]) / structure.sd[own]
    return out


def departed(structure: RobotStructure, x: np.ndarray) -> tuple[int, ...]:
    """Numbers of x that are far from what is stated."""
    return tuple(map(int, np.flatnonzero(np.abs(away(structure, x)) > DEPARTED)))


def departures_text(structure: RobotStructure, x: np.ndarray) -> str:
    """What robot.toml may state wrongly; empty where all is near it."""
    far = departed(structure, x)
    told = [*_bodies(structure, x, far), *_springs(structure, x, far)]
    if not told:
        return ""
    return (
        f"To fit the recordings, {'; '.join(told[:TOLD])}. That is far from robot.toml: is a tool, "
        f"a load or a cable missing there, or a number wrong?"
    )


def _springs(s: RobotStructure, x: np.ndarray, far: tuple[int, ...]) -> Iterator[str]:
    for i in far:
        if i < s.stiffnesses and s.parameters[i].stated:
            times = float(np.exp(abs(x[i] - s.mean[i])))
            way = "stiffer" if x[i] > s.mean[i] else "softer"
            place = s.parameters[i].name.removeprefix("stiffness of ")
            yield f"{place} would be {significant(times)} times {way} than robot.toml has it"


def _bodies(s: RobotStructure, x: np.ndarray, far: tuple[int, ...]) -> Iterator[str]:
    robot, bodies = s.prior.repertoire.simulation.robot, s.bodies
    links = [
        robot.link_of(b) if b in robot.joint_names else b.removesuffix(OUTER) for b in bodies.bodies
    ]
    own = [i - s.inertial.start for i in far if s.inertial.start <= i < s.inertial.stop]
    moved = np.any(bodies.change[:, own] != 0, axis=(1, 2))
    change = bodies.difference(x[s.inertial])[:, 0]
    for link in dict.fromkeys(link for link, far_off in zip(links, moved, strict=True) if far_off):
        parts = [k for k, name in enumerate(links) if name == link]
        mass, more = float(bodies.nominal[parts, 0].sum()), float(change[parts].sum())
        sd = float(np.linalg.norm(bodies.sigma[parts] * bodies.nominal[parts, 0]))
        if abs(more) > 2 * sd:
            yield (
                f"{link} would have to weigh {significant(mass + more)} kg, where "
                f"{significant(mass)} ± {significant(sd)} kg is stated"
            )
        else:
            yield f"{link} would need a centre or moments of inertia that are not those stated"
