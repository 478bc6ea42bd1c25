"""Springs and bodies that a fit moved far from what robot.toml states: something is missing."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from planner.fit.posterior import RobotBelief
from planner.fit.structure import RobotStructure
from planner.robot.virtual_joints import OUTER
from planner.words import significant

DEPARTED = 4.0  # prior sds
TOLD = 3  # at most
HALVED = 0.5  # sd of a mass that the recordings tell, in sds of what is stated: as for springs
KNOWN = 0.3  # sd of ln k to which a stiffness is known when a word is said of it


def sds_off(structure: RobotStructure, x: np.ndarray) -> np.ndarray:
    """(D,) by how many prior sds stiffnesses and bodies are off what is stated; 0 of all else."""
    out = np.zeros(len(x))
    for own in (slice(0, structure.stiffnesses), structure.inertial):
        out[own] = (x[own] - structure.mean[own]) / structure.sd[own]
    return out


def departed(structure: RobotStructure, x: np.ndarray) -> tuple[int, ...]:
    """Numbers of x that are far from what is stated."""
    return tuple(map(int, np.flatnonzero(np.abs(sds_off(structure, x)) > DEPARTED)))


def departures_text(structure: RobotStructure, x: np.ndarray, sd: np.ndarray) -> str:
    """What robot.toml may state wrongly; empty where all is near it, or not known to be far.

    `sd` (D,) of x: a spring that is stiffer than the recordings can tell is no fault.
    """
    far = departed(structure, x)
    known = tuple(i for i in far if i >= structure.stiffnesses or sd[i] < KNOWN)
    told = [*_bodies(structure, x, far), *_springs(structure, x, known)]
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


@dataclass(frozen=True)
class RefittedMass:
    """A link with what is mounted on it: kg as stated, how many more by a fit, and their sd."""

    link: str
    stated_kg: float
    more_kg: float
    sd_kg: float

    @property
    def text(self) -> str:
        """Such as "link_6 60 kg where 52 ± 4.1 kg is stated"."""
        whole, stated = significant(self.stated_kg + self.more_kg), significant(self.stated_kg)
        return f"{self.link} {whole} kg where {stated} ± {significant(self.sd_kg)} kg is stated"


def refitted_masses(s: RobotStructure, x: np.ndarray) -> list[RefittedMass]:
    """Of all links, in their order."""
    bodies, links = s.bodies, _links(s)
    change, found = bodies.difference(x[s.inertial])[:, 0], []
    for link in dict.fromkeys(links):
        parts = [k for k, name in enumerate(links) if name == link]
        mass, more = float(bodies.nominal[parts, 0].sum()), float(change[parts].sum())
        sd = float(np.linalg.norm(bodies.sigma[parts] * bodies.nominal[parts, 0]))
        found.append(RefittedMass(link, mass, more, sd))
    return found


def known_masses(belief: RobotBelief) -> list[tuple[RefittedMass, float]]:
    """Those whose sd the recordings halve, or more, and what they leave of it in kg."""
    s, numbers = belief.structure, belief.structure.inertial
    bodies, links, slopes = s.bodies, np.array(_links(s)), s.bodies.slopes(belief.x[numbers])
    told = []
    for mass in refitted_masses(s, belief.x):
        by_number = np.zeros(bodies.size)
        for k in np.flatnonzero(links == mass.link):
            by_number[bodies.mine[k]] += slopes[k][:, 0]
        left = float(np.sqrt(by_number @ belief.covariance[numbers, numbers] @ by_number))
        if left < HALVED * mass.sd_kg:
            told.append((mass, left))
    return told


def _links(s: RobotStructure) -> list[str]:
    """Of each body."""
    robot = s.prior.effect_library.simulation.robot
    return [
        robot.link_of(b) if b in robot.joint_names else b.removesuffix(OUTER)
        for b in s.bodies.bodies
    ]


def masses_text(structure: RobotStructure, x: np.ndarray) -> str:
    """Which masses a fit moved by more than their sd; empty where there are none."""
    moved = [m for m in refitted_masses(structure, x) if abs(m.more_kg) > m.sd_kg > 0]
    told = sorted(moved, key=lambda m: -abs(m.more_kg) / m.sd_kg)[:TOLD]
    if not told:
        return ""
    # Cables and covers that are gone make a link lighter, a tool that nobody stated heavier.
    more = any(m.more_kg > 0 for m in told)
    ask = "mounted there that robot.toml lacks" if more else "gone that robot.toml still has"
    return (
        f"The refit changed masses (each link with what is mounted on it): "
        f"{'; '.join(m.text for m in told)}. State what you know better ([[link]], [[payload]]); "
        f"is something {ask}?"
    )


def _bodies(s: RobotStructure, x: np.ndarray, far: tuple[int, ...]) -> Iterator[str]:
    bodies = s.bodies
    own = [i - s.inertial.start for i in far if s.inertial.start <= i < s.inertial.stop]
    moved = np.any(bodies.change[:, own] != 0, axis=(1, 2))
    far_off = {link for link, is_far in zip(_links(s), moved, strict=True) if is_far}
    for m in refitted_masses(s, x):
        if m.link not in far_off:
            continue
        if abs(m.more_kg) > 2 * m.sd_kg:
            yield (
                f"{m.link} would have to weigh {significant(m.stated_kg + m.more_kg)} kg, where "
                f"{significant(m.stated_kg)} ± {significant(m.sd_kg)} kg is stated"
            )
        else:
            yield f"{m.link} would need a centre or moments of inertia that are not those stated"
