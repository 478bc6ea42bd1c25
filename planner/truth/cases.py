"""Concealed cases: recordings of robots whose folders lack something, and the sealed answers.

    python -m planner.truth.cases FOLDER --cases 12 --seed 7

writes FOLDER/case_001/{robot,recordings} …, prints the hash of every answer, and puts the answers
into FOLDER/answers. Nothing in a case's folder tells what was concealed.
"""

import argparse
import hashlib
import json
import secrets
import zlib
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.truth.arms import ARMS, Arm
from planner.truth.detect import Detectability, detectability
from planner.truth.deviation import Deviation
from planner.truth.effects import LINEAR, NONLINEAR, OTHER
from planner.truth.handling import EVERYDAY, LABORATORY, Handling, together
from planner.truth.hits import AXES, Hammer, write_predict, write_recordings
from planner.truth.mishaps import ARTEFACTS, OUTSIDERS
from planner.truth.model import Truth, load_truth
from planner.truth.scene import PULSE_S, Draw, Drawn, Scene
from planner.truth.secret import HitVisit, Secret, frfs, hit_poses, once

EFFECTS: dict[str, Draw] = {**LINEAR, **NONLINEAR, **OTHER, **ARTEFACTS, **OUTSIDERS}
KINDS = ("null", *EFFECTS, "pair", "drives")  # "drives": one law in several joints
MIX = ("null", *EFFECTS, "pair", "null", "pair", "pair")  # pairs more often: there are many kinds
DRIVES = 2, 4  # how many joints, at least and at most
# Peaks (N) of a middling hit: a tenth of a millimetre or two at the tool.
PEAK_N = {"kr10": 150.0, "kr210": 1200.0, "irb6640": 1200.0}
LEVELS = (0.4, 1.0, 2.5)
POSES, PREDICTED = 9, 4
DAMPING_S = 9.5e-4  # C = s K: 3 % at 10 Hz, as robots in milling cells have
SCATTER = Deviation(stiffness=0.15, damping=0.15, inertia=0.04, com_m=0.005)
ATTEMPTS, SCENES = 40, 5


class NothingShowsError(InputError):
    """A scene whose noise hides whatever was drawn of an effect."""


@dataclass(frozen=True)
class Case:
    """A case as an outsider sees it, and its answer; `seal` is the SHA-256 of the answer's text."""

    recordings: Path
    robot_toml: Path
    answer: str
    seal: str


def make_case(
    kind: str, robot: str, seed: int, folder: Path, handling: Handling = LABORATORY
) -> Case:
    """Write folder/robot and folder/recordings of a kind of KINDS and a robot of ARMS.

    `handling`: how hits and measuring chain err.

    Raises InputError for an unknown kind or robot.
    """
    if kind not in KINDS or robot not in ARMS:
        raise InputError(f"No case {kind} of robot {robot}; kinds are {', '.join(KINDS)}.")
    rng = np.random.default_rng([seed, zlib.crc32(f"{kind} {robot}".encode())])
    arm = replace(ARMS[robot], damping_s=DAMPING_S)
    per_joint = 1 if kind == "transverse_compliance" else int(rng.choice([1, 3]))
    robot_toml = arm.write(folder / "robot", per_joint)
    plain = Secret(replace(SCATTER, seed=int(rng.integers(2**31))))
    low, high = np.deg2rad(np.array(arm.joints_deg)).T
    poses = rng.uniform(low, high, (POSES + PREDICTED, 6))
    hammer = Hammer(PEAK_N[robot], PULSE_S, noise=float(rng.uniform(0.005, 0.03)))
    truth = load_truth(robot_toml, plain.deviation)
    scene = Scene(arm, truth, per_joint, poses, hammer.peak_n)
    concealed, measures = _conceal(kind, scene, plain, robot_toml, hammer, rng)
    secret = concealed[-1].secret if concealed else plain
    truth = load_truth(robot_toml, secret.deviation)
    own = np.random.default_rng([seed, zlib.crc32(b"handling")])
    measured = replace(secret, chain=handling.chain(own))
    _record(truth, measured, poses[:POSES], folder / "recordings", hammer, rng, handling, own)
    held_out = [(f"H{i + 1:02d}", q) for i, q in enumerate(poses[POSES:])]
    write_predict(folder / "recordings", truth.joint_names, held_out, hammer.peak_n)
    answer = json.dumps(
        {
            "kind": kind,
            "robot": robot,
            "seed": seed,
            "elastic_freedoms": 6 * per_joint,
            "noise": hammer.noise,
            "outside_library": any(drawn.effect == "unknown" for drawn in concealed),
            "effects": [
                {"effect": d.effect, "at": d.at, "parameters": d.parameters, **asdict(m)}
                for d, m in zip(concealed, measures, strict=True)
            ],
            "held_out": _held_out(truth, secret, held_out, arm, hammer),
            "salt": secrets.token_hex(16),  # so that answers cannot be found by trying hashes
        },
        indent=1,
    )
    seal = hashlib.sha256(answer.encode()).hexdigest()
    return Case(folder / "recordings", robot_toml, answer, seal)


