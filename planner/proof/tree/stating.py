"""Springs of the stated robot, poses, and how the true robot differs from what is stated."""

from dataclasses import dataclass, replace

import numpy as np

from planner.proof.tree.blueprint import Bend, Blueprint, assemble, link_way
from planner.proof.tree.laws import Spring
from planner.proof.tree.layouts import DEG, LAYOUTS, Robot, draw_layout
from planner.proof.tree.spatial import across, random_turn
from planner.proof.tree.tree import Body

LADDER_HZ = ((7, 17), (8, 19), (13, 30), (20, 55), (30, 70), (35, 85))  # of single joints


def draw_robot(rng: np.random.Generator, kind: str) -> Robot:
    """A stated robot whose first mode is at 5 to 15 Hz, with 4 to 6 modes below 90 Hz."""
    with_cross = bool(rng.integers(2))
    for _ in range(400):
        robot = _with_springs(rng, draw_layout(rng, kind), with_cross)
        first, count = [], []
        for q in draw_poses(rng, robot, 5):
            frequencies, _ = assemble(stated(robot), q)[0].modes()
            first.append(frequencies[0])
            count.append(np.sum(frequencies < robot.band[1]))
        if np.min(first) > 5 and np.max(first) < 15 and 4 <= np.median(count) <= 6:
            return robot
    raise RuntimeError(f"no {kind} with modes where they are wanted")


def _with_springs(rng: np.random.Generator, robot: Robot, with_cross: bool) -> Robot:
    """Gear springs after the inertia that each joint carries; dampers of 1 to 3 %."""
    soft = tuple(Spring(1.0) for _ in robot.joints)
    bare = stated(replace(robot, gears=soft, cross={}))
    carried = np.mean(
        [np.diag(assemble(bare, q)[0].mass) for q in draw_poses(rng, robot, 4)], axis=0
    )
    gears = []
    for inertia, (low, high) in zip(carried, LADDER_HZ, strict=False):
        omega = 2 * np.pi * rng.uniform(low, high)
        stiffness = inertia * omega**2
        gears.append(
            Spring(float(stiffness), float(2 * rng.uniform(0.01, 0.03) * stiffness / omega))
        )
    cross = {}
    for j in (0, 1) if with_cross else ():
        springs = [gears[j].times(rng.uniform(2, 8)) for _ in range(2)]
        springs = [replace(s, damping=s.damping * rng.uniform(1, 4)) for s in springs]
        cross[j] = tuple(zip(across(robot.joints[j].axis), springs, strict=True))
    return replace(robot, gears=tuple(gears), cross=cross)


def stated(robot: Robot) -> Blueprint:
    """What the files say, as an elastic robot."""
    cross = robot.cross or {}
    return Blueprint(
        robot, list(robot.gears), [list(cross.get(j, ())) for j in range(len(robot.joints))]
    )


def draw_poses(rng: np.random.Generator, robot: Robot, count: int) -> np.ndarray:
    """Joint angles (rad), the tool off the floor and away from the column."""
    _, _, centre = LAYOUTS[robot.kind]
    low = np.array([j.lower for j in robot.joints])
    high = np.array([j.upper for j in robot.joints])
    middle, half = np.array(centre) * DEG, (high - low) / 2 - 12 * DEG
    plan = Blueprint(robot, [Spring(1.0)] * len(low), [[] for _ in low])
    poses = []
    for _ in range(3000):
        q = middle + half * rng.uniform(-1, 1, len(low))
        _, tree = assemble(plan, q)
        tip = tree.at(len(tree.nodes) - 1, robot.tool[1])
        if tip[2] > 0.1 * robot.reach and np.hypot(*tip[:2]) > 0.35 * robot.reach:
            poses.append(q)
        if len(poses) == count:
            return np.array(poses)
    raise RuntimeError("no poses")


