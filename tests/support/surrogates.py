"""Modes of a made-up simulation over two joints, and measured ones that deviate from it."""

import numpy as np

from planner.dynamics.vibration import SimulatedModes
from planner.surrogate.modal_surrogate import ModalObservations


def simulated(x, k=4):
    f = np.stack(
        [(8 + 9 * i) * (1 + 0.2 * x[:, 0] * (-1) ** i + 0.1 * x[:, 1]) for i in range(k)], 1
    )
    return SimulatedModes(f, np.full(f.shape, 0.02), np.full((*f.shape, 3, 3), -1e-6j))


def observed(n, seed, scale=1.12):
    rng = np.random.default_rng(seed)
    x = rng.random((n, 2))
    low = simulated(x)
    truth = true_hz(x, scale)
    f = truth * (1 + 1e-3 * rng.standard_normal(truth.shape))
    zeta = 0.03 * np.exp(0.1 * rng.standard_normal(f.shape))
    return ModalObservations(
        x, f, 1e-3 * f, zeta, 0.05 * zeta, 1.3 * low.residue, np.full((n, 4, 3, 3), 1e-8), low
    )


def true_hz(x, scale):
    bend = 1 + 0.03 * np.sin(4 * x[:, :1] + 2 * x[:, 1:2])
    return simulated(x).frequency_hz * scale * bend
