"""Modes from hits: intervals on random systems, light damping from short or windowed records."""

from dataclasses import replace

import numpy as np
import pytest

from planner.frf.estimator import estimate
from planner.frf.synthesis import pole
from planner.modal.estimate_modes import estimate_modes
from planner.recording.records import Hit
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
        (range(300, 312), {"force_noise": 0.0, "record_s": 3.0}),  # the end of the record
        (range(300, 312), {"force_noise": 3e-3, "record_s": 6.0}),  # the noise of the force
        (range(300, 312), {"repeats": 1, "record_s": 3.0}),
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


FREQUENCY_HZ = np.array([9.0, 14.0, 31.0, 47.0])
DAMPING, RECORD_S, RATE_1_S = 0.003, 2.0, 2.0


def ringing(seed: int) -> tuple[Hit, ...]:
    """Twelve 2-s records of four modes of 0.3 % damping, which ring for half a minute."""
    rng = np.random.default_rng(seed)
    poles = pole(FREQUENCY_HZ, np.full(4, DAMPING))
    shape = rng.normal(size=(4, 3))
    shape /= np.linalg.norm(shape, axis=1, keepdims=True)
    residues = np.einsum("mi,mj->mij", shape, shape) * (1e-3 / (2j * poles.imag))[:, None, None]
    return tuple(
        make_hit(rng, axis, 0.01, record_s=RECORD_S, poles=poles, residues=residues)
        for axis in ("+x", "+y", "+z")
        for _ in range(4)
    )


def windowed(hit: Hit) -> Hit:
    """The same as an analyser with an exponential window delivers it."""
    window = np.exp(-RATE_1_S * np.arange(hit.force_n.size) / hit.sampling_rate_hz)
    quiet = np.median(hit.force_n)
    force = (hit.force_n - quiet) * window
    return replace(hit, force_n=force, acceleration_m_s2=hit.acceleration_m_s2 * window)


def identified(hits: tuple[Hit, ...], case: str) -> np.ndarray:
    """Damping ratios of the modes by one of the three ways."""
    if case == "no window":
        frf = estimate(hits, BAND)
    elif case == "window laid over the records here":
        frf = estimate(hits, BAND, exponential_rate_1_s=RATE_1_S)
    else:
        recorded = tuple(windowed(hit) for hit in hits)
        frf = replace(estimate(recorded, BAND), exponential_rate_1_s=RATE_1_S)
    modes = estimate_modes(frf, BAND).modes
    np.testing.assert_allclose([m.frequency_hz for m in modes], FREQUENCY_HZ, rtol=2e-3)
    return np.array([m.damping_ratio for m in modes])


@pytest.mark.parametrize(
    "case", ["no window", "window laid over the records here", "window of the analyser, told"]
)
def test_damping_of_a_third_of_a_percent_from_two_seconds(case):
    found = np.array([identified(ringing(seed), case) for seed in range(4)])
    assert np.max(np.abs(found / DAMPING - 1)) < 0.10
