"""Joints that are not linear are named from hits of different force; linear robots are not.

`pytest -m slow tests/diagnosis/test_levels.py` adds a robot, and joints that harden and soften.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.dataset.dataset import Dataset
from planner.dataset.visits import Visit
from planner.diagnosis.levels import LevelLaw, Levels, level_laws, those_that_matter
from planner.diagnosis.levels_weighing import Differences
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import CAD_INERTIAS
from planner.effects.table import EffectLibrary
from planner.fit.fitted import converged, settled
from planner.fit.gauss_newton import minimised
from planner.fit.misfit import FrfMisfit
from planner.fit.search import Search
from planner.fit.structure import RobotPrior, RobotStructure
from planner.measurement.nuisances import Tolerances
from planner.proof.arms import in_a_cell
from planner.proof.deviation import Deviation
from planner.proof.fault_injection import HitVisit, InjectedFaults, hit_poses
from planner.proof.hits import AXES, Hammer
from planner.proof.laws import Backlash, Friction, Hardening, JointLaw, QuadraticDamping
from planner.proof.load import load_truth
from planner.proof.measurement_errors import EVERYDAY
from planner.proof.nonlinear import Port
from planner.proof.scene import Scene
from planner.robot.robot import Robot
from planner.studies.hits import as_read

Made = tuple[Robot, Dataset, JointLaw | None]
POSES, LEVELS = 4, (0.4, 1.0, 2.5)
# Of a joint's stiffness and its angle under a middling hit.
LAWS: dict[str, Callable[[float, float], JointLaw]] = {
    "hardening": lambda k, angle: Hardening(0.8 * k, 0.5 * angle),
    "softening": lambda k, angle: Hardening(-0.4 * k, 0.5 * angle),
    "friction": lambda k, angle: Friction(0.5 * k, 0.1 * k * angle),
    "backlash": lambda k, angle: Backlash(0.5 * k, 0.3 * angle),
    "oil": lambda k, angle: QuadraticDamping(1e-3 * k / (100 * angle), 1e3 * angle),
}


def made(
    folder: Path,
    seed: int,
    law: str = "",
    joint: str = "",
    levels: tuple[float, ...] = LEVELS,
    count: int = POSES,
) -> Made:
    """A robot whose springs and bodies are not quite as stated, hit by hand; its law, if any."""
    rng, arm = np.random.default_rng(seed), in_a_cell("kr10")
    toml = arm.write(folder / "robot", 1)
    deviation = Deviation(seed, stiffness=0.15, damping=0.15, inertia=0.04, com_m=0.005)
    truth, peak_n = load_truth(toml, deviation), arm.peak_n
    poses, hammer = arm.drawn(count, rng), Hammer(peak_n, 0.008, noise=0.01)
    scene = Scene(arm, truth, 1, poses, peak_n, InjectedFaults(deviation), rng)
    bends = LAWS[law](scene.stiffness(joint), scene.angle(joint)) if law else None
    ports = (Port(bends, joint=joint),) if bends else ()
    injected = InjectedFaults(deviation, ports, chain=EVERYDAY.chain(rng))
    shots = [(f"+{axis}", peak_n * level) for axis in "xyz" for level in levels]
    axes = [AXES.index(axis[1]) for axis, _ in shots]
    planned = [HitVisit(q, shots, i / count, EVERYDAY.aims(axes, rng)) for i, q in enumerate(poses)]
    visits = [
        Visit(f"P{i}", q, i / count, as_read(hits, hammer))
        for i, (q, hits) in enumerate(
            zip(poses, hit_poses(truth, injected, planned, hammer, rng), strict=True)
        )
    ]
    robot = Robot.load(toml)
    return robot, Dataset.of_visits(visits, robot.config.band_hz), bends


def seen(robot: Robot, recorded: Dataset) -> Levels:
    """What levels tell beside a linear fit of the averages: logarithms first, then the FRFs."""
    prior = RobotPrior(EffectLibrary.of(Simulation(robot), CAD_INERTIAS))
    tolerances = Tolerances.of(robot.config, robot.joints.slides)
    search = Search(prior, recorded.ended_frfs, recorded.q, recorded.band_hz, tolerances)
    structure = RobotStructure(prior)
    misfit = FrfMisfit(structure, search.data(28), tolerances, None)
    at, misfit = minimised(misfit, structure.mean, 15), misfit.with_rho(0.1)
    return level_laws(recorded, converged(settled(misfit, minimised(misfit, at.x, 8))))


SECOND = pytest.param(1, LEVELS, marks=pytest.mark.slow)


@pytest.mark.parametrize(("seed", "levels"), [(0, LEVELS), SECOND, (2, (1.0,))])
def test_a_linear_robot_is_proportional(tmp_path: Path, seed: int, levels: tuple[float, ...]):
    found = seen(*made(tmp_path, seed, levels=levels)[:2])
    assert found.laws == ()
    assert not found.unexplained


@pytest.mark.parametrize(
    ("law", "joint", "effect", "numbers"),
    [
        pytest.param(
            "hardening",
            "joint_2",
            "nonlinear_stiffness",
            ("stiffness_change", "angle"),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "softening",
            "joint_3",
            "nonlinear_stiffness",
            ("stiffness_change", "angle"),
            marks=pytest.mark.slow,
        ),
        ("friction", "joint_2", "friction", ("presliding_stiffness", "coulomb_torque")),
        ("backlash", "joint_3", "backlash", ("lost_stiffness", "half_gap")),
    ],
)
def test_a_law_is_named_with_its_numbers(
    tmp_path: Path, law: str, joint: str, effect: str, numbers: tuple[str, str]
):
    robot, recorded, truth = made(tmp_path, 5, law, joint)
    found = seen(robot, recorded)
    assert [(one.effect, one.at) for one in found.laws] == [(effect, joint)]
    told = found.laws[0].parameters
    for name, true in zip(numbers, vars(truth).values(), strict=True):
        value, sd, unit = told[name]
        assert value == pytest.approx(true, abs=3 * sd)
        assert sd < 0.2 * abs(true)
        assert unit == {"coulomb_torque": "N·m", "half_gap": "rad", "angle": "rad"}.get(
            name, "N·m/rad"
        )
    assert found.candidates[0][:2] == (effect, joint)
    assert found.candidates[0][2] > 0.9
    assert sum(p for *_, p in found.candidates) == pytest.approx(1)
    assert found.explained > 0.8
    assert not found.unexplained


def test_what_is_told_was_weighed_where_the_first_law_is_too_small():
    laws = tuple(
        LevelLaw("friction", at, 99.0, {}, size) for at, size in (("a", 0.004), ("b", 0.02))
    )
    weighed = [((law.effect, law.at, 1.0),) for law in laws]
    found = Levels(Differences(0.1, 0.0), Differences(0.0, 1.0), laws, candidates=weighed[0])
    told = those_that_matter(found, weighed, 0.01)
    assert told.laws == laws[1:]
    assert told.candidates == weighed[1]
    assert those_that_matter(found, weighed, 0.5).laws == ()


def test_what_no_library_law_describes_is_unexplained(tmp_path: Path):
    found = seen(*made(tmp_path, 7, "oil", "joint_2")[:2])
    assert found.laws == ()
    assert found.unexplained
    assert found.candidates[0][:2] == ("unknown", "joint_2")


def test_what_no_joint_explains_is_unexplained(tmp_path: Path):
    """The hardest hits of each pose are answered in other directions: contact, loose parts."""
    robot, recorded, _ = made(tmp_path, 1)
    rng, visits = np.random.default_rng(0), []
    for visit in recorded.visits:
        mixed = [np.eye(3), np.eye(3), np.eye(3) + 0.15 * rng.standard_normal((3, 3))]
        hits = tuple(
            replace(h, acceleration_m_s2=mixed[recorded.level(h)] @ h.acceleration_m_s2)
            for h in visit.hits
        )
        visits.append(replace(visit, hits=hits))
    found = seen(robot, recorded.corrected(visits))
    assert found.laws == ()
    assert found.unexplained
