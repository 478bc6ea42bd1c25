"""A robot whose FRFs are just those of its simulation, as a diagnosis sees it."""

from pathlib import Path

import numpy as np

from planner.diagnosis.linear.problem import Problem
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.robot.robot import Robot
from tests.support.known_robots import KR10

LINES = np.linspace(6.0, 60.0, 20)


def exact_problem(folder: Path) -> Problem:
    """The KR10-like robot at two poses, known to 1 %."""
    simulation = Simulation(Robot.load(KR10.write(folder)))
    q, nothing = KR10.poses(2, 5), np.full((3, 3, len(LINES)), np.nan)
    frfs = tuple(
        Frf(LINES, h, 1e-4 * np.abs(h) ** 2, nothing, (3, 3, 3), (6.0, 60.0))
        for h in simulation.accelerance(q, LINES)
    )
    return Problem(frfs, q, simulation, (6.0, 60.0))
