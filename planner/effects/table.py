"""Everything that a robot's simulation may lack: all effects at all places, and all their springs.

Springs that robot.toml does not state are expected stiffer than those that are, by a factor that
nobody knows. The wider robot has them all, one after the other; a structure uses some of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from planner.dynamics.simulation import Simulation
from planner.effects.added_mass import AROUND, AddedMass
from planner.effects.chain import ChannelDelay, Polarity, SensorGain, SensorRotation
from planner.effects.effect import Number, Operator
from planner.effects.far_off import FarOffSpring
from planner.effects.foundation import Foundation
from planner.effects.links import PAIRS, BetweenLinks, GroundContact
from planner.effects.parameters import Priors, place_name
from planner.effects.resonator import LinkResonator, StatedResonator, resonator_numbers
from planner.effects.springs import (
    STIFFNESS,
    BendingLink,
    ShiftingBase,
    SlightBearing,
    SoftBase,
    Tilt,
)
from planner.effects.structural_damping import LossFactors
from planner.effects.varying_spring import HATS, AngleSpring, Drift, FrequencyDependentJoint
from planner.errors import InputError
from planner.robot.config import BASE, Compliance
from planner.robot.robot import Robot
from planner.robot.virtual_joints import massless_base

# Damping of what is not stated, in s of stiffness: 0.1 to 3 % of critical at 5 to 30 Hz; and its
# loss factor, from next to none on.
DAMPING_S, LOSS = (1e-4, 3e-3), (1e-3, 0.1)
ALONG = 0.5  # cosine above which a stated axis already covers this one
SHORT, BEND = 0.1, 0.3  # of the longest link: does not bend; of the joint's stiffness: a link's
ADDED_MASS, ADDED_PLACE = 0.22, 0.35  # sds: of the links' mean mass, of the longest link
# Of what moves with a base: median in the robot's mass and sd of its logarithm; sd of its place in
# the robot's reach.
FOUNDATION_MASS, FOUNDATION_MASS_SD, FOUNDATION_SIZE = 0.7, 1.1, 0.4
# Radius of gyration of an added mass: median, in its place's sd, and its logarithm's sd.
RADIUS, RADIUS_SD = 0.25, 0.7
RESONATOR_MASS, RESONATOR_DAMPING = 0.05, 0.03  # medians: of the links' mean mass; ratio
LOSS_FACTOR = 0.02  # median, with a factor of e as its sd
ANGLE_SHARE = 0.3  # sd of a joint's stiffness that goes with its angle
# Sds of what a diagnosis looks for: gain of a channel (logarithm), angles (rad), delay (s), far-off
# spring (logarithm), shares of stiffness that go with frequency and time.
GAIN, TURNED_RAD, DELAY_S, FAR_OFF, HAT, DRIFT = 0.5, 0.5, 5e-4, 1.2, 0.3, 0.2


@dataclass(frozen=True, eq=False)
class EffectLibrary:
    """`simulation` with every spring, the first `stated` of which robot.toml states, and effects.

    `stiff` is the stated simulation alone, with its own priors; of both the resonators that
    robot.toml states are apart, as effects that are `there`.
    """

    stiff: Simulation
    stiff_priors: Priors
    simulation: Simulation
    priors: Priors
    stated: int
    effects: tuple[Operator, ...]
    there: tuple[Operator, ...] = ()

    @classmethod
    def of(
        cls, simulation: Simulation, priors: Priors, further: Sequence[Operator] = ()
    ) -> "EffectLibrary":
        """Of a robot as robot.toml states it; `further` effects beside those of every campaign."""
        there = _stated_resonators(simulation.robot)
        if there:
            bare = msgspec.structs.replace(simulation.robot.config, resonator=())
            simulation = Simulation(replace(simulation.robot, config=bare))
        robot = simulation.robot
        config = msgspec.structs.replace(
            robot.config, payload=(*robot.config.payload, *massless_base(robot))
        )
        wider = replace(robot, config=config)
        bounds, found = dict(priors.bounds), []
        for kind, at, block, scale in _springs(wider):
            joined = _joined(wider, block)
            if joined is None:
                continue
            wider = joined
            bounds |= {} if block.lever_m else _bounds(block, scale)
            found.append((kind, at))
        stated, groups = len(config.compliance), {}
        for number, key in enumerate(found, stated):
            groups.setdefault(key, []).append(number)
        effects = [kind(at, tuple(numbers)) for (kind, at), numbers in groups.items()]
        widest = Simulation(wider)
        effects += [*_foundation(widest, effects), *_operators(simulation), *further]
        effects = list({e.label: e for e in effects}.values())  # of one place the last counts
        wide = replace(priors, bounds=bounds)
        return cls(simulation, priors, widest, wide, stated, tuple(effects), there)

    def as_built(self) -> tuple[Operator, ...]:
        """What every robot has: bearings that give slightly, and loss factors where none are."""
        bearings = [SlightBearing(e.at, e.springs) for e in self.effects if isinstance(e, Tilt)]
        losses = (e for e in self.effects if isinstance(e, LossFactors))
        return (*self.there, *bearings, *losses)

    def priors_with(self, bounds: Mapping[str, tuple[float, float]]) -> Priors:
        """What is known of a robot that has some of the springs."""
        return replace(self.priors, bounds=dict(bounds))


def _joined(robot: Robot, block: Compliance) -> Robot | None:
    """With one more spring; None where that moves no inertia of its own, as a base's on a rail."""
    config = robot.config
    there = config.compliance
    if place_name(block) in {place_name(one) for one in there}:
        return None
    if block.lever_m and block.tie not in {one.tie for one in there}:
        return None
    wider = msgspec.structs.replace(config, compliance=(*config.compliance, block))
    found = replace(robot, config=wider)
    try:
        Simulation(found)
    except InputError:
        return None
    return found


