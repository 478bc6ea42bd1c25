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
from pathlib import Path

import numpy as np

from planner.api import diagnose
from planner.dataset.dataset import Dataset
from planner.recording.points import SENSOR
from planner.report.diagnosis import DiagnosisReport
from planner.robot.robot import Robot
from planner.truth.deviation import AttachedResonator, BentLink, Spring, StiffnessRipple
from planner.truth.handling import EVERYDAY, together
from planner.truth.hits import Hammer, write_recordings
from planner.truth.load import load_truth
from planner.truth.scene import log_uniform, some_direction, triple
from planner.truth.secret import HitVisit, Secret, hit_poses, quiet_hits
from planner.truth.world import REAL
from tests.support.arm_with_points import AXES, MASSES, NODES, STEPS, STIFFNESS, poses, write_arm

KINDS = "base", "joint", "link", "hose"
SENSORS = ("sensor", "shoulder", "elbow", "foot")
POSES, DAMPING_S = 4, 3e-4
BEARINGS, RIPPLE, MIXED = 200.0, 0.004, 0.3  # a robot with nothing wrong has these
Place = tuple[str, str | None]


@dataclass(frozen=True)
class Said:
    """What a diagnosis of `hits` hits by `sensors` sensors said of a case.

    `named`: it names effect and place of what is concealed; `in_set`: or a set of at most two that
    it cannot tell apart from that; `others`: names that it gives beside.
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


def _springs(place: str, axes: np.ndarray, stiffness: tuple[float, ...]) -> tuple[Spring, ...]:
    each = zip(axes, stiffness, strict=True)
    return tuple(Spring(place, triple(a), k, DAMPING_S * k) for a, k in each)


def _pair(rng: np.random.Generator, least: float, most: float) -> tuple[float, float]:
    first = log_uniform(rng, least, most)
    return first, first * log_uniform(rng, 0.7, 1.4)


def _across(joint: int) -> np.ndarray:
    return np.eye(3)[["xyz".index(AXES[joint]) != k for k in range(3)]]


def concealed(kind: str, rng: np.random.Generator) -> tuple[Place, Secret]:
    """One effect in a robot with imperfections; sizes from hardly to be told to large."""
    plain = REAL.scatter.of(int(rng.integers(2**31)))
    sizes = RIPPLE * rng.standard_normal((4, 2))
    wave = tuple(
        StiffnessRipple(f"a{n}", 1, float(c), float(s)) for n, (c, s) in enumerate(sizes, 1)
    )
    number = int(rng.integers(3))
    joint = f"a{number + 1}"
    bearings = [
        _springs(f"a{n + 1}", _across(n), (BEARINGS * k, BEARINGS * k))
        for n, k in enumerate(STIFFNESS)
        if not (kind == "joint" and n == number)
    ]
    robot = replace(plain, mixed=MIXED, harmonics=wave, extra=tuple(s for b in bearings for s in b))
    if kind == "base":
        own = _springs("base", np.eye(3)[:2], _pair(rng, 5e5, 8e6))
        return ("base_compliance", "base"), Secret(replace(robot, extra=(*robot.extra, *own)))
    if kind == "joint":
        k = STIFFNESS[number]
        own = _springs(joint, _across(number), _pair(rng, 0.4 * k, 8 * k))
        place = "transverse_compliance", f"joint_{number + 1}"
        return place, Secret(replace(robot, extra=(*robot.extra, *own)))
    if kind == "link":
        k = STIFFNESS[number]
        beam = BentLink(f"l{number + 1}", _pair(rng, 0.3 * k, 5 * k), 3 * k, DAMPING_S)
        return ("link_flexibility", f"link_{number + 1}"), Secret(replace(robot, beams=(beam,)))
    moving = sum(mass for mass, *_ in MASSES)
    at = rng.uniform(0.3, 1.0) * np.array(STEPS[number + 1].split(), dtype=float)
    hose = AttachedResonator(
        f"l{number + 1}", triple(at), triple(some_direction(rng)),
        moving * log_uniform(rng, 0.003, 0.05), log_uniform(rng, 10.0, 50.0),
        log_uniform(rng, 0.01, 0.05),
    )  # fmt: skip
    return ("local_resonator", f"link_{number + 1}"), Secret(replace(robot, resonators=(hose,)))


def make(kind: str, seed: int, folder: Path) -> Place:
    """Write folder/robot and folder/hits, and say what is concealed."""
    rng = np.random.default_rng([seed, zlib.crc32(kind.encode())])
    toml = write_arm(folder / "robot")
    place, secret = concealed(kind, rng)
    chains = {name: EVERYDAY.chain(rng) for name in SENSORS}
    secret = replace(secret, chain=chains[SENSOR], chains=chains)
    truth, common = load_truth(toml, secret.deviation), EVERYDAY.common(rng)
    shots = [(f"+{axis}", 250.0) for axis in "xyz"]
    stated, visits = poses(POSES, int(rng.integers(2**31))), []
    for number, q in enumerate(stated):
        own = EVERYDAY.aims([0, 1, 2], rng)
        aims = [together(*both) for both in zip(common, own, strict=True)]
        there = q + np.deg2rad(EVERYDAY.readback_deg) * rng.standard_normal(4)
        visits.append(HitVisit(there, shots, number / POSES, aims, "tcp", SENSORS))
    hammer = Hammer(peak_n=250.0, noise=float(rng.uniform(0.004, 0.02)))
    quiet = quiet_hits(truth, secret, visits, hammer, np.random.default_rng(seed))
    hammer = EVERYDAY.floor(hammer, [hit for hits in quiet for hit in hits], rng)
    found = hit_poses(truth, secret, visits, hammer, np.random.default_rng(seed))
    rows = [
        (f"P{i}", np.rad2deg(q), 1, hit)
        for i, (q, hits) in enumerate(zip(stated, found, strict=True), 1)
        for hit in hits
    ]
    write_recordings(folder / "hits", truth.joint_names, rows, hammer, truth.description, NODES)
    return place


def told(folder: Path, sensors: int, count: int) -> tuple[DiagnosisReport, Dataset]:
    """Diagnosis of the first poses of a case by the tool's sensor, or by all."""
    robot = Robot.load(folder / "robot" / "robot.toml")
    read = Dataset.read(
        folder / "hits", robot.joint_names, robot.config.band_hz, points=robot.points
    )
    some = read.corrected(read.visits[:count])
    if sensors == 1:
        some = some.heard_by(SENSOR)
    return diagnose(some, robot), some


