"""Concealed cases of industrial arms: recordings of robots whose folders lack something."""

import copy
import json
import zlib
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.proof.engine import Concealed, Made
from planner.truth import conceal
from planner.truth.arms import ARMS, Arm
from planner.truth.conceal import EVERYDAY, kinds
from planner.truth.hits import Hammer, write_predict
from planner.truth.imperfections import Imperfect, imperfect
from planner.truth.load import load_truth
from planner.truth.mishaps import OUTSIDERS as FEW_OUTSIDERS
from planner.truth.model import Truth
from planner.truth.outsiders import MORE_OUTSIDERS
from planner.truth.questions import Scored, lacking, question
from planner.truth.scene import PULSE_S, Scene
from planner.truth.secret import Secret, frfs, once, quiet_hits
from planner.truth.visits import Visits, record
from planner.truth.world import CLEAN, REAL, World

OUTSIDERS = (*FEW_OUTSIDERS, *MORE_OUTSIDERS)
SINGLES = tuple(kind for kind in EVERYDAY if kind not in OUTSIDERS)
# Peaks (N) of a middling hit: a tenth of a millimetre or two at the tool.
PEAK_N = {"kr10": 150.0, "kr210": 1200.0, "irb6640": 1200.0}
POSES, PREDICTED = 9, 4
DAMPING_S = 9.5e-4  # C = s K: 3 % at 10 Hz, as robots in milling cells have


def make(kind: str, seed: int, folder: Path, laboratory: bool = False) -> Made:
    """Write folder/robot and folder/recordings of a kind of case; robots in turn.

    Raises NothingShowsError for a seed of which nothing comes.
    """
    world = CLEAN if laboratory else REAL
    return make_case(kind, sorted(ARMS)[seed % len(ARMS)], seed, folder, world).made


@dataclass(frozen=True)
class Case:
    """A case as an outsider sees it, and what was made of it."""

    recordings: Path
    robot_toml: Path
    made: Made

    @property
    def answer(self) -> str:
        """JSON of what was concealed."""
        made = self.made
        effects = [{"effect": c.effect, "at": c.at, "parameters": c.parameters}
                   for c in made.concealed]  # fmt: skip
        return json.dumps({"robot": made.robot, "effects": effects, "held_out": made.held_out})


def make_case(kind: str, robot: str, seed: int, folder: Path, world: World = CLEAN) -> Case:
    """The same of one of `kinds` and a robot of ARMS; InputError for an unknown one."""
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
    scene = Scene(arm, load_truth(robot_toml, plain.deviation), per_joint, poses, hammer.peak_n)
    own = np.random.default_rng([seed, zlib.crc32(b"handling")])
    robot_is = imperfect(scene, plain, own) if world.imperfect else Imperfect(plain, ())
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
    reach_m = sum(float(np.linalg.norm(joint.xyz)) for joint in arm.joints)
    scored = Scored(
        robot_toml, arm.band_hz, reach_m, measured, visits.visits, poses[POSES:], hammer, quiet,
        again,
    )  # fmt: skip
    before = [plain, *(drawn.secret for drawn in concealed)]
    made = Made(
        robot,
        [
            Concealed(d.effect, d.at, {**d.parameters, "size": d.size},
                      partial(question, scored, lacking(measured, b, d.secret)))
            for b, d in zip(before, concealed, strict=False)
        ],
        robot_is.places,
        _held_out(truth, secret, held_out, arm, hammer),
    )  # fmt: skip
    return Case(folder / "recordings", robot_toml, made)


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