def _springs(robot: Robot) -> list[tuple[type[Operator], str, Compliance, float]]:
    """Kind and place of the effect that frees it, the spring, and its scale."""
    stated = [b for b in robot.config.compliance]
    turning = [b for b in stated if not robot.slides_along(b)]
    stiffest = max((b.stiffness for b in turning), default=max(robot.turning_stiffness()))
    names, found = list(robot.joint_names), []
    for joint in dict.fromkeys(b.joint for b in stated if b.joint in names):
        mine = [b for b in turning if b.joint == joint]
        scale = max((b.stiffness for b in mine), default=stiffest)
        for axis in np.eye(3):
            if not any(abs(float(axis @ np.array(b.axis))) > ALONG for b in mine):
                at = f"joint_{names.index(joint) + 1}"
                found.append((Tilt, at, _spring(joint, axis, scale), scale))
    ways = _links(robot)
    longest = max((float(np.linalg.norm(way)) for _, _, way in ways), default=0.0) or robot.reach_m
    if BASE not in names:
        covered = [np.array(b.axis) for b in turning if b.joint == BASE]
        for axis in np.eye(3):
            if not any(abs(float(axis @ there)) > ALONG for there in covered):
                kind = ShiftingBase if axis[2] else SoftBase
                found.append((kind, BASE, _spring(BASE, axis, stiffest), stiffest))
        shift = stiffest / (2 * longest) ** 2
        found += [(ShiftingBase, BASE, _spring(BASE, a, shift, True), shift) for a in np.eye(3)]
    for link, joint, way in ways:
        length = float(np.linalg.norm(way))
        if length > SHORT * longest:
            own = [b.stiffness for b in turning if b.joint == joint] or [stiffest]
            at, scale = f"link_{names.index(joint) + 1}", BEND * max(own)
            found += [(BendingLink, at, one, scale) for one in _beam(link, way, scale)]
    return found


def _beam(link: str, way: np.ndarray, scale: float) -> list[Compliance]:
    """Of a uniform beam along `way` (3,): how its middle turns, and gives across as it bends."""
    length, found = float(np.linalg.norm(way)), list[Compliance]()
    sides, lever = across(way / length), length / np.sqrt(12)
    for axis, other in zip(sides, sides[::-1], strict=True):
        turns, gives = _spring(link, axis, scale), _spring(link, other, scale)
        tied = place_name(turns)
        found.append(msgspec.structs.replace(turns, tie=tied))
        found.append(msgspec.structs.replace(gives, tie=tied, lever_m=float(lever)))
    return [*found, _spring(link, way / length, scale)]


def _links(robot: Robot) -> list[tuple[str, str, np.ndarray]]:
    """Links that carry a joint: name, the joint that moves it, and the way (3,) to the next."""
    found = []
    for joint in robot.joint_names:
        link = robot.link_of(joint)
        carried = robot.carries(link)
        if carried is not None and link not in robot.joint_names:
            way = np.array(robot.model.jointPlacements[carried[1]].translation)
            found.append((link, joint, way))
    return found


