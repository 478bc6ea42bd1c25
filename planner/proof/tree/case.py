"""One concealed case from a seed: robot, truth, effects, recordings, answer."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from planner.proof.tree import files
from planner.proof.tree.blueprint import assemble
from planner.proof.tree.chain import Chain, draw_chain, recorded
from planner.proof.tree.deck import draw_effects
from planner.proof.tree.effects import Effect
from planner.proof.tree.hits import Clock, Hit, draw_clock, draw_hits
from planner.proof.tree.layouts import LAYOUTS, Robot
from planner.proof.tree.outsiders import controller, stable
from planner.proof.tree.records import Motion, contour, linear_records, marched, rumble
from planner.proof.tree.stating import Truth, draw_poses, draw_robot, draw_truth
from planner.proof.tree.system import System

WANTED = 4  # unseen poses


@dataclass
class Case:
    """All of a case. Poses in rad; `law` is of the gear named `gear`, or None."""

    seed: int
    kind: str
    robot: Robot
    truth: Truth
    poses: np.ndarray
    wanted: np.ndarray
    readback: np.ndarray
    clock: Clock
    hits: list[Hit]
    effects: list[Effect]
    law: Any
    gear: str
    motions: list[Motion]
    linear: list[Motion]  # of the same hits without the nonlinear law, where there is one
    chain: Chain
    noises: list[np.ndarray]

    def of_pose(self, pose: int) -> list[Hit]:
        """Hits at a pose."""
        return [h for h in self.hits if h.pose == pose]

    def warmth(self, order: float) -> float:
        """How far drift has come (0 to 1) at a hit's number."""
        pace = max((e.memory_per_hit for e in self.effects), default=0.0)
        return 1 - float(np.exp(-order / pace)) if pace else 0.0


def system_of(truth: Truth, effects: list[Effect], q: np.ndarray, warmth: float = 0.0) -> System:
    """The true robot's linear system with effects, at true angles q (rad)."""
    plan = truth.plan(q)
    for effect in effects:
        effect.apply(plan, q, warmth)
    return assemble(plan, q)[0].reduced()


def _allowed(truth: Truth, effects: list[Effect], poses: np.ndarray) -> bool:
    """Nothing falls over, and no controller makes it ring by itself."""
    systems = [system_of(truth, effects, q) for q in poses]
    upright = all(s.modes()[0][0] > 2.0 for s in systems)
    return upright and (not any(controller(e) for e in effects) or stable(systems))


def make_case(seed: int, kind: str) -> Case:
    """Draw and simulate a case."""
    rng = np.random.default_rng([seed, 60013])
    robot = draw_robot(rng, str(rng.choice(list(LAYOUTS))))
    truth = draw_truth(rng, robot)
    number = int(rng.integers(5, 11))
    stated_at = draw_poses(rng, robot, number + WANTED)
    sd = np.radians(rng.uniform(0.03, 0.1))
    error = sd * (
        0.5 * rng.normal(size=len(robot.joints)) + rng.normal(size=(number, len(robot.joints)))
    )
    poses = np.radians(np.round(np.degrees(stated_at[:number]), 4)) + error
    effects: list[Effect] = []
    for _ in range(60):
        effects = draw_effects(rng, kind, truth, poses)
        if _allowed(truth, effects, stated_at):
            break
    clock = draw_clock(rng)
    hits = draw_hits(rng, number, robot.payload, clock.rate)
    nobody = Chain(np.eye(3), np.zeros(3), 1, 0, 0, 1, 24, (1, 1), 0)
    case = Case(
        seed, kind, robot, truth, poses, stated_at[number:], poses - error, clock, hits, effects,
        None, "", [], [], nobody, [],
    )  # fmt: skip
    _simulate(rng, case)
    artefact = {key: value for e in effects for key, value in e.chain.items()}
    case.chain = draw_chain(rng, case.motions, artefact)
    return case


def _simulate(rng: np.random.Generator, case: Case) -> None:
    """Fill in what the sensor frame really did in every hit."""
    bent = next((e for e in case.effects if e.law is not None), None)
    s, _ = contour(case.clock)
    if bent is None:
        for pose, q in enumerate(case.poses):
            hits = case.of_pose(pose)
            case.motions += linear_records(_frfs(case, q, hits, s), hits, case.clock)
        return
    systems = [system_of(case.truth, case.effects, q) for q in case.poses]
    case.gear = f"joint_{bent.joint + 1}:gear"
    case.linear, gear = marched(systems, case.hits, case.clock, case.gear, None)
    top = np.max(np.abs(gear), axis=2)
    angle, rate = np.quantile(top, 0.7, axis=0)
    weights = np.array([systems[h.pose].weight[case.gear] for h in case.hits])
    case.law = bent.law.law(float(angle), float(rate), weights)
    case.motions, _ = marched(systems, case.hits, case.clock, case.gear, case.law)
    bent.parameters.update(bent.law.told)


def _frfs(case: Case, q: np.ndarray, hits: list[Hit], s: np.ndarray) -> np.ndarray:
    """FRFs of a pose, or of each hit where the robot drifts: a parabola through three moments."""
    if not any(e.memory_per_hit for e in case.effects):
        return system_of(case.truth, case.effects, q).frf(s)
    warm = np.array([case.warmth(h.order) for h in hits])
    nodes = np.array([warm.min(), (warm.min() + warm.max()) / 2, warm.max()])
    at = np.array([system_of(case.truth, case.effects, q, w).frf(s) for w in nodes])
    weights = np.ones((len(hits), 3))
    for i in range(3):
        for j in np.delete(np.arange(3), i):
            weights[:, i] *= (warm - nodes[j]) / (nodes[i] - nodes[j])
    return np.einsum("hn,nfij->hfij", weights, at)


def write_case(case: Case, folder: Path) -> None:
    """Robot and recordings; fills in the case's noises. The answer is no part of it."""
    rng = np.random.default_rng([case.seed, 811])
    robot_folder, recordings = folder / "robot", folder / "recordings"
    robot_folder.mkdir(parents=True, exist_ok=True)
    (recordings / "data").mkdir(parents=True, exist_ok=True)
    files.write_urdf(robot_folder / "robot.urdf", case.robot)
    chances = {}
    if rng.integers(2):
        chances = {
            "hits": {"angle_sd_deg": 2.0, "offset_sd_mm": 5.0},
            "sensor": {"gain_sd_percent": 2.0, "cross_axis_sd_percent": 3.0, "mounting_sd_deg": 1.5,
                       "position_sd_mm": 7.0},
            "readback": {"joint_sd_deg": 0.08},
        }  # fmt: skip
    files.write_toml(robot_folder / "robot.toml", case.robot, chances)
    files.write_tables(recordings, case.robot, case.readback, case.hits, case.wanted)
    for pose, q in enumerate(case.poses):
        some = [i for i, h in enumerate(case.hits) if h.pose == pose]
        system = system_of(case.truth, case.effects, q)
        trembles = rumble(rng, system, case.clock, len(some))
        for i, tremble in zip(some, trembles, strict=True):
            force, answer, noise = recorded(rng, case.chain, case.motions[i], tremble, case.clock)
            case.noises.append(noise)
            path = recordings / files.hit_file(case.hits[i])
            files.write_hit(path, case.hits[i], case.clock, force, answer)


__all__ = ["Case", "make_case", "system_of", "write_case"]
