"""Simulated hits on a robot that deviates from its folder, as FRFs, from the other engine."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.dynamics.simulation import Simulation
from planner.frf.estimator import estimate
from planner.frf.frf import Frf
from planner.recording.records import Hit
from planner.robot.robot import Robot
from planner.truth.deviation import AttachedMass, AttachedResonator, BentLink, Deviation, Spring
from planner.truth.hits import Hammer, simulate_hit
from planner.truth.load import load_truth
from tests.support.known_robots import KnownRobot

RATE_1_S = 1.5  # exponential window: decays are over when the record ends


def hidden(
    robot: KnownRobot,
    folder: Path,
    seed: int,
    extra: tuple[Spring, ...] = (),
    added: tuple[AttachedMass, ...] = (),
    loose: tuple[AttachedResonator, ...] = (),
    channel: Callable[[np.ndarray], np.ndarray] = lambda a: a,
    poses: int = 8,
    said: str = "",
    beams: tuple[BentLink, ...] = (),
) -> tuple[list[Frf], np.ndarray, Simulation]:
    """FRFs of 9 hits a pose, poses (n, 6) in rad, and the simulation that knows of nothing.

    Both engines read robot.toml, which begins with what is `said`.
    """
    path = robot.write(folder / "robot")
    path.write_text(f"{said}\n{path.read_text()}")
    scatter = Deviation(seed, stiffness=0.1, damping=0.2, inertia=0.04, com_m=0.005)
    hides = replace(scatter, extra=extra, added=added, resonators=loose, beams=beams)
    truth = load_truth(path, hides)
    hammer, q, out = Hammer(), robot.poses(poses, seed), []
    for number, row in enumerate(q):
        rng, hits = np.random.default_rng([seed, number]), []
        for axis in ("+x", "+y", "+z") * 3:
            hit = simulate_hit(truth, row, axis, hammer, rng)
            seen = channel(hit.acceleration_m_s2)
            hits.append(Hit(Path("hit"), axis, hammer.sampling_rate_hz, hit.force_n, seen))
        out.append(estimate(tuple(hits), robot.band_hz, exponential_rate_1_s=RATE_1_S))
    return out, q, Simulation(Robot.load(path))
