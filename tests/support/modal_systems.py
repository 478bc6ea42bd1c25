"""Random modal systems with known poles: the truth that the mode tests are judged by."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.frf.frf import Frf
from planner.frf.synthesis import accelerance, pole
from planner.modal.modes import Mode


@dataclass(frozen=True, eq=False)
class System:
    frequency_hz: np.ndarray  # (m,) increasing
    damping_ratio: np.ndarray  # (m,)
    residues: np.ndarray  # (m, 3, 3)

    @property
    def poles(self) -> np.ndarray:
        return pole(self.frequency_hz, self.damping_ratio)


def random_system(
    rng: np.random.Generator,
    modes: int,
    band_hz: tuple[float, float] = (4.0, 60.0),
    damping: tuple[float, float] = (0.002, 0.1),
    pair: float | None = None,
    complexity: float = 0.0,
    spacing: float = 0.06,
) -> System:
    """Modes of comparable receptance at resonance, spaced by `spacing` in log frequency at least.

    `pair` puts two of them that far apart (0.01: 1 %), with differing shapes as the x and y
    modes of a robot have. `complexity` is the sd of the shapes' phases in rad.
    """
    low, high = np.log(band_hz[0] * 1.1), np.log(band_hz[1] / 1.1)
    free = modes - (pair is not None)
    while True:
        logs = np.sort(rng.uniform(low, high, free))
        if free < 2 or np.min(np.diff(logs)) > spacing:
            break
    frequency = np.exp(logs)
    if pair is not None:
        frequency = np.append(frequency, frequency[rng.integers(free)] * (1 + pair))
    shape = rng.normal(size=(modes, 3))
    shape /= np.linalg.norm(shape, axis=1, keepdims=True)
    if pair is not None:
        twin = np.argmin(np.abs(frequency[:-1] * (1 + pair) - frequency[-1]))
        shape[-1] -= 0.9 * (shape[-1] @ shape[twin]) * shape[twin]
        shape[-1] /= np.linalg.norm(shape[-1])
    shape = shape * np.exp(1j * complexity * rng.normal(size=shape.shape))
    by_frequency = np.argsort(frequency)
    frequency, shape = frequency[by_frequency], shape[by_frequency]
    zeta = np.exp(rng.uniform(*np.log(damping), modes))
    poles = pole(frequency, zeta)
    # Equal peaks of the accelerance within a factor of three each way.
    size = 2 * zeta / 50.0 * np.exp(rng.uniform(-1, 1, modes))
    residues = np.einsum("mi,mj->mij", shape, shape) * (size / (2j * poles.imag))[:, None, None]
    return System(frequency, zeta, residues)


def exact_frf(system: System, frequency_hz: np.ndarray, rate_1_s: float = 0.0) -> np.ndarray:
    """Accelerance (3, 3, F); with `rate_1_s`, as from records under an exponential window.

    The window moves every pole by the rate; the accelerance is then s² at s = iω + rate.
    """
    return accelerance(frequency_hz + rate_1_s / (2j * np.pi), system.poles, system.residues)


def matched(modes: Sequence[Mode], system: System) -> list[Mode | None]:
    """For each true mode the found one within half a bandwidth or 0.5 %, None if there is none."""
    out: list[Mode | None] = []
    for f, zeta in zip(system.frequency_hz, system.damping_ratio, strict=True):
        mode = min(modes, key=lambda mode: abs(mode.frequency_hz - f))
        near = abs(mode.frequency_hz / f - 1) < max(0.005, 0.5 * zeta)
        out.append(mode if near and mode not in out else None)
    return out


def scores(modes: Sequence[Mode], system: System) -> tuple[list[float], list[float]]:
    """Errors over standard deviations of poles and of residues of the modes that were found."""
    of_poles, of_residues = [], []
    truth = zip(system.frequency_hz, system.damping_ratio, system.residues, strict=True)
    for mode, (frequency, damping, residue) in zip(matched(modes, system), truth, strict=True):
        if mode is not None:
            of_poles.append((mode.frequency_hz - frequency) / mode.frequency_sd_hz)
            of_poles.append((mode.damping_ratio - damping) / mode.damping_sd)
            error = mode.residue - residue
            of_residues += list((np.stack([error.real, error.imag]) / mode.residue_sd).ravel())
    return of_poles, of_residues


def noisy(h: np.ndarray, share: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """FRF with circular noise of `share` times the rms of each entry, and its variance."""
    variance = np.mean(np.abs(h) ** 2, axis=-1, keepdims=True) * share**2 * np.ones(h.shape)
    noise = rng.normal(size=h.shape) + 1j * rng.normal(size=h.shape)
    return h + noise * np.sqrt(variance / 2), variance


def as_frf(
    frequency_hz: np.ndarray,
    h: np.ndarray,
    variance: np.ndarray | None = None,
    columns: tuple[int, ...] = (0, 1, 2),
    rate_1_s: float = 0.0,
) -> Frf:
    """Frf of the given columns; NaN elsewhere."""
    value = np.full(h.shape, np.nan + 1j * np.nan)
    value[:, list(columns)] = h[:, list(columns)]
    spread = np.full(h.shape, np.nan) if variance is None else variance.copy()
    hits = tuple(4 if c in columns else 0 for c in range(3))
    band = (float(frequency_hz[0]), float(frequency_hz[-1]))
    return Frf(frequency_hz, value, spread, np.full(h.shape, np.nan), hits, band, rate_1_s)
