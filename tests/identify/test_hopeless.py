"""A simulation that lacks physics is not followed to the end where nobody asks for it."""

from dataclasses import replace

import numpy as np
import pytest

from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.identification import effort
from planner.identification.identify import identify
from planner.identification.parameters import CAD_INERTIAS
from planner.identification.staged_problem import Progress
from planner.robot.robot import Robot
from tests.support.known_robots import KR10

LINES = np.linspace(5.0, 60.0, 60)


@pytest.mark.parametrize(("hopeless", "followed"), [(4.0, False), (np.inf, True)])
def test_what_is_missing_costs_few_steps(tmp_path, monkeypatch, hopeless, followed):
    """Of FRFs that no spring explains: scaled anew at each pose."""
    monkeypatch.setattr(effort, "HOPELESS_STEPS", 2)
    simulation, q = Simulation(Robot.load(KR10.write(tmp_path))), KR10.poses(3, seed=3)
    nothing = np.full((3, 3, len(LINES)), np.nan)
    frfs = [
        Frf(LINES, h * scale, np.abs(0.003 * h) ** 2, nothing, (3,) * 3, (5.0, 60.0))
        for h, scale in zip(simulation.accelerance(q, LINES), (0.5, 1.0, 2.0), strict=True)
    ]
    told: list[Progress] = []
    quick = replace(effort.QUICK, hopeless=hopeless)
    found = identify(
        frfs, q, simulation, CAD_INERTIAS, starts=1, effort=quick, progress=told.append
    )
    last = max(p.iteration for p in told if p.stage == "all lines")
    assert found.misfit > 4.0
    assert (last > 2) == followed
