"""Robots of another engine that lack several things at once, hit as people hit; FRFs and truth."""

import shutil
import zlib
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from planner.dataset.measure import MeasuredPose
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import CAD_INERTIAS
from planner.effects.table import EffectLibrary
from planner.fit.posterior import RobotPosterior
from planner.fit.search import Search
from planner.fit.structure import RobotPrior
from planner.frf import metrics
from planner.frf.frf import Frf
from planner.measurement.nuisances import Tolerances
from planner.proof import descriptions
from planner.proof.deviation import AttachedMass, Spring
from planner.proof.fault_injection import InjectedFaults, LoadChange
from planner.proof.load import load_truth
from planner.proof.measurement_errors import EVERYDAY, MeasurementErrors
from planner.proof.model import Truth
from planner.proof.scene import deviate, log_uniform, some_direction, triple
from planner.robot.robot import Robot
from tests.support.faulty_robots import (
    ARMS,
    added,
    links_moved,
    mass_that_moves,
    scattered,
    urdf_of,
)
from tests.support.faulty_robots import Robot as Arm
from tests.support.struck_poses import struck_poses
from tests.support.true_modes import true_modes

POSES, UNSEEN, LINES = 6, 8, 300
ROUGH = replace(EVERYDAY, angle_deg=3.0, offset_m=0.005)
HEAVIER = 0.02  # share of what moves that another tool weighs more
COUNTED = 4  # natural frequencies that are compared, the lowest that hits show


@dataclass(frozen=True)
class VisitScatter:
    """Every spring's stiffness and damping times a factor of its own at each visit."""

    sd: float
    seed: int

    def applied(self, truth: Truth, progress: float) -> Truth:
        """The robot at a time of the campaign."""
        rng = np.random.default_rng([self.seed, round(1e6 * progress)])
        factors = np.exp(self.sd * rng.standard_normal(len(truth.springs)))
        return truth.changed(factors, factors)


@dataclass(frozen=True, eq=False)
class Case:
    """FRFs at q (n, dof) in rad of a robot, and its true FRFs and modes at others, unseen."""

    toml: Path
    band_hz: tuple[float, float]
    q: np.ndarray
    frfs: tuple[Frf, ...]
    unseen: np.ndarray
    lines_hz: np.ndarray
    true_frf: np.ndarray
    true_hz: tuple[np.ndarray, ...]
    concealed: tuple[str, ...]
    measured: tuple[MeasuredPose, ...]
    truth: Truth
    box_rad: np.ndarray  # (2, dof)
    tool_kg: float  # of a tool that robot.toml lacks
    struck: Callable[[LoadChange | None], tuple[MeasuredPose, ...]]  # again, with another load

    @cached_property
    def heavier(self) -> tuple[MeasuredPose, ...]:
        """The same hits with a tool that is heavier by HEAVIER of all that moves."""
        _, root = urdf_of(self.toml)
        flange = list(links_moved(root, self.truth.joint_names).values())[-1]
        [link] = [e for e in root.findall("link") if e.get("name") == flange]
        mass = sum(float(m.get("value", 0)) for m in link.iterfind("inertial/mass"))
        more = HEAVIER * mass_that_moves(root) / mass
        return self.struck(LoadChange(flange, 1 + more, 0.0))

    def posterior(self) -> RobotPosterior:
        """What a fit makes of it."""
        simulation = Simulation(Robot.load(self.toml))
        tolerances = Tolerances.of(simulation.robot.config, simulation.robot.joints.slides)
        prior = RobotPrior(EffectLibrary.of(simulation, CAD_INERTIAS))
        return RobotPosterior.of(Search(prior, self.frfs, self.q, self.band_hz, tolerances).found())


def one_thing(name: str, kind: str, seed: int, folder: Path) -> Case:
    """One of `faulty_robots.KINDS`, large."""
    rng, arm = drawn_arm(name, seed, folder)
    injected = scattered(rng)
    injected = added(injected, kind, 1.0, arm, rng)
    return _measured(arm, injected, (kind,), EVERYDAY, rng)


def everyday(name: str, seed: int, folder: Path) -> Case:
    """A soft base, a link that bends and a hose at once, each of a size of its own."""
    rng, arm = drawn_arm(name, seed, folder)
    injected = scattered(rng)
    kinds = "soft base", "bending link", "hose"
    for kind in kinds:
        injected = added(injected, kind, log_uniform(rng, 0.2, 1.0), arm, rng)
    return _measured(arm, injected, kinds, EVERYDAY, rng)


