"""Natural frequencies of robots over joints 2, 3 and 5: MuJoCo's as truth, the planner's as cheap.

Truth has other stiffnesses and inertias and a base that gives way; the simulation has the robot
folder's. In Hz, joints over the workspace that the robot's own description states.
"""

import tempfile
from pathlib import Path

import numpy as np

from planner.dynamics.simulation import Simulation
from planner.robot.robot import Robot
from planner.truth.deviation import Deviation, Spring
from planner.truth.load import load_truth
from tests.support.fusion_problems import Problem
from tests.support.known_robots import KNOWN_ROBOTS

MOVED = (1, 2, 4)


def robot_problem(name: str, mode: int, seed: int) -> Problem:
    """Frequency of one mode (from 0) of a known robot."""
    known = KNOWN_ROBOTS[name]
    toml = known.write(Path(tempfile.mkdtemp()) / name, 2)
    base = tuple(Spring("base", axis, 1.5e7, 1e4) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    truth = load_truth(toml, Deviation(seed, 0.2, 0.1, 0.05, 0.01, base))
    simulation = Simulation(Robot.load(toml))
    box = np.deg2rad(known.joints_deg)

    def joints(x: np.ndarray) -> np.ndarray:
        q = np.tile(box.mean(axis=1), (len(x), 1))
        rows = list(MOVED)
        q[:, rows] = box[rows, 0] + x * np.ptp(box[rows], axis=1)
        return q

    def high(x: np.ndarray) -> np.ndarray:
        return np.array([truth.modes(q, mode + 1)[0][mode] for q in joints(x)])

    def low(x: np.ndarray) -> np.ndarray:
        return simulation.modes(joints(x), mode + 1).frequency_hz[:, mode]

    return Problem(3, high, low)


ROBOT_PROBLEMS = {
    "kr10 mode 1": lambda: robot_problem("kr10", 0, 1),
    "kr210 mode 2": lambda: robot_problem("kr210", 1, 2),
    "irb6640 mode 3": lambda: robot_problem("irb6640", 2, 3),
}
