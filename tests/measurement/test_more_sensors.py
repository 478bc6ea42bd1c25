"""What more sensors tell: four along the arm against the tool's alone, on the same hits.

`pytest -m slow -s tests/measurement/test_more_sensors.py` takes hours and prints how often effect
and place are named, by sensors and poses.

What is concealed is one effect at one place of a small arm that has small imperfections anyway;
hands, measuring chains, readback and floor are everyday's. Every case is hit once, whatever
part of it is then diagnosed.
"""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from planner.api import diagnose
from planner.dataset.dataset import Dataset
from planner.diagnosis.diagnose import PRIORS
from planner.dynamics.simulation import Simulation
from planner.effects.table import EffectLibrary, diagnosed
from planner.proof.cases import SCATTER
from planner.proof.detectability import ScoredCase, detection_problem
from planner.proof.deviation import AttachedResonator, BentLink, Deviation, Spring, StiffnessRipple
from planner.proof.fault_injection import HitVisit, InjectedFaults, hit_poses, quiet_hits
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.measurement_errors import EVERYDAY
from planner.proof.recordings import write_recordings
from planner.proof.refit import detectability
from planner.proof.scene import log_uniform, some_direction, triple
from planner.recording.points import SENSOR
from planner.robot.robot import Robot
from tests.support.arm_with_points import (
    AXES,
    BAND_HZ,
    MASSES,
    NODES,
    STEPS,
    STIFFNESS,
    poses,
    write_arm,
)

FIRST, CASES = 9001, 60  # first seed, and how many cases of each kind
TOLD = 20.0  # nats: what tells less of an effect is not counted against a diagnosis
MORE_OFTEN = 0.10  # by which four sensors name effect and place more often, or hits are halved
KINDS = "base", "joint", "link", "hose"
SENSORS = ("sensor", "shoulder", "elbow", "foot")
POSES, DAMPING_S, REACH_M = 4, 3e-4, 2.0
BEARINGS, RIPPLE, MIXED = 200.0, 0.004, 0.3  # a robot with nothing wrong has these
Place = tuple[str, str | None]


def _springs(place: str, axes: np.ndarray, stiffness: tuple[float, ...]) -> tuple[Spring, ...]:
    each = zip(axes, stiffness, strict=True)
    return tuple(Spring(place, triple(a), k, DAMPING_S * k) for a, k in each)


def _pair(rng: np.random.Generator, least: float, most: float) -> tuple[float, float]:
    first = log_uniform(rng, least, most)
    return first, first * log_uniform(rng, 0.7, 1.4)


def _across(joint: int) -> np.ndarray:
    return np.eye(3)[["xyz".index(AXES[joint]) != k for k in range(3)]]


@dataclass(frozen=True, eq=False)
class Concealed:
    """An effect at its place in a robot with imperfections, and the same robot without it."""

    place: Place
    injected: InjectedFaults
    plain: InjectedFaults


def concealed(kind: str, rng: np.random.Generator) -> Concealed:
    """One effect in a robot with imperfections; sizes from hardly to be told to large."""
    plain = replace(SCATTER, seed=int(rng.integers(2**31)))
    sizes = RIPPLE * rng.standard_normal((4, 2))
    wave = tuple(
        StiffnessRipple(f"a{n}", 1, float(c), float(s)) for n, (c, s) in enumerate(sizes, 1)
    )
    number = int(rng.integers(3))
    bearings = [
        _springs(f"a{n + 1}", _across(n), (BEARINGS * k, BEARINGS * k))
        for n, k in enumerate(STIFFNESS)
    ]
    kept = [s for n, b in enumerate(bearings) if kind != "joint" or n != number for s in b]
    robot = replace(plain, mixed=MIXED, harmonics=wave, extra=tuple(kept))
    whole = InjectedFaults(replace(robot, extra=tuple(s for b in bearings for s in b)))
    place, changed = _with(kind, robot, number, rng)
    return Concealed(place, InjectedFaults(changed), whole)


def _with(
    kind: str, robot: Deviation, number: int, rng: np.random.Generator
) -> tuple[Place, Deviation]:
    """Where an effect is, and the robot that has it at a joint, or link, of this number."""
    k = STIFFNESS[number]
    if kind == "base":
        own = _springs("base", np.eye(3)[:2], _pair(rng, 1e6, 5e7))
        return ("base_compliance", "base"), replace(robot, extra=(*robot.extra, *own))
    if kind == "joint":
        own = _springs(f"a{number + 1}", _across(number), _pair(rng, 0.8 * k, 40 * k))
        place = "transverse_compliance", f"joint_{number + 1}"
        return place, replace(robot, extra=(*robot.extra, *own))
    if kind == "link":
        beam = BentLink(f"l{number + 1}", _pair(rng, 0.5 * k, 25 * k), 15 * k, DAMPING_S)
        return ("link_flexibility", f"link_{number + 1}"), replace(robot, beams=(beam,))
    moving = sum(mass for mass, *_ in MASSES)
    at = rng.uniform(0.3, 1.0) * np.array(STEPS[number + 1], dtype=float)
    hose = AttachedResonator(
        f"l{number + 1}", triple(at), triple(some_direction(rng)),
        moving * log_uniform(rng, 0.005, 0.08), log_uniform(rng, 10.0, 50.0),
        log_uniform(rng, 0.01, 0.05),
    )  # fmt: skip
    return ("local_resonator", f"link_{number + 1}"), replace(robot, resonators=(hose,))