def harder(name: str, seed: int, folder: Path) -> Case:
    """A soft floor, two bearings and a hose, a spindle 3 % heavier, springs that scatter by 0.5 %
    from visit to visit, hits 3° and 5 mm off."""
    rng, arm = drawn_arm(name, seed, folder)
    injected = scattered(rng)
    for kind in ("soft base", "hose"):
        injected = added(injected, kind, log_uniform(rng, 0.5, 1.0), arm, rng)
    truth = load_truth(arm.toml, injected.deviation)
    concealed = ("soft base", "bearings", "hose")
    free = _bearings(truth)
    if len(free) < 2:  # robot.toml states them all
        injected = added(injected, "bending link", 1.0, arm, rng)
        concealed = "soft base", "bending link", "hose"
    for joint, axis, own in (free[i] for i in rng.permutation(len(free))[:2]):
        k = 6 * own * log_uniform(rng, 0.5, 2.0)
        injected = deviate(injected, extra=[Spring(joint, triple(axis), k, 4e-4 * k)])
    injected = replace(injected, drift=VisitScatter(0.005, int(rng.integers(2**31))))
    return _measured(arm, injected, concealed, ROUGH, rng)


def forgotten(name: str, seed: int, folder: Path) -> Case:
    """A tool that robot.toml lacks, 2 to 20 % of what moves, three masses on a rod at the flange;
    every other robot stands on a soft base."""
    rng, arm = drawn_arm(name, seed, folder)
    injected = scattered(rng)
    _, root = urdf_of(arm.toml)
    truth = load_truth(arm.toml, injected.deviation)
    flange = list(links_moved(root, truth.joint_names).values())[-1]
    kg = mass_that_moves(root) * log_uniform(rng, 0.02, 0.2)
    middle = some_direction(rng) * rng.uniform(0.02, 0.25)
    rod = some_direction(rng) * log_uniform(rng, 0.05, 0.25)
    tool = [
        AttachedMass(flange, triple(middle + at * rod), kg * share)
        for at, share in zip((-1, 0, 1), rng.dirichlet([4.0, 4.0, 4.0]), strict=True)
    ]
    injected, concealed = deviate(injected, added=tool), ("tool",)
    if rng.random() < 0.5:
        injected = added(injected, "soft base", log_uniform(rng, 0.2, 1.0), arm, rng)
        concealed = "tool", "soft base"
    return _measured(arm, injected, concealed, EVERYDAY, rng)


@dataclass(frozen=True)
class Block:
    """What a robot stands on: `mass_kg`, a cube of `side_m`, on springs under its lower face."""

    mass_kg: float
    side_m: float


def on_a_block(name: str, seed: int, folder: Path) -> tuple[Case, Block]:
    """On a block or pedestal of 0.2 to 3 times what moves, which rocks and shifts about its foot at
    half to twice the robot's first frequency; a link bends, too."""
    rng, arm = drawn_arm(name, seed, folder)
    injected = scattered(rng)
    injected = added(injected, "bending link", log_uniform(rng, 0.5, 1.0), arm, rng)
    path, root = urdf_of(arm.toml)
    moving = mass_that_moves(root)
    block = Block(moving * log_uniform(rng, 0.2, 3.0), float(rng.uniform(0.3, 1.0)))
    shutil.copytree(arm.toml.parent, folder / "stands")
    _stand(root, block)
    ElementTree.ElementTree(root).write(folder / "stands" / path.name)
    stands = folder / "stands" / arm.toml.name
    truth = load_truth(stands, injected.deviation)
    middle = np.mean([truth.lower_rad, truth.upper_rad], axis=0)
    turn = 2 * np.pi * float(truth.modes(middle, 1)[0][0]) * log_uniform(rng, 0.8, 2.0)
    mass = moving + block.mass_kg
    arm_m = block.side_m + 0.3 * float(truth.position(middle)[2])  # of the centre over the foot
    springs = []
    for axis in np.eye(3):
        shift, tilt = mass * turn**2 * rng.uniform(1, 3), mass * (arm_m * turn) ** 2 * 2
        tilt *= log_uniform(rng, 0.7, 1.4)
        springs += [Spring("base", triple(axis), k, 8e-4 * k, slide) for k, slide in
                    ((tilt, False), (shift, True))]  # fmt: skip
    injected = deviate(injected, extra=springs)
    return _measured(arm, injected, ("foundation", "bending link"), EVERYDAY, rng, stands), block


def _stand(root: ElementTree.Element, block: Block) -> None:
    """Put a robot's URDF on a block whose lower face is the world's floor."""
    carried = {child.get("link") for child in root.iterfind("joint/child")}
    [base] = [e.get("name") for e in root.findall("link") if e.get("name") not in carried]
    side, moments = block.side_m, (block.mass_kg * block.side_m**2 / 6,) * 3
    inertial = descriptions.inertial(block.mass_kg, (0, 0, side / 2), moments)
    root.insert(0, ElementTree.fromstring(descriptions.link("foot", inertial)))
    root.append(ElementTree.fromstring(descriptions.fixed(str(base), "foot", (0, 0, side))))