def _spring(joint: str, axis: np.ndarray, scale: float, slide: bool = False) -> Compliance:
    low, high = (scale * factor for factor in STIFFNESS)
    stiffness, damping = np.sqrt(low * high), np.sqrt(low * DAMPING_S[0] * high * DAMPING_S[1])
    x, y, z = map(float, axis)
    numbers = float(stiffness), float(damping), float(np.sqrt(LOSS[0] * LOSS[1]))
    return Compliance(joint, (x, y, z), *numbers, slide=slide)


def _bounds(block: Compliance, scale: float) -> dict[str, tuple[float, float]]:
    place, (low, high) = place_name(block), (scale * factor for factor in STIFFNESS)
    damping = low * DAMPING_S[0], high * DAMPING_S[1]
    return {
        f"stiffness of {place}": (low, high),
        f"damping of {place}": damping,
        f"loss_factor of {place}": LOSS,
    }


def across(axis: np.ndarray) -> np.ndarray:
    """(2, 3): two unit vectors normal to a unit vector (3,) and to each other."""
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(axis, first)])


def _operators(simulation: Simulation) -> list[Operator]:
    """Masses and resonators on every link, and springs that go with the angle."""
    robot, elastic = simulation.robot, simulation.elastic
    masses = [b[0] for b in elastic.inertia if b[0] > 0]
    mean, band = float(np.mean(masses)), robot.config.band_hz
    size = ADDED_PLACE * max(
        float(np.linalg.norm(p.translation)) for p in robot.model.jointPlacements
    )
    low, high = band
    found: list[Operator] = []
    for number, joint in enumerate(robot.joint_names, 1):
        if joint not in elastic.bodies:
            continue
        body = elastic.inertia[elastic.bodies.index(joint)]
        x, y, z = map(float, body[1:4] / body[0]) if body[0] > 0 else (0.0, 0.0, 0.0)
        centre = x, y, z
        at = f"link_{number}"
        mine = joint, centre, ADDED_MASS * mean, size
        found.append(AddedMass(at, (), _mass_numbers(size), *mine))
        middle = np.log([RESONATOR_MASS * mean, np.sqrt(low * high), RESONATOR_DAMPING])
        sds = 1.0, float(np.log(high / low)) / np.sqrt(12), 1.0, *(1.0,) * 3, *(size,) * 3
        numbers = resonator_numbers((*middle, *(0.0,) * 3, *centre), sds)
        found.append(LinkResonator(at, (), numbers, joint, band))
    if not any(b.loss_factor for b in robot.config.compliance):
        found.append(_structural(robot))
    found += [_angle_spring((1,), *one) for one in _own(robot)]
    return found


def _mass_numbers(size: float) -> tuple[Number, ...]:
    """Of an added mass whose place has the sd `size` in m."""
    places = tuple(Number(f"position_{a}", "1", 0.0, 1.0) for a in "xyz")
    width = float(np.log(RADIUS * size / np.sqrt(2)))
    spread = (Number(f"spread_{a}", "m", width, RADIUS_SD, True) for a in "xyz")
    skew = (Number(f"skew_{a}", "1", 0.0, 1.0) for a in ("yx", "zx", "zy"))
    return Number("mass", "1", 0.0, 1.0), *places, *spread, *skew


def _foundation(widest: Simulation, springs: Sequence[Operator]) -> list[Operator]:
    """Of a base that can give way; `springs` are the effects that only free some."""
    mine = tuple(i for e in springs if e.at == BASE for i in e.springs)
    if len(mine) < 6:
        return []
    usual = FOUNDATION_MASS * sum(float(b[0]) for b in widest.elastic.inertia)
    size = FOUNDATION_SIZE * widest.robot.reach_m
    _, *placed = _mass_numbers(size)
    mass = Number("mass", "kg", float(np.log(usual)), FOUNDATION_MASS_SD, True)
    numbers = mass, *placed, Number("height", "m", 0.0, size)
    return [Foundation(BASE, mine, numbers, BASE, (0.0, 0.0, 0.0), 1.0, size)]


def _stated_resonators(robot: Robot) -> tuple[Operator, ...]:
    found: list[Operator] = []
    for block in robot.config.resonator:
        at = f"link_{robot.joint_names.index(block.joint) + 1}"
        again = sum(e.at.split("#")[0] == at for e in found)
        found.append(StatedResonator.of(f"{at}#{again + 1}" if again else at, block))
    return tuple(found)


