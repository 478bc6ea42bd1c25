"""How long a person waits, with a peer in the same run: pytest -m slow tests/benchmarks -s"""

import numpy as np
import pytest

from planner.campaign.cell import Cell
from planner.campaign.config import load_campaign_config
from planner.demo import shipped
from planner.dynamics.gradient import Inertias, laplace, motion_slopes, moved, response
from planner.dynamics.simulation import Elasticity, Simulation
from planner.proof.arms import KR10
from planner.robot.robot import Robot
from planner.robot.virtual_joints import inertia_basis
from tests.support.direct_solution import direct_accelerance
from tests.support.timing import seconds

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cell():
    folder = shipped("kr240_plane")
    return Cell.load(
        folder / "robot" / "robot.toml", load_campaign_config(folder / "campaign.toml")
    )


def test_frf_against_a_direct_solution(cell):
    q, lines = cell.candidates.q[:1], np.linspace(4, 60, 800)
    simulation, m = cell.simulation, cell.simulation.elastic.matrices(q)
    ours = seconds(lambda: simulation.accelerance(q, lines))
    matrices = m.mass[0], simulation.damping, simulation.stiffness, m.hit[0], m.sensor[0]
    direct = seconds(lambda: direct_accelerance(*matrices, lines), 3)
    print(
        f"\nFRF 3 × 3 × 800 lines, 18 elastic rotations: {1e3 * ours:.2f} ms, "
        f"direct solution {1e3 * direct:.1f} ms, ratio {direct / ours:.0f}"
    )
    assert ours < direct


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

    def slopes(*inertias):
        motion = moved(m, springs, s)
        return motion.accelerance, motion_slopes(motion, springs, *inertias)

    ours = seconds(slopes, 15)
    whole = seconds(lambda: slopes(inertias), 15)
    peer = seconds(differences, 3)
    assert slopes()[1].shape == (9, 36, 3, 3, 127)
    print(
        f"\nFRFs and 36 derivatives, 9 poses × 127 lines: {1e3 * ours:.1f} ms (with 60 of inertias "
        f"{1e3 * whole:.1f} ms), forward differences {1e3 * peer:.0f} ms, ratio {peer / ours:.0f}"
    )
    assert ours < peer / 5
