"""LSFD residues, out-of-band terms, rank one, and the gradient of the fit."""

import numpy as np
import pytest

from planner.modal.fit_data import Data
from planner.modal.refine import refine, shared_error
from planner.modal.residues import (
    lsfd,
    rank_one,
)
from tests.support.modal_systems import exact_frf, random_system

LINES = np.arange(4.0, 60.0, 0.2)


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
