"""Concealed cases: recordings of robots whose folders lack something.

Known industrial arms by MuJoCo, and robots that are drawn at random by the tree of frames.
"""

import copy
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from planner.errors import InputError
from planner.proof.arms import ARMS, Arm
from planner.proof.detectability import ScoredCase, detection_problem, without_effect
from planner.proof.deviation import Deviation
from planner.proof.effects import EFFECTS, LINEAR, NONLINEAR
from planner.proof.fault_injection import HitVisit, InjectedFaults, frfs, once, quiet_hits, windowed
from planner.proof.hits import AXES, Hammer, SimulatedHit, noisy, write_predict, write_recordings
from planner.proof.imperfections import imperfect
from planner.proof.load import load_truth
from planner.proof.measurement_errors import EVERYDAY, MeasurementErrors
from planner.proof.model import Truth
from planner.proof.out_of_library import ARTEFACTS
from planner.proof.out_of_library import OUT_OF_LIBRARY as UNKNOWN
from planner.proof.random_arms import draw_arm, standing
from planner.proof.refit import DetectionProblem
from planner.proof.scene import PULSE_S, Draw, DrawnEffect, Scene, log_uniform

TABLE: dict[str, Draw] = {**EFFECTS, **ARTEFACTS, **UNKNOWN}
SINGLES, OUT_OF_LIBRARY_KINDS = (*EFFECTS, *ARTEFACTS), tuple(UNKNOWN)
KINDS = ("null", *TABLE, "pair", "drives")  # "drives": one law in several of them
DRIVES = 2, 4  # how many joints, at least and at most
# By what robots differ from their folders, without anything being wrong with them. Stiffnesses
# that are off together: see `imperfections.SOFT`.
SCATTER = Deviation(stiffness=0.15, damping=0.4, inertia=0.08, com_m=0.01)
SIZES = 0.03, 1.0  # of effects, log-uniform; 1 is a large one
SMALLER = 3.0  # at most: the first of several effects over any other; chosen
ATTEMPTS = 40
# Peaks (N) of a middling hit: a tenth of a millimetre or two at the tool.
PEAK_N = {"kr10": 150.0, "kr210": 1200.0, "irb6640": 1200.0}
POSES, PREDICTED, OVERSAMPLING = 9, 4, 8
RANDOM = "random"  # a robot that is drawn
LEVELS = (0.4, 1.0, 2.5)  # of the middling peak force
TWICE = 0.5  # how often the first pose is hit again at the end
DAMPING_S = 9.5e-4  # C = s K: 3 % at 10 Hz, as robots in milling cells have


class NothingDetectableError(Exception):
    """A seed of which nothing comes; take another one."""


@dataclass(frozen=True)
class ConcealedCase:
    """A case; `imperfections` are places that a diagnosis may name, too small to be asked for.

    `questions` answer what tells of each effect; they are asked once recordings are written.
    `held_out`: names of poses, frequencies (F,) in Hz and true FRFs (real and imaginary parts;
    pose, response, hit, F).
    """

    robot: str
    concealed: Sequence[DrawnEffect]
    questions: Sequence[Callable[[], DetectionProblem]] = ()
    imperfections: Sequence[tuple[str, str]] = ()
    held_out: Mapping[str, Any] = field(default_factory=dict)


Load = Callable[[Deviation], Truth]


def make_case(
    kind: str, robot: str, seed: int, folder: Path, errors: MeasurementErrors = EVERYDAY
) -> ConcealedCase:
    """Write folder/robot and folder/recordings of one of KINDS, of a robot of ARMS or RANDOM.

    Raises NothingDetectableError for a seed of which nothing comes, InputError for unknown names.
    """
    if kind not in KINDS or robot not in (*ARMS, RANDOM):
        raise InputError(f"No case {kind} of robot {robot}; kinds are {', '.join(KINDS)}.")
    rng = np.random.default_rng([seed, zlib.crc32(f"{kind} {robot}".encode())])
    own = np.random.default_rng([seed, zlib.crc32(b"handling")])
    per_joint = 1 if kind == "transverse_compliance" else int(rng.choice([1, 3]))
    scene, plain, hammer, load = _robot(robot, per_joint, folder / "robot", rng)
    plain, imperfections = imperfect(scene, plain, own)
    scene = replace(scene, truth=load(plain.deviation))
    found = concealed(kind, scene, plain, load, rng)
    injected = found[-1].injected if found else plain
    recorded = _recorded(folder / "recordings", scene, injected, load, hammer, errors, rng, own)
    before = [plain, *(drawn.injected for drawn in found)]
    asked = [
        partial(
            detection_problem, recorded, without_effect(recorded.measured, without, drawn.injected)
        )
        for without, drawn in zip(before, found, strict=False)
    ]
    name = scene.arm.name if robot == RANDOM else robot
    return ConcealedCase(name, found, asked, imperfections, _held_out(injected, recorded))


