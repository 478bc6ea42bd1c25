"""LSFD residues, out-of-band terms, rank one, and the gradient of the fit."""

import numpy as np
import pytest

from planner.frf.synthesis import accelerance
from planner.modal.fit_data import Data
from planner.modal.refine import refine, shared_error
from planner.modal.residues import (
    Residues,
    basis,
    basis_slope,
    laplace,
    lsfd,
    rank_one,
    realign,
    synthesize,
)
from tests.support.modal_systems import exact_frf, random_system

LINES = np.arange(4.0, 60.0, 0.2)


def test_synthesis_is_that_of_the_shared_formula():
    system = random_system(np.random.default_rng(0), 4, complexity=0.7)
    residues = Residues(np.moveaxis(system.residues, 0, -1), np.zeros((3, 3, 0)))
    mine = synthesize(laplace(LINES), system.poles, residues)
    np.testing.assert_allclose(mine, accelerance(LINES, system.poles, system.residues), rtol=1e-12)


def test_lsfd_recovers_residues_and_rest():
    system = random_system(np.random.default_rng(1), 4, pair=0.02, complexity=0.5)
    lower, upper = np.full((3, 3), 0.003 + 0.001j), np.full((3, 3), 1e-7 - 2e-8j)
    omega = 2 * np.pi * LINES
    h = exact_frf(system, LINES) + lower[..., None] - omega**2 * upper[..., None]
    found = lsfd(LINES, h, system.poles)
    np.testing.assert_allclose(
        np.moveaxis(found.residue, -1, 0), system.residues, rtol=1e-8, atol=1e-14
    )
    np.testing.assert_allclose(found.lower, lower, rtol=1e-7)
    np.testing.assert_allclose(found.upper, upper, rtol=1e-7)


def test_weight_ignores_spoiled_lines():
    system = random_system(np.random.default_rng(3), 3)
    h = exact_frf(system, LINES)
    weight = np.ones(h.shape)
    h[..., 50:60] = 100.0
    weight[..., 50:60] = 0.0
    found = lsfd(LINES, h, system.poles, weight)
    np.testing.assert_allclose(
        np.moveaxis(found.residue, -1, 0), system.residues, rtol=1e-7, atol=1e-13
    )


def test_slope_is_the_derivative():
    lines, poles = laplace(LINES, 0.4), np.array([-1.0 + 60j, -3.0 + 200j])
    residue = np.array([0.3 - 1j, -0.2 + 0.5j])

    def response(p):
        up, down = basis(lines, p, False).reshape(2, 2, -1)
        return residue.real @ up + residue.imag @ down

    first, second = basis_slope(lines, poles).reshape(2, 2, -1)
    for k in range(2):
        h = 1e-4
        step = h * np.eye(2)[k]
        by_real = (response(poles + step) - response(poles - step)) / (2 * h)
        by_imag = (response(poles + 1j * step) - response(poles - 1j * step)) / (2 * h)
        r = residue[k]
        np.testing.assert_allclose(by_real, r.real * first[k] + r.imag * second[k], rtol=1e-6)
        np.testing.assert_allclose(by_imag, r.real * second[k] - r.imag * first[k], rtol=1e-6)


def test_refinement_reaches_the_minimum():
    """χ² at the solution is stationary in every pole, by differences of separate fits."""
    rng = np.random.default_rng(4)
    system = random_system(rng, 3, damping=(0.01, 0.05))
    h = exact_frf(system, LINES)
    variance = np.full(h.shape, (0.05 * np.std(h)) ** 2)
    h = h + np.sqrt(variance / 2) * (rng.normal(size=h.shape) + 1j * rng.normal(size=h.shape))
    data = Data(LINES, h, variance)
    found = refine(data.lines, h, variance, system.poles * 1.003, data.allowed)
    assert found.converged
    for k in range(3):
        sd = np.sqrt(found.pole_covariance[k, k])
        for direction in (sd, 1j * sd):
            step = direction * np.eye(3)[k]
            moved = [
                refine(
                    data.lines, h, variance, found.poles + s * step, data.allowed, max_iterations=0
                ).chi2
                for s in (-1, 1)
            ]
            # One standard deviation (others held) raises χ² by one at least, either way alike.
            assert min(moved) - found.chi2 > 0.9
            assert abs(moved[1] - moved[0]) < 0.05 * (moved[0] - found.chi2)


def test_rank_one_of_an_exact_mode():
    rng = np.random.default_rng(5)
    phi = rng.normal(size=3) + 0.2j * rng.normal(size=3)
    gamma = rng.normal(size=3) + 1j * rng.normal(size=3)
    shape, participation, share = rank_one(np.outer(phi, gamma))
    np.testing.assert_allclose(np.outer(shape, participation), np.outer(phi, gamma), atol=1e-12)
    assert share == pytest.approx(1.0)
    assert np.linalg.norm(shape) == pytest.approx(1.0)
    two = np.outer(phi, gamma) + np.outer(gamma.conj(), phi)
    assert rank_one(two)[2] < 0.99


def test_realigned_shape_is_as_real_as_possible():
    rng = np.random.default_rng(6)
    shape = rng.normal(size=3) * np.exp(1.1j)
    turned = shape * realign(shape)
    assert np.max(np.abs(turned.imag)) < 1e-12
    assert turned.real[np.argmax(np.abs(turned))] > 0


def test_errors_that_lines_share_are_those_of_refitted_data():
    rng = np.random.default_rng(8)
    system = random_system(rng, 3, damping=(0.01, 0.05))
    h = exact_frf(system, LINES)
    variance = np.full(h.shape, (0.02 * np.std(h)) ** 2) * rng.uniform(0.5, 2, h.shape)
    data = Data(LINES, h, variance, force_share=np.full((3, LINES.size), 1e-8), force_window_s=0.2)
    found = refine(data.lines, h, variance, system.poles, data.allowed)
    errors = data.force_errors(h)
    # Every line of every column gets the stated share.
    total = np.sum(np.abs(errors) ** 2, axis=0)
    np.testing.assert_allclose(total, 1e-8 * np.abs(h) ** 2, rtol=1e-9)
    poles, residues = np.zeros((6, 6)), np.zeros((3, 3, 2, 3))
    for error in errors:
        moved = refine(data.lines, h + error, variance, found.poles, data.allowed)
        change = moved.poles - found.poles
        change = np.concatenate([change.real, change.imag])
        poles += np.outer(change, change)
        change = moved.residues.residue - found.residues.residue
        residues += np.stack([change.real, change.imag], axis=2) ** 2
    shared_poles, shared_residues = shared_error(data.lines, variance, found, errors)
    np.testing.assert_allclose(np.diag(shared_poles), np.diag(poles), rtol=0.02)
    np.testing.assert_allclose(shared_residues, residues, rtol=0.02, atol=1e-3 * residues.max())
