"""Records of hits: the linear ones by a numerical Laplace transform, the nonlinear ones marched.

A linear response over a record of T s is taken on the line s = sigma + i omega of a window of 2 T:

    a(t) = e^(sigma t) IFFT[ H(sigma + i omega) FFT[ f(t) e^(-sigma t) ] ],   2 T sigma = 9

so what wraps around has fallen by e^-9 beside its own decay. The anti-alias filter (linear phase)
acts on force and accelerations alike, so it may act on the force before the robot does.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.signal import firwin, oaconvolve

from planner.proof.tree.hits import OVER, Clock, Hit, pulse
from planner.proof.tree.march import batch, first_order, march
from planner.proof.tree.system import System

FALL = 9.0  # 2 T sigma
FINE_HZ = 6000.0  # steps a second of nonlinear hits, at least


@dataclass(frozen=True)
class Motion:
    """What happened in a hit at the sampling rate: force (N), sensor's motion (6, samples)."""

    force: np.ndarray
    motion: np.ndarray


def sampled(fine: np.ndarray, over: int) -> np.ndarray:
    """Anti-aliased (flat to 0.38 of the sampling rate, 100 dB down at 0.5) and decimated."""
    taps = firwin(80 * over + 1, 0.88 / over, window=("kaiser", 10.06))  # pyright: ignore[reportArgumentType]
    padded = oaconvolve(fine, taps.reshape((1,) * (fine.ndim - 1) + (-1,)), axes=-1)
    half = 40 * over
    return padded[..., half : half + fine.shape[-1] : over]


def contour(clock: Clock) -> tuple[np.ndarray, float]:
    """Lines s (1/s) up to half the sampling rate, and sigma."""
    window = 2 * clock.samples
    sigma = FALL / (window / clock.rate)
    return sigma + 2j * np.pi * np.fft.rfftfreq(window, 1 / clock.rate), sigma


def shifted(signal: np.ndarray, sigma: float, clock: Clock) -> np.ndarray:
    """Transform of samples (…, n) on the contour."""
    t = np.arange(clock.samples) / clock.rate
    return np.fft.rfft(signal * np.exp(-sigma * t), 2 * clock.samples, axis=-1)


def back(spectrum: np.ndarray, sigma: float, clock: Clock) -> np.ndarray:
    """Inverse of `shifted`."""
    t = np.arange(clock.samples) / clock.rate
    signal = np.fft.irfft(spectrum, 2 * clock.samples, axis=-1)[..., : clock.samples]
    return signal * np.exp(sigma * t)


def linear_records(frf: np.ndarray, hits: list[Hit], clock: Clock) -> list[Motion]:
    """Hits on a robot of FRF (lines of `contour`, 6, 6), or (hits, lines, 6, 6) of each its own."""
    _, sigma = contour(clock)
    motions = []
    for i, hit in enumerate(hits):
        force = sampled(pulse(hit, clock), OVER)
        each = frf[i] if frf.ndim == 4 else frf
        answer = (each @ hit.wrench).T * shifted(force, sigma, clock)
        motions.append(Motion(force, back(answer, sigma, clock)))
    return motions


def marched(
    systems: list[System], hits: list[Hit], clock: Clock, gear: str, law: Any, over: int = 0
) -> tuple[list[Motion], np.ndarray]:
    """Hits on robots of which one gear is nonlinear (`law`, or None).

    Also the gear's angle and rate (hits, 2, fine steps).
    """
    over = over or max(4, int(np.ceil(FINE_HZ / clock.rate)))
    forms = [first_order(system, gear) for system in systems]
    setup = batch(
        [forms[h.pose] for h in hits], np.array([h.wrench for h in hits]), 1 / (clock.rate * over)
    )
    force = np.array([pulse(h, clock, over) for h in hits])
    quiet = int(clock.trigger * clock.rate * over) - 1
    answer = np.zeros((len(hits), 8, force.shape[1]))
    answer[..., quiet:] = march(setup, force[:, quiet:], law)
    slow_force, slow = sampled(force, over), sampled(answer[:, 2:], over)
    return [Motion(f, a) for f, a in zip(slow_force, slow, strict=True)], answer[:, :2]


def rumble(rng: np.random.Generator, system: System, clock: Clock, count: int) -> np.ndarray:
    """(count, 3, samples) accelerations at the sensor while the floor trembles, of rms 1 in all.

    Floor: 2 to 60 Hz, falling with frequency, three axes alike but apart.
    """
    window = 2 * clock.samples
    lines = np.fft.rfftfreq(window, 1 / clock.rate)
    some = (lines > 1.5) & (lines < 70)
    answer = system.frf(2j * np.pi * lines[some], ground=True)
    shape = 1 / (1 + (lines[some] / 12) ** 2)
    spectrum = np.zeros((count, 3, len(lines)), complex)
    for i in range(count):
        phases = (rng.normal(size=(some.sum(), 3)) + 1j * rng.normal(size=(some.sum(), 3))) * shape[
            :, None
        ]
        spectrum[i][:, some] = np.einsum("fij,fj->if", answer, phases)
    signal = np.fft.irfft(spectrum, window, axis=-1)[..., : clock.samples]
    return signal / np.sqrt(np.mean(signal**2))
