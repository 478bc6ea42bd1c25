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
from planner.proof.arms import ARMS, Arm, in_a_cell
from planner.proof.detectability import ScoredCase, detection_problem, without_effect
from planner.proof.deviation import Deviation
from planner.proof.fault_injection import (
    HitVisit,
    InjectedFaults,
    frfs,
    hand_visits,
    once,
    quiet_hits,
    windowed,
)
from planner.proof.hits import Hammer, noisy
from planner.proof.imperfections import Step, imperfect
from planner.proof.load import load_truth
from planner.proof.measurement_errors import EVERYDAY, MeasurementErrors
from planner.proof.random_arms import draw_arm, standing
from planner.proof.recordings import write_predict, write_recordings
from planner.proof.refit import DetectionProblem
from planner.proof.scene import PULSE_S, Scene
from planner.proof.table import KINDS, DrawnEffect, Load, concealed

# By what robots differ from their folders, without anything being wrong with them. Stiffnesses
# that are off together: see `imperfections.SOFT`.
SCATTER = Deviation(stiffness=0.15, damping=0.4, inertia=0.08, com_m=0.01)
POSES, PREDICTED, OVERSAMPLING = 9, 4, 8
RANDOM = "random"  # a robot that is drawn
LEVELS = (0.4, 1.0, 2.5)  # of the middling peak force
TWICE = 0.5  # how often the first pose is hit again at the end


@dataclass(frozen=True)
class ConcealedCase:
    """A case; `imperfections` are effects at places that a diagnosis may name.

    `questions` answer what tells of each effect, and of each imperfection; they are asked once
    recordings are written.
    `held_out`: names of poses, frequencies (F,) in Hz and true FRFs (real and imaginary parts;
    pose, response, hit, F).
    """

    robot: str
    concealed: Sequence[DrawnEffect]
    questions: Sequence[Callable[[], DetectionProblem]] = ()
    imperfections: Mapping[tuple[str, str], Callable[[], DetectionProblem]] = field(
        default_factory=dict
    )
    held_out: Mapping[str, Any] = field(default_factory=dict)


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
    scene, hammer, load = _robot(robot, per_joint, folder / "robot", rng)
    plain, imperfections = imperfect(replace(scene, rng=own))
    scene = replace(scene, injected=plain, truth=load(plain.deviation))
    found = concealed(kind, scene, load)
    injected = found[-1].injected if found else plain
    recorded = _recorded(folder / "recordings", scene, injected, load, hammer, errors, own)
    steps = zip([plain, *(drawn.injected for drawn in found)], found, strict=False)
    asked = [_question(recorded, [(before, drawn.injected)]) for before, drawn in steps]
    also = {place: _question(recorded, steps) for place, steps in imperfections.items()}
    name = scene.arm.name if robot == RANDOM else robot
    return ConcealedCase(name, found, asked, also, _held_out(injected, recorded))


def _question(recorded: ScoredCase, steps: Sequence[Step]) -> Callable[[], DetectionProblem]:
    """What tells of all that some steps put in."""
    without = recorded.measured
    for before, after in steps:
        without = without_effect(without, before, after)
    return partial(detection_problem, recorded, without)


def _robot(
    robot: str, per_joint: int, folder: Path, rng: np.random.Generator
) -> tuple[Scene, Hammer, Load]:
    """A robot's folder, what it is without imperfections, and who hits it."""
    known = robot in ARMS
    arm = in_a_cell(robot) if known else draw_arm(rng, folder, per_joint)
    robot_toml = arm.write(folder, per_joint)
    load: Load = partial(load_truth, robot_toml, engine="mujoco" if known else "tree")
    plain = InjectedFaults(replace(SCATTER, seed=int(rng.integers(2**31))))
    count = POSES + PREDICTED
    poses = arm.drawn(count, rng) if known else standing(rng, arm, load(Deviation()), count)
    noise = float(rng.uniform(0.005, 0.03))
    hammer = Hammer(arm.peak_n, PULSE_S, noise=noise, oversampling=OVERSAMPLING)
    hammer = hammer if known else _drawn(rng, hammer, arm)
    truth = load(plain.deviation)
    return Scene(arm, truth, per_joint, poses, hammer.peak_n, plain, rng), hammer, load


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
    own: np.random.Generator,
) -> ScoredCase:
    """Write the recordings; `own` draws what `errors` leaves open."""
    rng, truth = scene.rng, load(injected.deviation)
    measured = replace(injected, chain=errors.chain(own))
    wanted = scene.poses[POSES:]
    stops = planned(scene.poses[:POSES], hammer, errors, rng, own)
    visits, again = [visit for *_, visit in stops], copy.deepcopy(rng)
    quiet = quiet_hits(truth, measured, visits, hammer, rng)
    hammer = errors.floor(hammer, [hit for hits in quiet for hit in hits], own)
    rows = [
        (f"P{index + 1:02d}", readback,
         [windowed(measured.artefact, noisy(hit, hammer, rng), hammer) for hit in hits])
        for (index, readback, _), hits in zip(stops, quiet, strict=True)
    ]  # fmt: skip
    write_recordings(folder, truth.joint_names, rows, hammer, "concealed case")
    write_predict(folder, truth.joint_names, _named(wanted), hammer.peak_n)
    reach_m = sum(float(np.linalg.norm(joint.xyz)) for joint in scene.arm.joints)
    return ScoredCase(
        load, scene.arm.band_hz, reach_m, measured, visits, wanted, hammer, quiet, again
    )


def _named(wanted: np.ndarray) -> list[tuple[str, np.ndarray]]:
    return [(f"H{i + 1:02d}", q) for i, q in enumerate(wanted)]


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


def planned(
    poses: np.ndarray,
    hammer: Hammer,
    errors: MeasurementErrors,
    rng: np.random.Generator,
    own: np.random.Generator,
) -> list[tuple[int, np.ndarray, HitVisit]]:
    """Three axes and three force levels at each pose (n, dof) in rad: number, readback in °, visit.

    `own` draws what `errors` leaves open, so that all else is the same in the laboratory.
    """
    numbers = list(range(len(poses))) + ([0] if rng.random() < TWICE else [])
    shots = [(f"{rng.choice(['+', '-'])}{a}", hammer.peak_n * k) for a in "xyz" for k in LEVELS]
    common = errors.common(own)
    readbacks_deg = [
        np.round(np.rad2deg(q) + hammer.readback_deg * rng.uniform(-1, 1, len(q)), 4)
        for q in poses[numbers]
    ]
    visits = hand_visits(errors, np.deg2rad(readbacks_deg), shots, own, common)
    last = max(len(numbers) - 1, 1)
    visits = [replace(visit, progress=k / last) for k, visit in enumerate(visits)]
    return list(zip(numbers, readbacks_deg, visits, strict=True))
