"""Concealed cases: recordings of robots whose folders lack something, and the sealed answers.

    python -m planner.truth.cases FOLDER --cases 12 --seed 7

writes FOLDER/case_001/{robot,recordings} …, prints the hash of every answer, and puts the answers
into FOLDER/answers. Nothing in a case's folder tells what was concealed.
"""

import argparse
import copy
import hashlib
import json
import secrets
import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from planner.errors import InputError
from planner.truth import conceal
from planner.truth.arms import ARMS, Arm
from planner.truth.conceal import NothingShowsError, kinds
from planner.truth.deviation import Scatter
from planner.truth.hits import Hammer, SimulatedHit, write_predict
from planner.truth.imperfections import Imperfect, imperfect
from planner.truth.load import load_truth
from planner.truth.model import Truth
from planner.truth.nats import Conditions, Lacking, lacking, nats
from planner.truth.scene import PULSE_S, Drawn, Scene
from planner.truth.secret import Secret, frfs, once, quiet_hits
from planner.truth.visits import Visits, record
from planner.truth.world import CLEAN, REAL, World

MORE = ("null", "pair", "pair")  # more often than others: there are many kinds of pairs
# Peaks (N) of a middling hit: a tenth of a millimetre or two at the tool.
PEAK_N = {"kr10": 150.0, "kr210": 1200.0, "irb6640": 1200.0}
POSES, PREDICTED = 9, 4
DAMPING_S = 9.5e-4  # C = s K: 3 % at 10 Hz, as robots in milling cells have
SCENES = 5


@dataclass(frozen=True)
class Case:
    """A case as an outsider sees it, and its answer; `seal` is the SHA-256 of the answer's text."""

    recordings: Path
    robot_toml: Path
    answer: str
    seal: str


def make_case(kind: str, robot: str, seed: int, folder: Path, world: World = CLEAN) -> Case:
    """Write folder/robot and folder/recordings of one of `kinds` and a robot of ARMS.

    Raises InputError for an unknown kind or robot.
    """
    if kind not in kinds(world) or robot not in ARMS:
        raise InputError(f"No case {kind} of robot {robot}; kinds are {', '.join(kinds(world))}.")
    rng = np.random.default_rng([seed, zlib.crc32(f"{kind} {robot}".encode())])
    arm = replace(ARMS[robot], damping_s=DAMPING_S)
    per_joint = 1 if kind == "transverse_compliance" else int(rng.choice([1, 3]))
    robot_toml = arm.write(folder / "robot", per_joint)
    plain = Secret(world.scatter.of(int(rng.integers(2**31))))
    low, high = np.deg2rad(np.array(arm.joints_deg)).T
    poses = rng.uniform(low, high, (POSES + PREDICTED, 6))
    hammer = Hammer(PEAK_N[robot], PULSE_S, noise=float(rng.uniform(0.005, 0.03)))
    hammer = replace(hammer, oversampling=world.oversampling)
    truth = load_truth(robot_toml, plain.deviation)
    scene = Scene(arm, truth, per_joint, poses, hammer.peak_n)
    own = np.random.default_rng([seed, zlib.crc32(b"handling")])
    robot_is = Imperfect(plain, ())
    if world.imperfect:
        robot_is = imperfect(scene, plain, own)
        plain = robot_is.secret
        scene = replace(scene, truth=load_truth(robot_toml, plain.deviation))
    concealed = conceal.concealed(kind, scene, plain, robot_toml, hammer, world, rng)
    secret = concealed[-1].secret if concealed else plain
    truth = load_truth(robot_toml, secret.deviation)
    measured = replace(secret, chain=world.handling.chain(own))
    visits = Visits.planned(poses[:POSES], hammer, world.handling, rng, own)
    again = copy.deepcopy(rng)
    quiet = quiet_hits(truth, measured, visits.visits, hammer, rng)
    hammer = world.handling.floor(hammer, [hit for hits in quiet for hit in hits], own)
    record(folder / "recordings", truth, measured, visits, quiet, hammer, rng)
    held_out = [(f"H{i + 1:02d}", q) for i, q in enumerate(poses[POSES:])]
    write_predict(folder / "recordings", truth.joint_names, held_out, hammer.peak_n)
    conditions = Conditions(visits.visits, arm.band_hz, world.scatter, world.handling, hammer)
    answer = json.dumps(
        {
            "kind": kind,
            "robot": robot,
            "seed": seed,
            "elastic_freedoms": 6 * per_joint,
            "noise": hammer.noise,
            "rumble_m_s2": hammer.rumble_m_s2,
            "outside_library": any(drawn.effect == "unknown" for drawn in concealed),
            "effects": _effects(concealed, plain, conditions, robot_toml, measured, quiet, again),
            "imperfections": [{"effect": e, "at": at} for e, at in robot_is.places],
            "held_out": _held_out(truth, secret, held_out, arm, hammer),
            "salt": secrets.token_hex(16),  # so that answers cannot be found by trying hashes
        },
        indent=1,
    )
    seal = hashlib.sha256(answer.encode()).hexdigest()
    return Case(folder / "recordings", robot_toml, answer, seal)


