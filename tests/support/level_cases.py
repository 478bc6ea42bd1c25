"""Robots hit at several force levels by a hand that misses, by another engine: linear or not."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from planner.dataset.dataset import Dataset, Visit
from planner.dynamics.simulation import Simulation
from planner.recording.records import Hit
from planner.robot.robot import Robot
from planner.truth.arms import ARMS
from planner.truth.cases import DAMPING_S, PEAK_N
from planner.truth.deviation import Deviation
from planner.truth.effects import LINEAR
from planner.truth.handling import EVERYDAY, Handling, together
from planner.truth.hits import AXES, OVERSAMPLING, Hammer, pulse
from planner.truth.laws import Elastic, Friction, JointLaw
from planner.truth.load import load_truth
from planner.truth.model import Truth
from planner.truth.nonlinear import Port, StruckPose, _linear
from planner.truth.propagate import driven
from planner.truth.scene import Scene
from planner.truth.secret import HitVisit, Secret, StiffnessDrift, hit_poses
from tests.support.wrenches import along

SCATTER = Deviation(stiffness=0.15, damping=0.15, inertia=0.04, com_m=0.005)  # as stated ones do

HAND = replace(EVERYDAY, angle_deg=2.0, offset_m=0.005)


@dataclass(frozen=True)
class Cubic(Elastic):
    """τ = k₃ θ³; `farthest` (rad) bounds its slope, and beyond it the torque goes on straight."""

    cubic: float
    farthest: float

    def slope(self, step_s: float) -> float:
        return 3 * abs(self.cubic) * self.farthest**2

    def at(self, angle: np.ndarray) -> np.ndarray:
        near = np.clip(angle, -self.farthest, self.farthest)
        return self.cubic * (near**3 + 3 * self.farthest**2 * (angle - near))


@dataclass(frozen=True)
class Protocol:
    """How a robot is hit: peaks relative to its usual one, and how often at each, along which axes.

    `softer` makes pulses longer at weak levels (a soft tip): their duration goes as
    level^(−softer). `scatter` is that of peaks beside what `pulse` scatters by itself.
    """

    levels: tuple[float, ...] = (0.4, 1.0, 2.5)
    repeats: int = 2
    axes: str = "xyz"
    poses: int = 5
    softer: float = 0.0
    scatter: float = 0.0
    noise: float = 0.01
    handling: Handling = field(default_factory=lambda: HAND)
    returned: bool = False  # whether the first pose is hit again at the end
    by_level: bool = False  # whether all hits of an axis and level at a pose miss alike


@dataclass(frozen=True, eq=False)
class LevelCase:
    """A robot's folder as it is stated, and its hits; `joint` bends, "" if none."""

    simulation: Simulation
    recorded: Dataset
    robot: str
    joint: str


def made(
    seed: int,
    folder: Path,
    how: Protocol | None = None,
    hardening: float = 0.0,
    friction: float = 0.0,
    lacking: str = "",
    drift: float = 0.0,
    robot: str = "",
    joint: str = "",
) -> LevelCase:
    """A case; `hardening`: k₃θ² over k at the largest angle of the strongest hits.

    `friction`: presliding stiffness over k, that has slid through at a third of the angle of
    middling hits. `lacking` is an effect of `truth.effects.LINEAR` that the folder knows
    nothing of; `drift` the relative change of all stiffnesses in the course of the visits.
    """
    how, rng = how or Protocol(), np.random.default_rng([seed, 24])
    robot = robot or str(rng.choice(sorted(ARMS)))
    joint = joint or f"joint_{rng.integers(1, 6)}"
    arm = replace(ARMS[robot], damping_s=DAMPING_S)
    per_joint = int(rng.choice([1, 3]))
    toml = arm.write(folder / f"{robot}-{seed}", per_joint)
    plain = Secret(replace(SCATTER, seed=int(rng.integers(2**31))))
    truth = load_truth(toml, plain.deviation)
    low, high = np.deg2rad(np.array(arm.joints_deg)).T
    poses = rng.uniform(low, high, (how.poses, 6))
    hammer = Hammer(PEAK_N[robot], 0.008, noise=how.noise)
    if lacking:
        scene = Scene(arm, truth, per_joint, poses, hammer.peak_n)
        plain = LINEAR[lacking](scene, plain, rng).secret
        truth = load_truth(toml, plain.deviation)
    ports: tuple[Port, ...] = ()
    if hardening or friction:
        k = float(truth.own(joint) @ [spring.stiffness for spring in truth.springs])
        top = _angle(truth, poses, joint, how, hammer)
        ports = (Port(_law(k, top, hardening, friction, how), joint=joint),)
    secret = Secret(truth.deviation, ports, chain=how.handling.chain(rng))
    if drift:
        secret = replace(secret, drift=StiffnessDrift(drift, "warming"))
    visits = _hit(truth, secret, poses, how, hammer, rng)
    simulation = Simulation(Robot.load(toml))
    recorded = Dataset.of_visits(visits, simulation.robot.config.band_hz)
    return LevelCase(simulation, recorded, robot, joint if ports else "")


