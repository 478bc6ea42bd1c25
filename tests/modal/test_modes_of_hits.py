"""Intervals of modes from hits on random systems: end of record and noise of the force included."""

import numpy as np
import pytest

from planner.frf.estimator import estimate
from planner.modal.estimate_modes import estimate_modes
from tests.support.modal_systems import System, matched, random_system, scores
from tests.support.simulated_hits import make_hit

BAND = (4.0, 60.0)


def struck(system: System, rng: np.random.Generator, repeats: int, **settings):
    hits = tuple(
        make_hit(rng, axis, poles=system.poles, residues=system.residues, **settings)
        for axis in ("+x", "-y", "+z")
        for _ in range(repeats)
    )
    return estimate_modes(estimate(hits, BAND), BAND).modes


def judged(seeds: range, repeats: int = 3, **settings) -> tuple[list[float], list[float], int]:
    """Errors over standard deviations of poles and of residues, and how many modes were lost."""
    of_poles, of_residues, lost = [], [], 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        system = random_system(rng, int(rng.integers(2, 6)))
        modes = struck(system, rng, repeats, **settings)
        poles, residues = scores(modes, system)
        of_poles, of_residues = of_poles + poles, of_residues + residues
        lost += matched(modes, system).count(None)
    return of_poles, of_residues, lost


def covered(values: list[float]) -> float:
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
    of_poles, of_residues, lost = judged(seeds, **settings)
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
