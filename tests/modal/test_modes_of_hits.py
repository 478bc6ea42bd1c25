"""Intervals of modes from hits on random systems: end of record and noise of the force included."""

import numpy as np
import pytest

from planner.frf.estimator import estimate
from planner.modal.estimate_modes import estimate_modes
from tests.support.modal_systems import System, random_system
from tests.support.simulated_hits import make_hit

BAND = (4.0, 60.0)


def struck(system: System, rng: np.random.Generator, repeats: int, **settings):
    hits = tuple(
        make_hit(rng, axis, poles=system.poles, residues=system.residues, **settings)
        for axis in ("+x", "-y", "+z")
        for _ in range(repeats)
    )
    return estimate_modes(estimate(hits, BAND), BAND).modes


def scores(seeds: range, repeats: int = 3, **settings) -> tuple[np.ndarray, np.ndarray, int]:
    """Errors over standard deviations of poles and of residues, and how many modes were lost."""
    of_poles, of_residues, lost = [], [], 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        system = random_system(rng, int(rng.integers(2, 6)))
        modes = struck(system, rng, repeats, **settings)
        truth = zip(system.frequency_hz, system.damping_ratio, system.residues, strict=True)
        for frequency, damping, residue in truth:
            mode = min(modes, key=lambda mode: abs(mode.frequency_hz - frequency))
            if abs(mode.frequency_hz / frequency - 1) > max(0.005, 0.5 * damping):
                lost += 1
                continue
            of_poles.append((mode.frequency_hz - frequency) / mode.frequency_sd_hz)
            of_poles.append((mode.damping_ratio - damping) / mode.damping_sd)
            error = mode.residue - residue
            of_residues.extend((np.stack([error.real, error.imag]) / mode.residue_sd).ravel())
    return np.array(of_poles), np.array(of_residues), lost


def covered(values: np.ndarray) -> float:
    return float(np.mean(np.abs(values) < 1.96))


HUNDRED = [
    {"record_s": record_s, "force_noise": force_noise, "noise": noise}
    for record_s in (3.0, 10.0) for force_noise in (0.0, 1e-3) for noise in (0.003, 0.02)
]  # fmt: skip


@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    ("seeds", "settings"),
    [
        (range(300, 320), {"force_noise": 0.0, "record_s": 3.0}),  # the end of the record
        (range(300, 320), {"force_noise": 3e-3, "record_s": 6.0}),  # the noise of the force
        (range(300, 320), {"repeats": 1, "record_s": 3.0}),
        *(pytest.param(range(40000, 40100), s, marks=pytest.mark.slow) for s in HUNDRED),
    ],
)
def test_intervals_from_hits_cover_the_truth(seeds, settings):
    of_poles, of_residues, lost = scores(seeds, **settings)
    assert lost <= len(seeds) / 35
    assert 0.90 < covered(of_poles) < 0.985
    assert (0.91 if len(seeds) < 100 else 0.90) < covered(of_residues) < 0.98


def test_a_soft_mode_that_still_rings_keeps_its_size():
    """Beside a mode forty times as loud it looks over; a third of it is cut off."""
    rng = np.random.default_rng(1)
    frequency, damping = np.array([6.0, 35.0]), np.array([0.005, 0.02])
    shape = np.array([[1.0, 0.5, 0.2], [0.4, -0.6, 0.8]])
    poles = 2 * np.pi * frequency * (-damping + 1j * np.sqrt(1 - damping**2))
    size = np.array([0.0004, 0.002]) / (2j * poles.imag)
    system = System(frequency, damping, np.einsum("mi,mj,m->mij", shape, shape, size))
    low, _ = struck(system, rng, 2, record_s=5.0, noise=0.002, force_noise=0.0)
    error = np.linalg.norm(low.residue - system.residues[0]) / np.linalg.norm(system.residues[0])
    assert error < 0.05