def _law(k: float, top: float, hardening: float, friction: float, how: Protocol) -> JointLaw:
    if friction:
        return Friction(friction * k, friction * k * top / max(how.levels) / 3)
    return Cubic(hardening * k / top**2, 1.5 * top)


def _angle(truth: Truth, poses: np.ndarray, joint: str, how: Protocol, hammer: Hammer) -> float:
    """Largest elastic angle (rad) of a linear joint under the strongest hits."""
    rng = np.random.default_rng(0)
    strong = replace(hammer, peak_n=hammer.peak_n * max(how.levels))
    force = np.array([pulse(strong, rng) for _ in how.axes])
    axes, step_s = [AXES.index(a) for a in how.axes], 1 / (hammer.sampling_rate_hz * OVERSAMPLING)
    port = Port(Cubic(0.0, 1.0), joint=joint)
    swings = []
    for q in poses:
        linear = _linear(StruckPose(truth, q, force, along(axes)), (port,))
        moved = np.array([driven(pole, linear.forces, step_s) for pole in linear.poles])
        angles = linear.outputs[0] @ (moved * linear.driven[:, :, None]).reshape(len(moved), -1)
        swings.append(np.abs(angles.real).max())
    return float(np.max(swings))


def _hit(
    truth: Truth,
    secret: Secret,
    poses: np.ndarray,
    how: Protocol,
    hammer: Hammer,
    rng: np.random.Generator,
) -> tuple[Visit, ...]:
    common = how.handling.common(rng)
    order = [*range(len(poses)), *([0] if how.returned else [])]
    there = [
        poses[i] + np.deg2rad(how.handling.readback_deg) * rng.standard_normal(6) for i in order
    ]
    hits: list[list[Hit]] = [[] for _ in order]
    for levels in [how.levels] if not how.softer else [(level,) for level in how.levels]:
        planned = []
        for number, q in enumerate(there):
            shots = [
                (f"+{a}", hammer.peak_n * level * (1 + how.scatter * rng.uniform(-1, 1)))
                for level in levels
                for _ in range(how.repeats)
                for a in how.axes
            ]
            axes = [AXES.index(axis[1]) for axis, _ in shots]
            own = how.handling.aims(axes, rng)
            if how.by_level:
                own = [
                    own[i - i // n % how.repeats * n]
                    for n in [len(how.axes)]
                    for i in range(len(own))
                ]
            aims = [together(common[a], aim) for a, aim in zip(axes, own, strict=True)]
            planned.append(HitVisit(q, shots, number / max(len(order) - 1, 1), aims))
        tip = replace(hammer, duration_s=hammer.duration_s * levels[0] ** -how.softer)
        for into, found in zip(hits, hit_poses(truth, secret, planned, tip, rng), strict=True):
            into += [
                Hit(
                    Path("hit"), h.axis, hammer.sampling_rate_hz, h.force_n, h.acceleration_m_s2,
                    simulated=True,
                )
                for h in found
            ]  # fmt: skip
    return tuple(
        Visit(f"P{i + 1}", poses[i], number / max(len(order) - 1, 1), tuple(own))
        for number, (i, own) in enumerate(zip(order, hits, strict=True))
    )