def _own(robot: Robot) -> list[tuple[int, int, Compliance]]:
    """Springs of joints about their own axis: the joint's number, the spring's, and it."""
    return [
        (robot.joint_names.index(b.joint), n, b)
        for n, b in enumerate(robot.config.compliance)
        if robot.is_own(b) and not robot.slides_along(b)
    ]


def _angle_spring(
    orders: tuple[int, ...], number: int, spring: int, block: Compliance
) -> AngleSpring:
    waves = tuple(f"{f}_{n}" for n in orders for f in ("cosine", "sine"))
    shares = tuple(Number(name, "1", 0.0, ANGLE_SHARE) for name in waves)
    at, mine = f"joint_{number + 1}", ((spring,), (block.stiffness,))
    return AngleSpring(at, (), shares, *mine, block.joint, number, orders)


def diagnosed(simulation: Simulation) -> list[Operator]:
    """What only a diagnosis looks for: the chain, time, and what has no name of its own."""
    robot, elastic = simulation.robot, simulation.elastic
    gain, turn = Number("gain", "1", 0.0, GAIN, True), "xyz"
    angles = tuple(Number(f"angle_{a}", "rad", 0.0, TURNED_RAD) for a in turn)
    found: list[Operator] = [SensorGain(f"sensor_{a}", (), (gain,)) for a in turn]
    found += [Polarity(f"sensor_{a}") for a in turn]
    found.append(SensorRotation("sensor", (), angles))
    found.append(ChannelDelay("sensor", (), (Number("delay", "s", 0.0, DELAY_S),)))
    masses = (e for e in _operators(simulation) if isinstance(e, AddedMass))
    found += [replace(e, places=AROUND) for e in masses]
    own = _own(robot)
    found += [_angle_spring((1, 2), *one) for one in own]
    for number, spring, block in own:
        at, mine = f"joint_{number + 1}", ((spring,), (block.stiffness,))
        found.append(FarOffSpring(at, (), (), spring, FAR_OFF, place_name(block)))
        hats = tuple(
            Number(f"{w}_{k}", "1", 0.0, HAT) for w in ("real", "loss") for k in range(HATS)
        )
        found.append(FrequencyDependentJoint(at, (), hats, *mine, robot.config.band_hz))
    if own:
        changes = tuple(Number(f"change of joint_{n + 1}", "1", 0.0, DRIFT) for n, _, _ in own)
        springs = tuple(i for _, i, _ in own), tuple(b.stiffness for _, _, b in own)
        found.append(Drift("campaign", (), changes, *springs))
    size = max(float(np.linalg.norm(p.translation)) for p in robot.model.jointPlacements)
    scale = float(np.median([b.stiffness for _, _, b in own])) / size**2 if own else 0.0
    numbers = tuple(Number(f"stiffness_{i}{k}", "1", 0.0, 1.0) for i, k in PAIRS)
    links = [(n, j) for n, j in enumerate(robot.joint_names, 1) if j in elastic.bodies]
    for number, joint in links if own else ():
        body = elastic.inertia[elastic.bodies.index(joint)]
        x, y, z = map(float, body[1:4] / body[0]) if body[0] > 0 else (0.0, 0.0, 0.0)
        if number > 1:
            found.append(GroundContact(f"link_{number}", (), numbers, joint, "", (x, y, z), scale))
        for inner, other in links:
            if inner < number - 1:
                at = f"link_{inner}-link_{number}"
                found.append(BetweenLinks(at, (), numbers, joint, other, (0.0, 0.0, 0.0), scale))
    return found


def _structural(robot: Robot) -> Operator:
    groups: dict[str, list[int]] = {}
    for number, block in enumerate(robot.config.compliance):
        groups.setdefault(block.tie or f"\0{number}", []).append(number)
    blocks = tuple(tuple(group) for group in groups.values())
    firsts = [robot.config.compliance[group[0]] for group in blocks]
    median = float(np.log(LOSS_FACTOR))
    numbers = tuple(
        Number(f"loss_factor of {b.tie or place_name(b)}", "1", median, 1.0, True) for b in firsts
    )
    stiffness = tuple(b.stiffness for b in firsts)
    return LossFactors("joints", (), numbers, blocks, stiffness)