def _robot(
    robot: str, per_joint: int, folder: Path, rng: np.random.Generator
) -> tuple[Scene, InjectedFaults, Hammer, Load]:
    """A robot's folder, what it is without imperfections, and who hits it."""
    known = ARMS.get(robot)
    arm = replace(known, damping_s=DAMPING_S) if known else draw_arm(rng, folder, per_joint)
    robot_toml = arm.write(folder, per_joint)
    load: Load = partial(load_truth, robot_toml, engine="mujoco" if known else "tree")
    plain = InjectedFaults(replace(SCATTER, seed=int(rng.integers(2**31))))
    low, high = np.deg2rad(np.array(arm.joints_deg)).T
    if known:
        poses = rng.uniform(low, high, (POSES + PREDICTED, len(low)))
    else:
        poses = standing(rng, arm, load(Deviation()), POSES + PREDICTED)
    noise = float(rng.uniform(0.005, 0.03))
    hammer = Hammer(PEAK_N.get(robot, 0.0), PULSE_S, noise=noise, oversampling=OVERSAMPLING)
    hammer = hammer if known else _drawn(rng, hammer, arm)
    scene = Scene(arm, load(plain.deviation), per_joint, poses, hammer.peak_n)
    return scene, plain, hammer, load


def _drawn(rng: np.random.Generator, hammer: Hammer, arm: Arm) -> Hammer:
    """The hammer and analyser for a robot that is drawn: peaks go with its payload."""
    return replace(
        hammer,
        peak_n=150 * (arm.payload_kg / 20) ** 0.4 * float(rng.uniform(0.6, 1.6)),
        sampling_rate_hz=float(rng.choice([400, 512, 640])),
        record_s=float(rng.choice([2.0, 2.5, 3.2])),
        corner_hz=float(rng.uniform(1, 10)),
        bits=24 if rng.random() < 0.7 else 16,
    )


def _recorded(
    folder: Path,
    scene: Scene,
    injected: InjectedFaults,
    load: Load,
    hammer: Hammer,
    errors: MeasurementErrors,
    rng: np.random.Generator,
    own: np.random.Generator,
) -> ScoredCase:
    """Write the recordings; `own` draws what `errors` leaves open."""
    truth = load(injected.deviation)
    measured = replace(injected, chain=errors.chain(own))
    wanted = scene.poses[POSES:]
    visits = Visits.planned(scene.poses[:POSES], hammer, errors, rng, own)
    again = copy.deepcopy(rng)
    quiet = quiet_hits(truth, measured, visits.visits, hammer, rng)
    hammer = errors.floor(hammer, [hit for hits in quiet for hit in hits], own)
    record(folder, truth, measured, visits, quiet, hammer, rng)
    write_predict(folder, truth.joint_names, _named(wanted), hammer.peak_n)
    reach_m = sum(float(np.linalg.norm(joint.xyz)) for joint in scene.arm.joints)
    return ScoredCase(
        load, scene.arm.band_hz, reach_m, measured, visits.visits, wanted, hammer, quiet, again
    )


def _named(wanted: np.ndarray) -> list[tuple[str, np.ndarray]]:
    return [(f"H{i + 1:02d}", q) for i, q in enumerate(wanted)]


def concealed(
    kind: str, scene: Scene, injected: InjectedFaults, load: Load, rng: np.random.Generator
) -> list[DrawnEffect]:
    """Effects added one after the other.

    Drawn again is what could not be: a robot that shakes by itself, a joint with two laws.
    """
    found: list[DrawnEffect] = []
    largest = log_uniform(rng, *SIZES)
    for name in _names(kind, scene, rng):
        size = largest
        for _ in range(ATTEMPTS):
            if found:
                size = largest * log_uniform(rng, 1 / SMALLER, 1.0)
            drawn = TABLE[name](replace(scene, size=size), injected, rng)
            if kind == "drives" and not _joins(drawn, found):
                continue
            with_it = load(drawn.injected.deviation)
            if all(np.all(with_it.poles(q)[0].real < 0) for q in scene.poses):
                found.append(replace(drawn, size=size))
                injected = drawn.injected
                break
        else:
            raise NothingDetectableError(f"No {name} of this robot can be; take another seed.")
    return found


