"""Hits on a two-mode structure with the noise that analysers have."""

from pathlib import Path

import numpy as np
from scipy import signal

from planner.frf.synthesis import accelerance
from planner.recording.records import Hit

RATE_HZ = 512.0
POLES = 2j * np.pi * np.array([11.0, 27.0]) - 2 * np.pi * np.array([11.0, 27.0]) * 0.025
SHAPES = np.array([[1.0, 0.4, -0.2], [-0.3, 0.8, 0.5]]) / 12.0
RESIDUES = np.einsum("mi,mj->mij", SHAPES, SHAPES) / (2j * POLES.imag)[:, None, None]


def exact_accelerance(frequency_hz: np.ndarray) -> np.ndarray:
    """(3, 3, F) of the structure."""
    return accelerance(frequency_hz, POLES, RESIDUES)


def make_hit(
    rng: np.random.Generator,
    axis: str = "+x",
    noise: float = 0.02,
    duration_s: float = 0.008,
    record_s: float = 4.0,
    second: float = 0.0,
    peak_n: float | None = None,
    poles: np.ndarray = POLES,
    residues: np.ndarray = RESIDUES,
    force_noise: float = 1e-3,
) -> Hit:
    """A hit; `second` is the size of a bounce relative to the first pulse.

    The noise of the responses is relative to the largest rms, that of the force to its peak.
    Residues (m, 3, 3) are those of real modes.
    """
    fine = RATE_HZ * 16
    t = np.arange(round(record_s * fine)) / fine
    start = 0.05 + rng.uniform(0, 0.004)
    width = duration_s * rng.uniform(0.9, 1.1)
    peak = peak_n or rng.uniform(300, 1500)
    force = peak * np.sin(np.pi * np.clip((t - start) / width, 0, 1)) ** 1.5
    bounce = start + 0.03
    force += second * peak * np.sin(np.pi * np.clip((t - bounce) / width, 0, 1)) ** 1.5
    sense, j = (-1.0 if axis[0] == "-" else 1.0), "xyz".index(axis[1])
    response = np.zeros((3, t.size))
    for pole, residue in zip(poles, residues[:, :, j], strict=True):
        kernel = signal.lfilter(
            [1 / fine], [1, -np.exp(pole / fine)], sense * force.astype(complex)
        )
        direct = 2 * np.real(np.outer(residue * pole, sense * force))
        response += 2 * np.real(np.outer(residue * pole**2, kernel)) + direct
    sos = signal.butter(6, 0.4 * RATE_HZ, fs=fine, output="sos")
    both = np.asarray(signal.sosfilt(sos, np.vstack([force, response])))[:, ::16]
    scale = np.max(np.sqrt(np.mean(both[1:] ** 2, axis=1)))
    samples = both[1:] + noise * scale * rng.standard_normal(both[1:].shape)
    pulse = both[0] + force_noise * peak * rng.standard_normal(both[0].size)
    return Hit(Path("simulated"), axis, RATE_HZ, pulse, samples, simulated=True)
