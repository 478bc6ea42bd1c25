"""Gradients and identification, with a peer in the same run: pytest -m slow tests/benchmarks -s"""

import numpy as np
import pytest
from scipy.optimize import least_squares

from planner.dynamics.gradient import Inertias, laplace, response, response_gradient
from planner.dynamics.simulation import Elasticity, Simulation
from planner.effects.parameters import Priors, parametrise
from planner.identification.identify import identify
from planner.measurement.measured_frfs import stack
from planner.robot.robot import Robot
from planner.robot.virtual_joints import inertia_basis
from planner.truth.load import load_truth
from tests.support.known_robots import KR10
from tests.support.measured_frfs import birk_bounds, birk_folder, measured_frfs
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


@pytest.mark.filterwarnings("ignore")  # the peer wanders off
def test_identification_against_scipy(tmp_path):
    """24 parameters from the same random starts: SciPy's trust region on the plain residual."""
    folder = birk_folder(tmp_path)
    simulation, truth = Simulation(Robot.load(folder)), load_truth(folder)
    priors, q = Priors(bounds=birk_bounds()), KR10.poses(9)
    frfs = measured_frfs(truth, q, np.arange(5.0, 200.0, 1 / 0.64), 0.03)
    p = parametrise(simulation, priors)
    low, high = np.log([(x.lower, x.upper) for x in p.parameters]).T
    measured = stack(frfs, (5.0, 200.0), 160, 0.003)
    matrices = simulation.elastic.matrices(q)
    weight = np.sqrt(2) / measured.sd

    def residual(theta):
        h = response(matrices, p.elasticity(theta), measured.s)
        return (weight * (h - measured.accelerance)).ravel().view(float)

    def jacobian(theta):
        slope = response_gradient(matrices, p.elasticity(theta), measured.s)[1]
        slope = np.einsum("npijf,pk->knijf", weight[:, None] * slope, p.spread)
        return slope.reshape(len(theta), -1).view(float).T

    reached, taken = [0, 0], [0.0, 0.0]
    for seed in range(5):
        start = np.random.default_rng(seed).uniform(low, high)

        def peer(start=start):
            return least_squares(residual, start, jacobian, x_scale="jac", max_nfev=100)

        def ours(start=start):
            return identify(frfs, q, simulation, priors, starts=np.exp(start)[None])

        taken[0] += seconds(ours, 1)
        taken[1] += seconds(peer, 1)
        reached[0] += ours().misfit < 1.05
        reached[1] += 2 * peer().cost / residual(start).size < 1.05
    print(
        f"\n24 parameters, one random start: noise reached {reached[0]} of 5 times, "
        f"{taken[0] / 5:.2f} s each; SciPy {reached[1]} of 5, {taken[1] / 5:.2f} s"
    )
    assert reached[0] >= 4
    assert reached[0] > reached[1]