def _effects(
    concealed: Sequence[Drawn],
    plain: Secret,
    conditions: Conditions,
    robot_toml: Path,
    measured: Secret,
    quiet: Sequence[Sequence[SimulatedHit]],
    rng: np.random.Generator,
) -> list[dict[str, Any]]:
    """What was concealed, and how much the recordings tell of it; `rng` as for the recordings."""
    found = []
    whole = load_truth(robot_toml, measured.deviation)
    for k, drawn in enumerate(concealed):
        before = concealed[k - 1].secret if k else plain
        secret = lacking(measured, before, drawn.secret)
        truth = load_truth(robot_toml, secret.deviation)
        hits = quiet_hits(truth, secret, conditions.visits, conditions.hammer, copy.deepcopy(rng))
        most = _at_most(drawn, conditions.scatter)
        told = nats(conditions, whole, measured, quiet, Lacking(truth, secret, hits, most))
        said = {"effect": drawn.effect, "at": drawn.at, "parameters": drawn.parameters}
        found.append({**said, "size": drawn.size, **asdict(told)})
    return found


def _at_most(drawn: Drawn, scatter: Scatter) -> float:
    """Nats of a joint's own stiffness: it scatters anyway, and this is what so far off costs."""
    if drawn.effect != "joint_stiffness":
        return float("inf")
    off = np.log(float(str(drawn.parameters["factor"])))
    return float(off**2 / 2 * (1 / scatter.stiffness**2 + 1 / scatter.damping**2))


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


def _made(kind: str, robot: str, seed: int, folder: Path, world: World) -> Case:
    """A case; of another scene where nothing drawn for this one shows in its noise."""
    for attempt in range(SCENES):
        try:
            return make_case(kind, robot, seed + attempt * 1_000_003, folder, world)
        except NothingShowsError:
            if attempt == SCENES - 1:
                raise
    raise AssertionError


def main() -> None:
    """Make cases of all kinds in turn, robots in turn; print the seals."""
    parser = argparse.ArgumentParser(prog="python -m planner.truth.cases", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cases", type=int, default=25)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--laboratory", action="store_true", help="no hit and no sensor errs")
    options = parser.parse_args()
    world = CLEAN if options.laboratory else REAL
    answers = options.folder / "answers"
    answers.mkdir(parents=True, exist_ok=True)
    mix = [k for k in (*kinds(world), *MORE) if k != "drives"]
    order = np.random.default_rng(options.seed).permutation(options.cases)
    for number, kind in enumerate(order):
        name, robot = f"case_{number + 1:03d}", sorted(ARMS)[number % len(ARMS)]
        wanted = mix[kind % len(mix)], robot
        case = _made(*wanted, options.seed + number, options.folder / name, world)
        (answers / f"{name}.json").write_text(case.answer, encoding="utf-8")
        print(f"{name} {case.seal}", flush=True)


if __name__ == "__main__":
    main()
