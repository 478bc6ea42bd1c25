"""Hits on a simulation, without any other engine: for what needs no independent truth."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from planner.dataset.dataset import Dataset, Visit
from planner.dynamics.simulation import Elasticity, Simulation
from planner.recording.records import Hit

RATE_HZ, RECORD_S, LONG = 400.0, 2.56, 8
PULSE_S, BEFORE_S = 0.01, 0.06


def hits_on(
    simulation: Simulation, q: np.ndarray, peak_n: float, rng: np.random.Generator, noise: float
) -> tuple[Hit, ...]:
    """One hit along each axis; noise relative to the responses' rms, 5e-4 of the peak on forces."""
    n = round(RECORD_S * RATE_HZ)
    t = np.arange(LONG * n) / RATE_HZ
    force = peak_n * np.sin(np.pi * np.clip((t - BEFORE_S) / PULSE_S, 0, 1)) ** 2
    frequency = np.fft.rfftfreq(len(t), 1 / RATE_HZ)
    h = np.zeros((3, 3, len(frequency)), dtype=complex)
    h[..., 1:] = simulation.accelerance(q[None], frequency[1:])[0]
    out = []
    for axis in range(3):
        a = np.fft.irfft(h[:, axis] * np.fft.rfft(force), len(t), axis=1)[:, :n]
        a = a + noise * np.sqrt(np.mean(a**2)) * rng.standard_normal(a.shape)
        f = force[:n] + 5e-4 * peak_n * rng.standard_normal(n)
        out.append(Hit(Path("hit"), "+" + "xyz"[axis], RATE_HZ, f, a))
    return tuple(out)


def recorded(
    simulation: Simulation,
    q: np.ndarray,
    factor: Callable[[int, int], np.ndarray | float] = lambda visit, level: 1.0,
    peaks_n: tuple[float, ...] = (300.0, 1000.0),
    noise: float = 0.01,
    seed: int = 0,
) -> Dataset:
    """Visits of q (n, dof); `factor` (e,) multiplies the stiffness at a visit and force level."""
    rng, visits = np.random.default_rng(seed), []
    springs = simulation.elasticity
    for i, row in enumerate(q):
        hits: list[Hit] = []
        for level, peak in enumerate(peaks_n):
            k = springs.stiffness * factor(i, level)
            changed = simulation.changed(Elasticity(k, springs.damping, springs.loss_factor))
            hits += hits_on(changed, row, peak, rng, noise)
        visits.append(Visit(f"P{i + 1}", row, i / max(len(q) - 1, 1), tuple(hits)))
    return Dataset.of_visits(tuple(visits), simulation.robot.config.band_hz)
