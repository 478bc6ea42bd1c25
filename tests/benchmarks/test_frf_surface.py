"""Seed 001: trained up to 105°, told up to 120°, with a simulation that lacks a mode.

`pytest -m slow -s tests/benchmarks/test_frf_surface.py` prints the table beside the paper's.
"""

import time

import numpy as np
import pytest

from frf_surface import BAND_HZ, HIGH_LINES, LOW_SHAPE, measured, measured_matrix, simulated
from planner.frf.types import Frf
from planner.fusion.frf_bands import frf_moments
from planner.fusion.surface import Grid, fit_surface
from planner.fusion.surrogate import ModalObservations, fit_surrogate
from planner.modes.estimate import estimate_modes

PAPER = {"simulation": 0.353, "GP": 0.785, "MFDGP": 0.758, "NARGP": 0.982}
LINES = np.linspace(*BAND_HZ, HIGH_LINES)
BEYOND = np.arange(106.0, 121.0)


def by_modes(angles, matrices, simulation):
    """Amplitude zz (f, p) beyond: modes of every measured FRF, fused, put together again."""
    spread = 0.02 * np.abs(matrices)
    models = [
        estimate_modes(
            Frf(LINES, h, s**2, np.full(h.shape, np.nan), (3, 3, 3), BAND_HZ), BAND_HZ
        ).modes
        for h, s in zip(matrices, spread, strict=True)
    ]
    count = min(len(m) for m in models)
    parts = {
        name: np.array([[getattr(mode, name) for mode in m[:count]] for m in models])
        for name in ("frequency_hz", "frequency_sd_hz", "damping_ratio", "damping_sd",
                     "residue", "residue_sd")
    }  # fmt: skip
    # Labels go by order, so that the simulation's third mode is not the robot's.
    seen = ModalObservations(
        (angles[:, None] - 70) / 50, **parts, simulated=simulation(angles, count)
    )
    fitted = fit_surrogate(seen)
    prediction = fitted.predict((BEYOND[:, None] - 70) / 50, simulation(BEYOND, count))
    mean, sd = frf_moments(prediction, LINES)
    return np.abs(mean[:, 2, 2]).T, sd[:, 2, 2].T


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_extrapolation_beside_the_paper(tmp_path):
    low, simulation = simulated(tmp_path)
    _, beyond = measured()
    truth = beyond.amplitude.reshape(len(BEYOND), HIGH_LINES).T

    def r2(amplitude):
        return 1 - np.mean((amplitude - truth) ** 2) / np.var(truth)

    grid = Grid(
        np.linspace(*BAND_HZ, LOW_SHAPE[0]),
        np.linspace(70.0, 120.0, LOW_SHAPE[1]),
        low.amplitude.reshape(LOW_SHAPE[::-1]).T,
    )
    print("\nR² beyond 105°: model, here, in the paper, seconds")
    onto = fit_surface(grid, grid, "GP").predict(LINES, BEYOND)[0]
    print(f"{'simulation':22s} {r2(onto):7.3f} {PAPER['simulation']:7.3f}")
    seen, _ = measured()
    angles = np.unique(seen.x[:, 1])
    surface = Grid(LINES, angles, seen.amplitude.reshape(len(angles), HIGH_LINES).T)
    for model in ("GP", "AR1", "MFDGP", "NARGP"):
        start = time.perf_counter()
        told = fit_surface(surface, grid, model).predict(LINES, BEYOND)[0]
        spent = time.perf_counter() - start
        print(f"{model:22s} {r2(told):7.3f} {PAPER.get(model, np.nan):7.3f} {spent:7.1f}")
    for every in (1, 2, 3, 4):
        angles, matrices = measured_matrix(every)
        start = time.perf_counter()
        amplitude, sd = by_modes(angles, matrices, simulation)
        spent = time.perf_counter() - start
        inside = np.mean(np.abs(amplitude - truth) < 1.96 * sd)
        print(
            f"modes, every {every} of them {r2(amplitude):7.3f}         {spent:7.1f}"
            f"  inside the 95 % band: {100 * inside:.0f} %"
        )
        assert r2(amplitude) >= 0.985
        assert inside > 0.85
