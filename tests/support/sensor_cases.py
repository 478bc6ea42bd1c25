"""Everyday cases heard by sensors from base to wrist, and what a diagnosis of some of them says.

What is concealed is one effect at one place of a small arm that has small imperfections anyway;
hands, measuring chains, readback and floor are everyday's. Every case is hit once, whatever
part of it is then diagnosed.
"""

import json
import time
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from planner.api import diagnose
from planner.dataset.dataset import Dataset
from planner.proof.cases import SCATTER
from planner.proof.detectability import ScoredCase, detection_problem
from planner.proof.deviation import (
    AttachedResonator,
    BentLink,
    Deviation,
    Spring,
    StiffnessRipple,
)
from planner.proof.fault_injection import HitVisit, InjectedFaults, hit_poses, quiet_hits
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.measurement_errors import EVERYDAY
from planner.proof.recordings import write_recordings
from planner.proof.refit import detectability
from planner.proof.scene import log_uniform, some_direction, triple
from planner.proof.score import Scored, score
from planner.recording.points import SENSOR
from planner.report.diagnosis import DiagnosisReport
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

KINDS = "base", "joint", "link", "hose"
SENSORS = ("sensor", "shoulder", "elbow", "foot")
POSES, DAMPING_S = 4, 3e-4
REACH_M = 2.0
BEARINGS, RIPPLE, MIXED = 200.0, 0.004, 0.3  # a robot with nothing wrong has these
Place = tuple[str, str | None]


@dataclass(frozen=True)
class Said:
    """What a diagnosis of `hits` hits by `sensors` sensors said of a case.

    `named`: it names effect and place of what is concealed; `in_set`: or a set of at most two that
    it cannot tell apart from that; `others`: names that it gives beside. `nats`: what the tool's
    sensor can tell of it in all poses.
    """

    case: str
    sensors: int
    hits: int
    named: bool
    in_set: bool
    others: int
    verdict: str
    said: tuple[Place, ...]
    cpu_s: float
    nats: float = float("nan")


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


def told(folder: Path, sensors: int, count: int) -> tuple[DiagnosisReport, Dataset]:
    """Diagnosis of the first poses of a case by the tool's sensor, or by all."""
    robot = Robot.load(folder / "robot" / "robot.toml")
    read = Dataset.read(folder / "hits", robot)
    some = read.corrected(read.visits[:count])
    if sensors == 1:
        some = some.channels_of(SENSOR)
    return diagnose(some, robot), some


def said(case: str, place: Place, folder: Path, sensors: int, count: int) -> Said:
    """Of one case, by so many sensors at so many poses."""
    started = time.process_time()
    report, some = told(folder, sensors, count)
    found = judged(case, place, report)
    return Said(
        case, sensors, sum(len(v.hits) for v in some.visits), found.shown[0].named,
        found.shown[0].in_set, sum(p != place for p in found.named), found.verdict, found.named,
        round(time.process_time() - started, 1),
    )  # fmt: skip


def judged(case: str, place: Place, report: DiagnosisReport) -> Scored:
    """As a proof scores what was said of one effect at its place."""
    effect = {"effect": place[0], "at": place[1], "parameters": {}, "nats": 0.0, "size": 0.0}
    return score(case, {"robot": "arm", "effects": [effect]}, report.to_json())


def answers(
    folder: Path, each: int, first_seed: int, parts: Sequence[tuple[int, int]]
) -> Iterator[Said]:
    """Of so many cases of each kind, each by so many sensors at so many poses.

    What the folder holds already is not done again. Kinds take turns and each case is heard in all
    ways before the next, so that what was done when it was stopped can be compared.
    """
    for seed in range(first_seed, first_seed + each):
        for kind in KINDS:
            for sensors, count in parts:
                yield _answer(folder, kind, seed, sensors, count)


def held(folder: Path) -> list[Said]:
    """All answers that a folder holds."""
    return [_read(path) for path in sorted(folder.glob("*_*_*_*.json"))]


def _answer(folder: Path, kind: str, seed: int, sensors: int, count: int) -> Said:
    case = f"{kind}_{seed}"
    path, sealed = folder / f"{case}_{sensors}_{count}.json", folder / f"{case}.json"
    if not sealed.is_file():
        _write(sealed, make(kind, seed, folder / case))
    if not path.is_file():
        place = tuple(json.loads(sealed.read_text())[0])
        _write(path, asdict(said(case, place, folder / case, sensors, count)))
    return _read(path)


def _read(path: Path) -> Said:
    """An answer, with the nats that its case's seal holds."""
    found = json.loads(path.read_text())
    sealed = path.with_name(f"{found['case']}.json")
    return Said(**found | {"nats": json.loads(sealed.read_text())[1]})


def _write(path: Path, what: object) -> None:
    part = path.with_suffix(".part")
    part.write_text(json.dumps(what))
    part.replace(path)
