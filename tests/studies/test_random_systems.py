"""Modes of random systems with known poles, found without an expert, and a peer beside it.

`pytest -m slow tests/studies/test_random_systems.py -s` prints all figures.
"""

import time

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from planner.errors import RefusedError
from planner.modal.estimate_modes import estimate_modes
from planner.modal.modes import Mode
from tests.support.modal_systems import System, as_frf, exact_frf, noisy, random_system

pytestmark = pytest.mark.slow
BAND = (4.0, 60.0)
SYSTEMS, SEED = 200, 20261121


def draw(rng: np.random.Generator) -> tuple[System, float]:
    """2–9 modes, damping 0.2–10 %, half of them with a pair 1–3 % apart, 1–10 % noise."""
    pair = float(rng.uniform(0.01, 0.03)) if rng.random() < 0.5 else None
    modes = int(rng.integers(2, 10))
    system = random_system(rng, modes, BAND, (0.002, 0.1), pair, complexity=0.1)
    return system, float(np.exp(rng.uniform(np.log(0.01), np.log(0.1))))


def identify(lines: np.ndarray, h: np.ndarray, variance: np.ndarray) -> tuple[Mode, ...]:
    try:
        return estimate_modes(as_frf(lines, h, variance), BAND).modes
    except RefusedError:
        return ()


def pairs(system: System, modes: tuple[Mode, ...]) -> list[tuple[int, int]]:
    """(true, found) pairs: nearest frequencies, one to one, within 1.5 % or half a bandwidth."""
    if not modes:
        return []
    found = np.array([m.frequency_hz for m in modes])
    apart = np.abs(np.log(found / system.frequency_hz[:, None]))
    limit = np.maximum(0.015, system.damping_ratio)[:, None]
    cost = np.where(apart < limit, apart, 10.0)
    rows, columns = linear_sum_assignment(cost)
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if cost[i, j] < 10]


def test_two_hundred_random_systems():
    lines = np.arange(2.0, 80.0, 0.1)
    rng = np.random.default_rng(SEED)
    total = good = reported = spurious = 0
    inside, seconds = [], []
    for _ in range(SYSTEMS):
        system, noise = draw(rng)
        h, variance = noisy(exact_frf(system, lines), noise, rng)
        start = time.perf_counter()
        modes = identify(lines, h, variance)
        seconds.append(time.perf_counter() - start)
        matched = pairs(system, modes)
        total += system.frequency_hz.size
        reported += len(modes)
        spurious += len(modes) - len(matched)
        for i, j in matched:
            f, zeta = system.frequency_hz[i], system.damping_ratio[i]
            m = modes[j]
            close = abs(m.frequency_hz / f - 1) < 0.003 and abs(m.damping_ratio / zeta - 1) < 0.1
            good += close
            errors = (
                (m.frequency_hz - f) / m.frequency_sd_hz,
                (m.damping_ratio - zeta) / m.damping_sd,
            )
            inside.append([abs(e) < 1.96 for e in errors])
    cover = 100 * np.mean(inside, axis=0)
    print(
        f"\n{SYSTEMS} systems, {total} modes: {100 * good / total:.1f} % found within 0.3 % "
        f"(frequency) and 10 % (damping); {100 * spurious / max(reported, 1):.1f} % of {reported} "
        f"spurious; 95 % intervals hold {cover[0]:.1f} % (frequency), {cover[1]:.1f} % (damping); "
        f"median {1e3 * np.median(seconds):.0f} ms, longest {max(seconds):.2f} s"
    )
    assert good >= 0.97 * total
    assert spurious <= 0.02 * reported
    assert np.all((cover >= 90) & (cover <= 98))