def _conceal(
    kind: str,
    scene: Scene,
    secret: Secret,
    robot_toml: Path,
    hammer: Hammer,
    rng: np.random.Generator,
) -> tuple[list[Drawn], list[Detectability]]:
    """Effects added one after the other, each drawn until it shows clearly in the FRFs."""
    several = {"null": lambda *_: [], "pair": _pair, "drives": _drives}
    names = several[kind](scene, rng) if kind in several else [kind]
    concealed: list[Drawn] = []
    measures: list[Detectability] = []
    for name in names:
        for _ in range(ATTEMPTS):
            drawn = EFFECTS[name](scene, secret, rng)
            if kind == "drives" and not _joins(drawn, concealed):
                continue
            with_it = load_truth(robot_toml, drawn.secret.deviation)
            if not all(np.all(with_it.poles(q)[0].real < 0) for q in scene.poses):
                continue  # a feedback loop that would shake by itself
            without = load_truth(robot_toml, secret.deviation)
            measure = detectability(without, secret, with_it, drawn.secret, scene, hammer)
            if measure.shows(in_levels=name in NONLINEAR, in_time=name == "drift"):
                concealed.append(drawn)
                measures.append(measure)
                secret = drawn.secret
                break
        else:
            raise NothingShowsError(
                f"No {name} of this robot shows in the noise; take another seed."
            )
    return concealed, measures


def _pair(scene: Scene, rng: np.random.Generator) -> list[str]:
    """Two different effects of the robot's own physics, at most one of them nonlinear."""
    linear = [n for n in LINEAR if n != "transverse_compliance" or scene.per_joint == 1]
    first, second = (str(name) for name in rng.choice(linear, 2, replace=False))
    return [first, str(rng.choice(list(NONLINEAR)))] if rng.random() < 0.3 else [first, second]


def _drives(scene: Scene, rng: np.random.Generator) -> list[str]:
    """The same law several times."""
    return [str(rng.choice(list(NONLINEAR)))] * int(rng.integers(DRIVES[0], DRIVES[1] + 1))


def _joins(drawn: Drawn, concealed: list[Drawn]) -> bool:
    """Whether a law is at a joint of its own, and hardens or softens as the others do."""
    numbers = [next(iter(d.parameters.values())) for d in (drawn, *concealed)]
    signs = {v > 0 for v in numbers if isinstance(v, float)}
    return len(signs) == 1 and all(d.at != drawn.at for d in concealed)


def _record(
    truth: Truth,
    secret: Secret,
    poses: np.ndarray,
    folder: Path,
    hammer: Hammer,
    rng: np.random.Generator,
    handling: Handling,
    own: np.random.Generator,
) -> None:
    """Three axes and three force levels a pose; the first pose is often hit again at the end.

    `own` draws what `handling` leaves open, so that all else is the same in the laboratory.
    """
    visits = list(range(len(poses))) + ([0] if rng.random() < 0.5 else [])
    shots = [(f"{rng.choice(['+', '-'])}{a}", hammer.peak_n * k) for a in "xyz" for k in LEVELS]
    planned, readbacks = [], []
    common, axes = handling.common(own), [AXES.index(axis[1]) for axis, _ in shots]
    for number, index in enumerate(visits):
        scatter = hammer.readback_deg * rng.uniform(-1, 1, 6)
        readbacks.append(np.round(np.rad2deg(poses[index]) + scatter, 4))
        off = np.deg2rad(handling.readback_deg) * own.standard_normal(6)
        aims = [
            together(common[a], aim) for a, aim in zip(axes, handling.aims(axes, own), strict=True)
        ]
        there = np.deg2rad(readbacks[-1]) + off
        planned.append(HitVisit(there, shots, number / (len(visits) - 1), aims))
    rows = []
    counts: dict[tuple[int, str], int] = {}
    recorded = hit_poses(truth, secret, planned, hammer, rng)
    for index, readback, hits in zip(visits, readbacks, recorded, strict=True):
        for hit in hits:
            repeat = counts[index, hit.axis] = counts.get((index, hit.axis), 0) + 1
            rows.append((f"P{index + 1:02d}", readback, repeat, hit))
    write_recordings(folder, truth.joint_names, rows, hammer, "concealed case")


def _held_out(
    truth: Truth,
    secret: Secret,
    poses: list[tuple[str, np.ndarray]],
    arm: Arm,
    hammer: Hammer,
) -> dict:
    """True FRFs (real and imaginary; pose, response, hit, F) without noise and artefacts."""
    quiet = replace(hammer, noise=0.0, force_noise=0.0, record_s=2 * hammer.record_s)
    plain = Secret(secret.deviation, secret.ports, secret.loss_factor)
    visits = [once(q, hammer.peak_n) for _, q in poses]
    frequency, H = frfs(truth, plain, visits, quiet, arm.band_hz)
    return {
        "poses": [name for name, _ in poses],
        "frequency_hz": frequency.tolist(),
        "frf": [H.real.tolist(), H.imag.tolist()],
    }


def _made(kind: str, robot: str, seed: int, folder: Path, handling: Handling) -> Case:
    """A case; of another scene where nothing drawn for this one shows in its noise."""
    for attempt in range(SCENES):
        try:
            return make_case(kind, robot, seed + attempt * 1_000_003, folder, handling)
        except NothingShowsError:
            if attempt == SCENES - 1:
                raise
    raise AssertionError


def main() -> None:
    """Make cases of all kinds in turn, robots in turn; print the seals."""
    parser = argparse.ArgumentParser(prog="python -m planner.truth.cases", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cases", type=int, default=len(MIX))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--laboratory", action="store_true", help="no hit and no sensor errs")
    options = parser.parse_args()
    answers = options.folder / "answers"
    answers.mkdir(parents=True, exist_ok=True)
    handling = LABORATORY if options.laboratory else EVERYDAY
    order = np.random.default_rng(options.seed).permutation(options.cases)
    for number, kind in enumerate(order):
        name, robot = f"case_{number + 1:03d}", sorted(ARMS)[number % len(ARMS)]
        wanted = MIX[kind % len(MIX)], robot
        case = _made(*wanted, options.seed + number, options.folder / name, handling)
        (answers / f"{name}.json").write_text(case.answer, encoding="utf-8")
        print(f"{name} {case.seal}", flush=True)


if __name__ == "__main__":
    main()