def make(kind: str, seed: int, folder: Path) -> tuple[Place, float]:
    """Write folder/robot and folder/hits; what is concealed, and nats that the tool's tells of it.

    In all poses, with robot, hits and measuring chain refitted (`refit.Detectability.nats`).
    """
    rng = np.random.default_rng([seed, zlib.crc32(kind.encode())])
    toml = write_arm(folder / "robot")
    drawn = concealed(kind, rng)
    chains = {name: EVERYDAY.chain(rng) for name in SENSORS}
    injected, plain = (
        replace(s, chain=chains[SENSOR], chains=chains) for s in (drawn.injected, drawn.plain)
    )
    truth, common = load_truth(toml, injected.deviation), EVERYDAY.common(rng)
    shots = [(f"+{axis}", 250.0) for axis in "xyz"]
    stated, visits = poses(POSES, int(rng.integers(2**31))), []
    for number, q in enumerate(stated):
        aims = EVERYDAY.aims([0, 1, 2], rng, common)
        there = EVERYDAY.beside(q, rng)
        visits.append(HitVisit(there, shots, number / POSES, aims, "tcp", SENSORS))
    hammer = Hammer(peak_n=250.0, noise=float(rng.uniform(0.004, 0.02)))
    quiet = quiet_hits(truth, injected, visits, hammer, np.random.default_rng(seed))
    hammer = EVERYDAY.floor(hammer, [hit for hits in quiet for hit in hits], rng)
    found = hit_poses(truth, injected, visits, hammer, np.random.default_rng(seed))
    pairs = enumerate(zip(stated, found, strict=True), 1)
    rows = [(f"P{i}", np.rad2deg(q), hits) for i, (q, hits) in pairs]
    write_recordings(folder / "hits", truth.joint_names, rows, hammer, truth.description, NODES)
    return drawn.place, _told_by_the_tool(toml, (injected, plain), visits, hammer)


def _told_by_the_tool(
    toml: Path,
    secrets: tuple[InjectedFaults, InjectedFaults],
    visits: Sequence[HitVisit],
    hammer: Hammer,
) -> float:
    """Nats of the effect, which the first secret has and the second has not."""
    alone = [replace(visit, sensors=(SENSOR,)) for visit in visits]
    rng = np.random.default_rng(0)
    truth = load_truth(toml, secrets[0].deviation)
    quiet = quiet_hits(truth, secrets[0], alone, hammer, np.random.default_rng(0))
    nowhere = np.empty((0, 4))
    load = partial(load_truth, toml)
    case = ScoredCase(load, BAND_HZ, REACH_M, secrets[0], alone, nowhere, hammer, quiet, rng)
    return detectability(detection_problem(case, secrets[1])).nats


def named(folder: Path, sensors: int, count: int) -> set[Place]:
    """What an engineer reads as being there, by the tool's sensor or all, at the first poses."""
    robot = Robot.load(folder / "robot" / "robot.toml")
    read = Dataset.read(folder / "hits", robot)
    some = read.corrected(read.visits[:count])
    report = diagnose(some.channels_of(SENSOR) if sensors == 1 else some, robot)
    if report.verdict == "consistent":
        return set()
    first = report.candidates[0].effects if report.verdict == "explained" else ()
    return {(e.effect, e.at) for e in (*first, *report.findings)}


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_concealed_has_a_name(kind: str, tmp_path: Path) -> None:
    simulation = Simulation(Robot.load(write_arm(tmp_path)))
    labels = {e.name for e in EffectLibrary.of(simulation, PRIORS, diagnosed(simulation)).effects}
    places = {concealed(kind, np.random.default_rng(seed)).place for seed in range(6)}
    assert places <= labels
    assert len(places) > 1 or kind == "base"


@pytest.mark.slow
@pytest.mark.timeout(86400)
def test_four_sensors_name_more_or_take_half_the_hits(tmp_path: Path) -> None:
    right: dict[tuple[int, int], list[bool]] = {(n, p): [] for n in (1, 4) for p in (1, 2, 4)}
    for seed in range(FIRST, FIRST + CASES):
        for kind in KINDS:
            folder = tmp_path / f"{kind}_{seed}"
            place, nats = make(kind, seed, folder)
            for part in right if nats > TOLD else ():
                right[part].append(place in named(folder, *part))
                print(kind, seed, part, right[part][-1], flush=True)
    one, four = ({p: np.mean(right[n, p]) for p in (1, 2, 4)} for n in (1, 4))
    print(one, four)
    better = all(four[p] >= one[p] + MORE_OFTEN for p in one)
    halved = any(2 * p <= most and four[p] >= one[most] for p in four for most in one)
    assert better or halved