def said(case: str, place: Place, folder: Path, sensors: int, count: int) -> Said:
    """Of one case, by so many sensors at so many poses."""
    started = time.process_time()
    report, some = told(folder, sensors, count)
    named = _named(report)
    sets = [{(e.effect, e.at) for e in members} for members in report.sets]
    alike = {p for s in sets if place in s and len(s) <= 2 for p in s}
    return Said(
        case, sensors, sum(len(v.hits) for v in some.visits), place in named,
        place in named or bool(alike & set(named)), sum(p != place for p in named),
        report.verdict, named, round(time.process_time() - started, 1),
    )  # fmt: skip


def _named(report: DiagnosisReport) -> tuple[Place, ...]:
    """What an engineer reads as being there."""
    if report.verdict == "consistent":
        return ()
    first = report.candidates[0].effects if report.verdict == "explained" else ()
    both = [(e.effect, e.at) for e in (*first, *report.findings)]
    return tuple(dict.fromkeys(p for p in both if p[0] not in ("none", "unknown")))


def answers(
    folder: Path, each: int, first_seed: int, parts: Sequence[tuple[int, int]]
) -> Iterator[Said]:
    """Of so many cases of each kind, part by part: by how many sensors, at how many poses.

    What the folder holds already is not done again. Kinds take turns, so that what was done when
    it was stopped holds as many of each.
    """
    for sensors, count in parts:
        for seed in range(first_seed, first_seed + each):
            for kind in KINDS:
                yield _answer(folder, kind, seed, sensors, count)


def _answer(folder: Path, kind: str, seed: int, sensors: int, count: int) -> Said:
    case = f"{kind}_{seed}"
    path, sealed = folder / f"{case}_{sensors}_{count}.json", folder / f"{case}.json"
    if not sealed.is_file():
        place = make(kind, seed, folder / case)
        _write(sealed, place)
    if not path.is_file():
        place = tuple(json.loads(sealed.read_text()))
        _write(path, asdict(said(case, place, folder / case, sensors, count)))
    return Said(**json.loads(path.read_text()))


def _write(path: Path, what: object) -> None:
    part = path.with_suffix(".part")
    part.write_text(json.dumps(what))
    part.replace(path)
