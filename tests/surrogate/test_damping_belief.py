"""What is believed of a simulation's damping: what the measured damping bears out, and no more."""

import numpy as np
import pytest

from planner.dynamics.vibration import SimulatedModes
from planner.surrogate.modal_surrogate import ModalObservations, fit_damping

MEASURED, ASKED = 10, 60


def cell(seed, follows):
    """Poses, the simulation's damping (n, 3), and the robot's, which follows it or does not."""
    rng = np.random.default_rng(seed)
    x = rng.random((MEASURED + ASKED, 2))
    over = np.exp(1.2 * (x[:, :1] - 0.5) + 0.5 * np.sin(4 * x[:, 1:]))
    simulated = 0.03 * over * np.array([1.0, 1.2, 1.5])
    true = 1.05 * simulated if follows else np.full_like(simulated, 0.035)
    scatter = 0.02 if follows else 0.35
    return x, simulated, true * np.exp(scatter * rng.standard_normal(true.shape))


def predicted(x, simulated, zeta):
    """ln ζ (ASKED, 3) and its sd by a simulation that was identified from the measured poses."""
    n = MEASURED
    f = np.broadcast_to(np.array([10.0, 20.0, 30.0]), (n, 3))
    residue = np.ones((n, 3, 3, 3))
    modes = SimulatedModes(f, simulated[:n], residue.astype(complex))
    seen = ModalObservations(
        x[:n], f, 0.01 * f, zeta[:n], 0.02 * zeta[:n], residue.astype(complex), residue, modes
    )
    return fit_damping(seen, identified=True).predict(x[n:], np.log(simulated[n:]))


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("follows", [False, True])
def test_damping_is_predicted_by_the_simulation_only_where_it_follows_it(seed, follows):
    x, simulated, zeta = cell(seed, follows)
    mean, sd = predicted(x, simulated, zeta)
    true = np.log(zeta[MEASURED:])
    off = np.sqrt(np.mean((mean - true) ** 2))
    if follows:
        assert off < 0.05
        assert sd.max() < 0.1
    else:
        constant = np.log(zeta[:MEASURED]).mean(axis=0)
        same = np.sqrt(np.mean((constant - true) ** 2))
        assert off < 1.1 * same  # 1.3 to 1.7 times, where the simulation is believed