def _names(kind: str, scene: Scene, rng: np.random.Generator) -> list[str]:
    """Of the effects of a case; at most one of a pair is nonlinear."""
    if kind == "pair":
        linear = [n for n in LINEAR if n != "transverse_compliance" or scene.per_joint == 1]
        first, second = (str(name) for name in rng.choice(linear, 2, replace=False))
        return [first, str(rng.choice(list(NONLINEAR)))] if rng.random() < 0.3 else [first, second]
    if kind == "drives":
        return [str(rng.choice(list(NONLINEAR)))] * int(rng.integers(DRIVES[0], DRIVES[1] + 1))
    return [] if kind == "null" else [kind]


def _joins(drawn: DrawnEffect, before: list[DrawnEffect]) -> bool:
    """Whether a law is at a joint of its own, and hardens or softens as the others do."""
    numbers = [next(iter(d.parameters.values())) for d in (drawn, *before)]
    signs = {v > 0 for v in numbers if isinstance(v, float)}
    return len(signs) == 1 and all(d.at != drawn.at for d in before)


def _held_out(injected: InjectedFaults, case: ScoredCase) -> dict[str, Any]:
    """True FRFs (real and imaginary; pose, response, hit, F) without noise and artefacts."""
    hammer = case.hammer
    quiet = replace(hammer, noise=0.0, force_noise=0.0, bits=0, record_s=2 * hammer.record_s)
    visits = [once(q, hammer.peak_n) for q in case.wanted]
    plain, truth = InjectedFaults(injected.deviation, injected.ports), case.load(injected.deviation)
    frequency, H = frfs(truth, plain, visits, quiet, case.band_hz)
    return {
        "poses": [name for name, _ in _named(case.wanted)],
        "frequency_hz": frequency.tolist(),
        "frf": [H.real.tolist(), H.imag.tolist()],
    }


@dataclass(frozen=True, eq=False)
class Visits:
    """What is done, and what recordings.csv says of it: pose's number and angles (dof,) in °."""

    visits: Sequence[HitVisit]
    poses: Sequence[int]
    readbacks_deg: Sequence[np.ndarray]

    @classmethod
    def planned(
        cls,
        poses: np.ndarray,
        hammer: Hammer,
        errors: MeasurementErrors,
        rng: np.random.Generator,
        own: np.random.Generator,
    ) -> "Visits":
        """Three axes and three force levels at each pose (n, dof) in rad.

        `own` draws what `errors` leaves open, so that all else is the same in the laboratory.
        """
        numbers = list(range(len(poses))) + ([0] if rng.random() < TWICE else [])
        shots = [(f"{rng.choice(['+', '-'])}{a}", hammer.peak_n * k) for a in "xyz" for k in LEVELS]
        planned, readbacks = [], []
        common, axes = errors.common(own), [AXES.index(axis[1]) for axis, _ in shots]
        for number, index in enumerate(numbers):
            scatter = hammer.readback_deg * rng.uniform(-1, 1, len(poses[index]))
            readbacks.append(np.round(np.rad2deg(poses[index]) + scatter, 4))
            off = np.deg2rad(errors.readback_deg) * own.standard_normal(len(poses[index]))
            aims = errors.aims(axes, own, common)
            there = np.deg2rad(readbacks[-1]) + off
            planned.append(HitVisit(there, shots, number / max(len(numbers) - 1, 1), aims))
        return cls(planned, numbers, readbacks)


def record(
    folder: Path,
    truth: Truth,
    injected: InjectedFaults,
    visits: Visits,
    quiet: Sequence[Sequence[SimulatedHit]],
    hammer: Hammer,
    rng: np.random.Generator,
) -> None:
    """Write the hits `quiet` of all visits, with noise and with the window left on them."""
    rows = []
    counts: dict[tuple[int, str], int] = {}
    for index, readback, hits in zip(visits.poses, visits.readbacks_deg, quiet, strict=True):
        for hit in hits:
            heard = windowed(injected.artefact, noisy(hit, hammer, rng), hammer)
            repeat = counts[index, hit.axis] = counts.get((index, hit.axis), 0) + 1
            rows.append((f"P{index + 1:02d}", readback, repeat, heard))
    write_recordings(folder, truth.joint_names, rows, hammer, "concealed case")