def _bearings(truth: Truth) -> list[tuple[str, np.ndarray, float]]:
    """Joints 2 to 4, axes about which nothing gives yet, and the stiffness about their own."""
    found = []
    for joint in truth.joint_names[1:4]:
        axes = np.array([s.axis for s in truth.springs if s.joint == joint])
        free = [a for a in np.eye(3) if np.all(np.abs(axes @ a) < 0.5)]
        found += [(joint, axis, truth.stiffness(joint)) for axis in free]
    return found


def drawn_arm(name: str, seed: int, folder: Path) -> tuple[np.random.Generator, Arm]:
    rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
    folder.mkdir(parents=True, exist_ok=True)
    return rng, ARMS[name](folder, rng)


def _measured(
    arm: Arm, injected: InjectedFaults, concealed: tuple[str, ...], errors: MeasurementErrors,
    rng: np.random.Generator, true_toml: Path | None = None,
) -> Case:  # fmt: skip
    truth = load_truth(true_toml or arm.toml, injected.deviation)
    simulation = Simulation(Robot.load(arm.toml))
    low, high = limits(arm, simulation)
    q = rng.uniform(low, high, (POSES, len(low)))
    unseen = rng.uniform(low, high, (UNSEEN, len(low)))
    hammer = replace(arm.hammer, noise=float(rng.uniform(0.005, 0.03)))
    before = deepcopy(rng)

    def struck(load: LoadChange | None) -> tuple[MeasuredPose, ...]:
        told, same = replace(injected, load=load), deepcopy(before)
        return struck_poses(truth, told, q, hammer, arm.band_hz, errors, same)

    measured = struck_poses(truth, injected, q, hammer, arm.band_hz, errors, rng)
    lines = np.linspace(*arm.band_hz, LINES)
    true = np.array([truth.accelerance(one, lines) for one in unseen])
    modes = [true_modes(truth, one, 12) for one in unseen]
    seen = tuple(hz[np.asarray(shown)][:COUNTED] for hz, shown in modes)
    frfs = tuple(pose.one_hit_frf for pose in measured)
    return Case(
        arm.toml, arm.band_hz, q, frfs, unseen, lines, true, seen, concealed, measured,
        truth, np.array([low, high]), sum(m.mass_kg for m in injected.deviation.added),
        struck,
    )  # fmt: skip


def limits(arm: Arm, simulation: Simulation) -> tuple[np.ndarray, np.ndarray]:
    if arm.joints_deg is None:
        return simulation.robot.lower_rad * 0.4, simulation.robot.upper_rad * 0.4
    low, high = np.deg2rad(np.array(arm.joints_deg, dtype=float)).T
    return low, high


def frac_of(true: np.ndarray, predicted: np.ndarray) -> float:
    """Global FRAC of the direct FRFs."""
    return metrics.direct_mean(metrics.agreement(true, predicted).global_frac)


@dataclass(frozen=True)
class Judged:
    """Of a posterior at unseen poses: frequencies' RMSE in %, the FRFs' FRAC, common scale,
    relative error, share of lines within 2 sd, and what was named.

    `tool_sds` is by how many sds the mass of a forgotten tool is off; NaN where none is named.
    """

    rmse_percent: float
    frac: float
    scale: float
    scale_sd: float
    error: float
    inside: float
    named: tuple[str, ...]
    shares: tuple[float, ...]
    size: float
    tool_sds: float

    @classmethod
    def of(cls, case: Case, found: RobotPosterior) -> "Judged":
        """Scale is the least squares factor from the truth, the mean over poses."""
        mean, sd = found.predicted(case.unseen, case.lines_hz)
        true = case.true_frf
        pairs = list(zip(true, mean, strict=True))
        scale = float(np.mean([np.vdot(a, b).real / np.vdot(a, a).real for a, b in pairs]))
        error = float(np.mean([np.linalg.norm(b - a) / np.linalg.norm(a) for a, b in pairs]))
        hertz = found.simulation.modes(case.unseen, 14).frequency_hz
        off = [
            np.nanmin(np.abs(row / f - 1))
            for row, true_hz in zip(hertz, case.true_hz, strict=True) for f in true_hz
        ]  # fmt: skip
        tools = [
            e.parameters(found.values(e))["mass"] for e in found.structure.effects
            if e.kind == "added_mass"
        ]  # fmt: skip
        return cls(
            100 * float(np.sqrt(np.mean(np.square(off)))), frac_of(true, mean), scale,
            found.scale_sd, error, float(np.mean(np.abs(mean - true) <= 2 * sd)),
            tuple(e.label for e in found.structure.effects), found.found.shares, found.size,
            (tools[0][0] - case.tool_kg) / tools[0][1] if tools else np.nan,
        )  # fmt: skip
