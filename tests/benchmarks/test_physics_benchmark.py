"""Gradients, with a peer in the same run: pytest -m slow tests/benchmarks -s"""

import numpy as np
import pytest

from planner.dynamics.gradient import Inertias, laplace, response, response_gradient
from planner.dynamics.simulation import Elasticity, Simulation
from planner.robot.robot import Robot
from planner.robot.virtual_joints import inertia_basis
from tests.support.known_robots import KR10
from tests.support.timing import seconds

pytestmark = pytest.mark.slow


def test_gradient_against_differences(tmp_path):
    """9 poses, 127 lines, 36 parameters."""
    simulation = Simulation(Robot.load(KR10.write(tmp_path, 3)))
    q, s = KR10.poses(9), laplace(np.tile(np.linspace(5, 200, 127), (9, 1)))
    m, springs = simulation.elastic.matrices(q), simulation.elasticity
    basis = np.tile(inertia_basis(), (6, 1, 1, 1))
    inertias = Inertias(simulation.elastic.body_jacobians(q), basis)

    def differences():
        before = response(m, springs, s)
        for kind in range(2):
            for j in range(18):
                values = [springs.stiffness.copy(), springs.damping.copy()]
                values[kind][j] *= 1 + 1e-6
                _ = response(m, Elasticity(*values, springs.loss_factor), s) - before

    ours = seconds(lambda: response_gradient(m, springs, s), 15)
    whole = seconds(lambda: response_gradient(m, springs, s, inertias=inertias), 15)
    peer = seconds(differences, 3)
    assert response_gradient(m, springs, s)[1].shape == (9, 36, 3, 3, 127)
    print(
        f"\nFRFs and 36 derivatives, 9 poses × 127 lines: {1e3 * ours:.1f} ms (with 60 of inertias "
        f"{1e3 * whole:.1f} ms), forward differences {1e3 * peer:.0f} ms, ratio {peer / ours:.0f}"
    )
    assert ours < peer / 5
