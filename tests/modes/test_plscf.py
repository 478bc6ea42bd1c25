"""pLSCF: poles of clean FRFs, whatever the quantity, the band and the number of references."""

import numpy as np
import pytest

from planner.modal.plscf import plscf
from planner.modal.residues import rank_one
from planner.modal.stabilisation import diagram, stable
from tests.support.modal_systems import System, exact_frf, noisy, random_system

LINES = np.arange(3.0, 70.0, 0.15)


def nearest(found: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Relative distance of each true pole to the nearest found one."""
    return np.min(np.abs(found[None] - true[:, None]), axis=1) / np.abs(true)


@pytest.mark.parametrize("columns", [(0,), (1, 2), (0, 1, 2)])
def test_clean_poles_at_high_order(columns):
    system = random_system(np.random.default_rng(1), 5, damping=(0.005, 0.05))
    h = exact_frf(system, LINES)[:, list(columns)]
    (entry,) = plscf(LINES, h, (24,))
    # Start values: the basis is not exact in s, and one reference knows least.
    assert np.max(nearest(entry.poles, system.poles)) < 1e-5


@pytest.mark.parametrize("power", [0, -1, -2])
def test_quantity_does_not_matter(power):
    system = random_system(np.random.default_rng(2), 4, damping=(0.005, 0.05))
    h = exact_frf(system, LINES) * (2j * np.pi * LINES) ** power
    (entry,) = plscf(LINES, h, (24,))
    assert np.max(nearest(entry.poles, system.poles)) < 1e-6


def test_band_far_above_zero():
    lines = np.arange(900.0, 1000.0, 0.2)
    frequency, zeta = np.array([930.0, 950.0, 952.0]), np.array([2e-3, 1e-3, 1.5e-3])
    shape = np.random.default_rng(3).normal(size=(3, 3))
    residues = np.einsum("mi,mj->mij", shape, shape) / (2j * 2 * np.pi * frequency)[:, None, None]
    system = System(frequency, zeta, residues)
    (entry,) = plscf(lines, exact_frf(system, lines), (24,))
    assert np.max(nearest(entry.poles, system.poles)) < 1e-6


def test_participation_is_that_of_the_residue():
    system = random_system(np.random.default_rng(4), 4, damping=(0.01, 0.03), complexity=0.5)
    h = exact_frf(system, LINES) * np.array([1.0, 50.0, 0.02])[None, :, None]
    (entry,) = plscf(LINES, h, (20,))
    for pole, residue in zip(system.poles, system.residues, strict=True):
        k = int(np.argmin(np.abs(entry.poles - pole)))
        gamma = rank_one(residue * np.array([1.0, 50.0, 0.02]))[1]
        cosine = np.abs(gamma.conj() @ entry.participation[k]) / np.linalg.norm(gamma)
        assert cosine == pytest.approx(1.0, abs=1e-5)


def test_weight_turns_the_fit_away_from_bad_lines():
    rng = np.random.default_rng(5)
    system = random_system(rng, 3, damping=(0.01, 0.03))
    h = exact_frf(system, LINES)
    bad = slice(100, 140)
    spoiled = h.copy()
    spoiled[..., bad] += np.std(h) * rng.normal(size=spoiled[..., bad].shape)
    weight = np.ones((3, LINES.size))
    weight[:, bad] = 1e-12
    plain = nearest(plscf(LINES, spoiled, (16,))[0].poles, system.poles)
    weighted = nearest(plscf(LINES, spoiled, (16,), weight)[0].poles, system.poles)
    assert np.max(weighted) < 1e-4 < np.max(plain)


def test_noise_poles_do_not_stabilise():
    """The diagram of noisy data holds the modes' lines and hardly any others."""
    extra = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        system = random_system(rng, 4, damping=(0.005, 0.03))
        h, _ = noisy(exact_frf(system, LINES), 0.03, rng)
        lines = stable(diagram(plscf(LINES, h, tuple(range(2, 31))), (3.0, 70.0)))
        found = np.array([line.pole for line in lines])
        assert np.max(nearest(found, system.poles)) < 0.01
        extra += len(lines) - 4
    assert extra <= 2


def test_close_poles_keep_their_own_lines():
    rng = np.random.default_rng(11)
    system = random_system(rng, 3, damping=(0.01, 0.011), pair=0.012)
    h, _ = noisy(exact_frf(system, LINES), 0.01, rng)
    found = diagram(plscf(LINES, h, tuple(range(2, 31))), (3.0, 70.0))
    for line in found.lines:
        assert len(set(line.orders)) == len(line.orders)
    lines = stable(found)
    assert np.max(nearest(np.array([x.pole for x in lines]), system.poles)) < 0.003
