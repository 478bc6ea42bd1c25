"""Derivatives of FRFs against finite differences."""

import dataclasses

import numpy as np
import pytest

from planner.dynamics.gradient import (
    Inertias,
    laplace,
    motion_slopes,
    moved,
    response,
)
from planner.dynamics.simulation import Simulation
from planner.proof.arms import KR10
from planner.robot.robot import Robot
from planner.robot.virtual_joints import inertia_basis

LINES = np.linspace(6, 180, 25)
STEP = 1e-5


def simulated(tmp_path, per_joint=2, loss=0.0):
    path = KR10.write(tmp_path, per_joint)
    text = path.read_text().replace("damping =", f"loss_factor = {loss}\ndamping =")
    path.write_text(text)
    return Simulation(Robot.load(path))


def everything(tmp_path, loss, rate):
    simulation = simulated(tmp_path, loss=loss)
    q = KR10.poses(3)
    elastic = simulation.elastic
    basis = np.tile(inertia_basis(), (len(elastic.bodies), 1, 1, 1))
    inertias = Inertias(elastic.body_jacobians(q), basis)
    s = laplace(np.tile(LINES, (3, 1)), np.full(3, rate))
    return simulation, elastic.matrices(q), inertias, s


def mass_change(inertias, values):
    """Change (n, e, e) of M for values (B · 10,) of the bodies' parameters."""
    weighted = np.einsum("bpij,bp->bij", inertias.basis, values.reshape(inertias.basis.shape[:2]))
    jacobians = inertias.jacobians
    return np.sum(np.swapaxes(jacobians, 2, 3) @ weighted @ jacobians, axis=1)


@pytest.mark.parametrize(("loss", "rate"), [(0.0, 0.0), (0.08, 0.0), (0.0, 7.0)])
def test_springs_against_finite_differences(tmp_path, loss, rate):
    simulation, matrices, _, s = everything(tmp_path, loss, rate)
    elasticity = simulation.elasticity
    motion = moved(matrices, elasticity, s)
    h, gradient = motion.accelerance, motion_slopes(motion, elasticity)
    assert np.array_equal(h, response(matrices, elasticity, s))
    kinds = ("stiffness", "damping", "loss_factor")[: 3 if loss else 2]
    assert gradient.shape == (3, 12 * len(kinds), 3, 3, LINES.size)
    for k, kind in enumerate(kinds):
        for j in range(12):
            sides = []
            for step in (STEP, -STEP):
                values = getattr(elasticity, kind).copy()
                values[j] *= np.exp(step)
                sides.append(
                    response(matrices, dataclasses.replace(elasticity, **{kind: values}), s)
                )
            expected = (sides[0] - sides[1]) / (2 * STEP)
            found = gradient[:, 12 * k + j]
            assert np.abs(found - expected).max() < 1e-6 * np.abs(h).max()
            assert np.abs(found - expected).max() < 1e-3 * np.abs(found).max()


def test_inertias_against_finite_differences(tmp_path):
    """All ten parameters of every body; the mass matrix is linear in them, exactly."""
    simulation, matrices, inertias, s = everything(tmp_path, 0.0, 0.0)
    elasticity, nominal = simulation.elasticity, simulation.elastic.inertia
    motion = moved(matrices, elasticity, s)
    h, gradient = motion.accelerance, motion_slopes(motion, elasticity, inertias)
    whole = mass_change(inertias, nominal.ravel())
    np.testing.assert_allclose(whole, matrices.mass, atol=1e-12 * np.abs(matrices.mass).max())
    for j in range(nominal.size):
        step = np.zeros(nominal.size)
        step[j] = 1e-4 * (1e-2 + abs(nominal.flat[j]))
        sides = [
            response(dataclasses.replace(matrices, mass=matrices.mass + change), elasticity, s)
            for change in (mass_change(inertias, step), mass_change(inertias, -step))
        ]
        expected = (sides[0] - sides[1]) / (2 * step[j])
        found = gradient[:, 24 + j]
        assert np.abs(found - expected).max() < 1e-6 * max(np.abs(h).max(), np.abs(found).max())


def test_changed_inertia_is_the_linear_change(tmp_path):
    simulation, matrices, inertias, _ = everything(tmp_path, 0.0, 0.0)
    change = 0.05 * np.random.default_rng(1).standard_normal((6, 10)) * simulation.elastic.inertia
    other = simulation.changed(simulation.elasticity, change)
    mass = other.elastic.matrices(KR10.poses(3)).mass
    expected = matrices.mass + mass_change(inertias, change.ravel())
    np.testing.assert_allclose(mass, expected, atol=1e-12 * np.abs(mass).max())


def test_window_shifts_the_laplace_variable(tmp_path):
    """H at iω + rate is the transform of e^(−rate·t) h(t): checked through the poles."""
    simulation, matrices, _, s = everything(tmp_path, 0.0, 7.0)
    solved = simulation.poles(KR10.poses(3))
    expected = np.einsum(
        "nkij,nkf->nijf", solved.residues, 1 / (s[:, None] - solved.poles[..., None])
    )
    expected = expected * (s**2)[:, None, None]
    found = response(matrices, simulation.elasticity, s)
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(found).max())


MORE = """
[[effects]]
effect = "soft floor and a joint whose stiffness goes with its angle"
at = ""
[[effects.compliance]]
joint = "base"
axis = [1, 0, 0]
stiffness = 1e6
damping = 1e2
[[effects.harmonic]]
joint = "joint_2"
order = 2
cosine = 4e4
sine = -3e4
"""


def test_slopes_by_joint_angles_are_those_of_the_whole_response(tmp_path):
    path = KR10.write(tmp_path, 2)
    path.write_text(f"geometric_stiffness = false\n{path.read_text()}{MORE}")
    simulation, q = Simulation(Robot.load(path)), KR10.poses(3)
    elastic, springs, s = simulation.elastic, simulation.elasticity, laplace(np.tile(LINES, (3, 1)))
    turned = moved(elastic.with_slopes(q), springs, s)
    for joint, turn in enumerate(STEP * np.eye(6)):
        there, back = (response(elastic.matrices(p), springs, s) for p in (q + turn, q - turn))
        change = (there - back) / (2 * STEP)
        largest = np.abs(change).max()
        assert largest > 0
        assert turned.by_angle[:, joint] == pytest.approx(change, abs=1e-6 * largest)