@dataclass(frozen=True)
class Truth:
    """The true robot: its bodies, springs, and small imperfections."""

    robot: Robot
    gears: tuple[Spring, ...]
    bearings: tuple[tuple[tuple[np.ndarray, Spring], ...], ...]
    bends: dict[int, Bend]
    ripple: np.ndarray  # (joints, 3): share, periods a turn, phase (rad)

    def plan(self, q: np.ndarray) -> Blueprint:
        """Elastic robot at angles q, before any effect."""
        share, periods, phase = self.ripple.T
        factor = 1 + share * np.cos(periods * q + phase)
        gears = [g.times(f) for g, f in zip(self.gears, factor, strict=True)]
        bearings = [list(b) for b in self.bearings]
        return Blueprint(self.robot, gears, bearings, dict(self.bends))


def draw_truth(rng: np.random.Generator, robot: Robot) -> Truth:
    """Stiffness off log-normally, dampers by factors and partly hysteretic, inertia by 3 to 8 %."""
    sd, common = rng.uniform(0.10, 0.25), np.exp(rng.normal() * 0.1)
    gears = [_off(rng, g, sd, common) for g in robot.gears]
    bearings = []
    for j, joint in enumerate(robot.joints):
        listed = (robot.cross or {}).get(j, ())
        if listed:
            bearings.append(tuple((axis, _off(rng, s, sd, common)) for axis, s in listed))
            continue
        slight = [_stiff(rng, gears[j], 100, 400) for _ in range(2)]
        bearings.append(tuple(zip(across(joint.axis), slight, strict=True)))
    lengths = [float(np.linalg.norm(link_way(robot, i))) for i in range(len(robot.joints))]
    bends = {}
    for link in np.argsort(lengths)[-2:]:
        bends[int(link)] = Bend(1, tuple(_stiff(rng, gears[link], 200, 600) for _ in range(2)))
    inertia_sd = rng.uniform(0.03, 0.08)
    links = tuple(
        _off_body(rng, body, inertia_sd, length)
        for body, length in zip(robot.links, lengths, strict=True)
    )
    ripple = np.column_stack([
        rng.uniform(0, 0.003, len(gears)), rng.integers(1, 8, len(gears)),
        rng.uniform(0, 6, len(gears)),
    ])  # fmt: skip
    return Truth(replace(robot, links=links), tuple(gears), tuple(bearings), bends, ripple)


def _off(rng: np.random.Generator, spring: Spring, sd: float, common: float) -> Spring:
    """A stated spring as it truly is; part of the damping becomes a loss factor."""
    stiffness = spring.stiffness * common * np.exp(sd * rng.normal())
    damping = spring.damping * np.exp(rng.uniform(np.log(0.5), np.log(2)))
    share = rng.uniform(0, 1)
    loss = share * damping / stiffness * 2 * np.pi * 15  # as at 15 Hz
    return Spring(float(stiffness), float((1 - share) * damping), float(min(loss, 0.08)))


def _stiff(rng: np.random.Generator, gear: Spring, low: float, high: float) -> Spring:
    """A slight softness: `low` to `high` times the gear's stiffness, 1 % of it damping at 50 Hz."""
    stiffness = gear.stiffness * np.exp(rng.uniform(np.log(low), np.log(high)))
    return Spring(float(stiffness), float(0.02 * stiffness / (2 * np.pi * 50)))


def _off_body(rng: np.random.Generator, body: Body, sd: float, length: float) -> Body:
    """Mass, centre (in units of the link's length) and second moment off by about `sd`."""
    mass = body.mass * (1 + sd * rng.normal())
    centre = body.centre + 0.5 * sd * length * rng.normal(size=3)
    skew = random_turn(rng, 0.5 * sd * abs(rng.normal()))
    stretch = skew @ np.diag(1 + 0.5 * sd * rng.normal(size=3))
    return Body(float(mass), centre, stretch @ body.second @ stretch.T * mass / body.mass)
