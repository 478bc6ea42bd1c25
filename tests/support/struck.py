"""A system struck along three axes at two poses, for tests of what joints do in time."""

from pathlib import Path

import numpy as np

from planner.dataset.level_columns import Column, column
from planner.diagnosis.laws.equivalent_stiffness import System
from planner.dynamics.simulation import Simulation
from planner.recording.records import Hit
from planner.robot.robot import Robot
from tests.support.known_robots import KR210

VISITS = [0, 0, 0, 1, 1, 1]


def struck_robot(folder: Path) -> tuple[System, list[Column]]:
    """KR210 at two poses, and the columns of VISITS: one hit along each axis at each."""
    simulation = Simulation(Robot.load(KR210.write(folder)))
    m, springs = simulation.elastic.matrices(KR210.poses(2, 8)), simulation.elasticity
    ports = tuple(f"joint_{i}" for i in range(1, 7))
    system = System(m.mass, m.geometric, m.hit, m.sensor, springs, ports, np.arange(6))
    t, rng = np.arange(1024) / 400.0, np.random.default_rng(1)
    columns = []
    for axis in range(3):
        force = 900 * np.sin(np.pi * np.clip((t - 0.06) / 0.01, 0, 1)) ** 2
        force = force + 0.1 * rng.standard_normal(1024)
        hit = Hit(Path("hit"), "+" + "xyz"[axis], 400.0, force, rng.standard_normal((3, 1024)))
        columns.append(column((hit,), axis, 0, 1024, (5.0, 50.0), 4.0, 0.0))
    return system, columns * 2
