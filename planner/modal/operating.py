"""Modes from responses alone, in operation: covariance-driven stochastic subspace (SSI-cov).

Correlations of responses to an unknown broad-band excitation decay as the structure does (James,
Carne & Lauffer 1995). Their block Hankel matrix factors into observability and controllability
(Peeters & De Roeck, Mech. Syst. Signal Process. 13, 1999); poles of many orders make a diagram as
those of FRFs do. Nothing says how strong the excitation was: shapes have no scale. What a machine
excites as a tone is no mode: its share of the signal is distributed as a sine's, not as noise.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.signal

from planner.errors import RefusedError
from planner.modal.mac import mac, phase_collinearity, phase_deviation_deg
from planner.modal.modes import UNSCALED, Mode
from planner.modal.plscf import Diagram, Line, PoleSet, diagram, stable
from planner.modal.residues import realign

MAX_ORDER = 60
BLOCKS = (12, 80)  # least and most lags
SEGMENTS = 8  # parts of the record whose own poles tell the standard deviations
LEAST_CYCLES = 200  # of the lowest mode, or the correlations mean little
NOTHING = (
    "No mode stands out of the responses between {:g} and {:g} Hz: record longer, at least some "
    f"{LEAST_CYCLES} periods of the lowest mode, or state the band."
)
SHARE, LEAST_ORDERS, MOST_DAMPING = 0.6, 6, 0.15  # of a line of the diagram that is a mode
TONE = 2.2  # kurtosis around a pole: 1.5 for a sine, 3 for noise


@dataclass(frozen=True, eq=False)
class OperatingModes:
    """Modes in increasing frequency, tones that were left out (Hz), and the diagram.

    Shapes (channels,) are of unit length; sds are the scatter over parts of the record.
    """

    modes: tuple[Mode, ...]
    band_hz: tuple[float, float]
    tones_hz: tuple[float, ...]
    diagram: Diagram
    spectrum_hz: np.ndarray  # (F,)
    spectrum: np.ndarray  # (channels, channels, F) cross power


def operating_modes(
    samples: np.ndarray, rate_hz: float, band_hz: tuple[float, float] | None = None
) -> OperatingModes:
    """Modes of simultaneous responses (channels, n). Raises RefusedError where none is found."""
    values = scipy.signal.detrend(np.asarray(samples, float), axis=1)
    values = values / np.maximum(np.std(values, axis=1, keepdims=True), 1e-300)
    size = np.std(np.asarray(samples, float), axis=1)
    band = band_hz or (max(0.004 * rate_hz, 20 * rate_hz / values.shape[1]), 0.4 * rate_hz)
    rate, factor = rate_hz, int(rate_hz / (2.5 * band[1]))  # oversampled by no more than that
    if factor >= 2:
        values = scipy.signal.decimate(values, factor, ftype="fir", axis=1)
        rate = rate_hz / factor
    found = _diagram(values, rate, band)
    lines = [
        line for line in stable(found, LEAST_ORDERS, SHARE)
        if band[0] <= line.frequency_hz <= band[1] and line.damping_ratio < MOST_DAMPING
    ]  # fmt: skip
    tones = [line for line in lines if _kurtosis(values, rate, line.frequency_hz) < TONE]
    lines = [line for line in lines if line not in tones]
    if not lines:
        raise RefusedError(NOTHING.format(*band))
    parts = _of_parts(values, rate, band, lines)
    # Parts of the record that show a mode, at least
    modes = _once(
        _mode(line, own, size) for line, own in zip(lines, parts, strict=True) if len(own) >= 4
    )
    if not modes:
        raise RefusedError(NOTHING.format(*band))
    tones_hz = tuple(line.frequency_hz for line in tones)
    # Cross power spectra of channels of unit variance
    hz, table = scipy.signal.csd(
        values[:, None], values[None], fs=rate, nperseg=min(values.shape[1], 2048), axis=-1,
        detrend="constant",
    )  # fmt: skip
    return OperatingModes(modes, band, tones_hz, found, hz[1:], table[..., 1:])


def _once(modes: Iterable[Mode]) -> tuple[Mode, ...]:
    """Without those that a neighbour of the same shape stands for."""
    kept: list[Mode] = []
    for mode in sorted(modes, key=lambda mode: mode.damping_ratio):
        width = 2 * mode.damping_ratio * mode.frequency_hz
        # Neighbours within a bandwidth that are so alike (MAC) are one mode, the less damped.
        if not any(
            abs(other.frequency_hz - mode.frequency_hz) < width
            and mac(other.shape, mode.shape) > 0.9
            for other in kept
        ):
            kept.append(mode)
    return tuple(sorted(kept, key=lambda mode: mode.frequency_hz))


def _diagram(values: np.ndarray, rate: float, band: tuple[float, float]) -> Diagram:
    channels = values.shape[0]
    # Periods of the lowest frequency that the lags of one side of the Hankel matrix span
    lags = int(np.clip(1.0 * rate / band[0], *BLOCKS))
    # Most entries: rows of the Hankel matrix
    lags = max(6, min(lags, 900 // channels, values.shape[1] // 8))
    left, size, _ = scipy.linalg.svd(_hankel(values, lags), full_matrices=False)
    top = min(MAX_ORDER, size.size - 1, channels * (lags - 1))
    sets = [
        _poles(left[:, :n] * np.sqrt(size[:n]), channels, rate, n) for n in range(2, top + 1, 2)
    ]
    return diagram(tuple(sets), (0.9 * band[0], 1.1 * band[1]))


def _hankel(values: np.ndarray, lags: int) -> np.ndarray:
    """Block Hankel matrix of correlations at lags 1…2·lags − 1."""
    channels, n = values.shape
    length = scipy.fft.next_fast_len(2 * n)
    spectrum = np.fft.rfft(values, length, axis=1)
    table = np.empty((2 * lags, channels, channels))
    for j in range(channels):
        product = spectrum * spectrum[j].conj()
        correlation = np.fft.irfft(product, length, axis=1)[:, : 2 * lags]
        table[:, :, j] = (correlation / (n - np.arange(2 * lags))).T
    index = np.arange(lags)
    blocks = table[1 + index[:, None] + index]  # (lags, lags, channels, channels)
    return blocks.transpose(0, 2, 1, 3).reshape(lags * channels, lags * channels)


def _poles(observed: np.ndarray, channels: int, rate: float, order: int) -> PoleSet:
    """Poles of one order, with shapes at all channels."""
    state = np.linalg.lstsq(observed[:-channels], observed[channels:], rcond=None)[0]
    values, vectors = np.linalg.eig(state)
    with np.errstate(divide="ignore"):
        poles = np.log(values.astype(complex)) * rate
    shapes = (observed[:channels] @ vectors).T
    kept = (poles.imag > 0) & (poles.real < 0) & np.isfinite(poles)
    poles, shapes = poles[kept], shapes[kept]
    shapes = shapes / np.maximum(np.linalg.norm(shapes, axis=1, keepdims=True), 1e-300)
    by_frequency = np.argsort(poles.imag)
    return PoleSet(order, poles[by_frequency], shapes[by_frequency])


def _kurtosis(values: np.ndarray, rate: float, frequency: float) -> float:
    """Of the channel that moves most in a narrow band around a frequency."""
    n = values.shape[1]
    spectrum = np.fft.rfft(values, axis=1)
    hz = np.fft.rfftfreq(n, 1 / rate)
    # Tone band and tone lines around a pole: share of its frequency, and at least so many lines
    width = max(0.01 * frequency, 4 * rate / n)
    spectrum[:, np.abs(hz - frequency) > width] = 0.0
    narrow = np.fft.irfft(spectrum, n, axis=1)
    power = np.mean(narrow**2, axis=1)
    strongest = narrow[int(np.argmax(power))]
    return float(np.mean(strongest**4) / max(float(np.mean(strongest**2)) ** 2, 1e-300))


def _of_parts(
    values: np.ndarray, rate: float, band: tuple[float, float], lines: list[Line]
) -> list[list[tuple[complex, np.ndarray]]]:
    """Pole and shape of each line in every part of the record that shows it."""
    found: list[list[tuple[complex, np.ndarray]]] = [[] for _ in lines]
    for part in np.array_split(np.arange(values.shape[1]), SEGMENTS):
        if part.size < 16 * BLOCKS[0]:
            return found
        own = stable(_diagram(values[:, part], rate, band), 4, 0.4)
        for k, line in enumerate(lines):
            shape = line.participation[-1]
            near = [
                o for o in own
                if abs(o.pole.imag - line.pole.imag) < max(
                    3 * abs(line.pole.real), 0.02 * line.pole.imag
                )
                and abs(np.vdot(o.participation[-1], shape)) ** 2 > 0.8
            ]  # fmt: skip
            if near:
                best = min(near, key=lambda o: abs(o.pole - line.pole))
                found[k].append((best.pole, best.participation[-1]))
    return found


def _mode(line: Line, parts: list[tuple[complex, np.ndarray]], size: np.ndarray) -> Mode:
    shape = line.participation[-1] * size
    shape = shape * realign(shape) / np.linalg.norm(shape)
    poles, root = np.array([pole for pole, _ in parts]), np.sqrt(len(parts))
    hz_sd = float(np.std(np.abs(poles), ddof=1) / (2 * np.pi) / root)
    damping_sd = float(np.std(-poles.real / np.abs(poles), ddof=1) / root)
    others = np.array([own * size for _, own in parts])
    others = others * (others.conj() @ shape / np.sum(np.abs(others) ** 2, axis=1))[:, None]
    shape_sd = np.sqrt(np.mean(np.abs(others - shape) ** 2, axis=0) / 2) / root
    likely = float(np.clip(0.3 * line.share + 0.7 * len(parts) / SEGMENTS, 0.0, 1.0))
    return Mode(
        line.frequency_hz, hz_sd, line.damping_ratio, damping_sd, *UNSCALED, shape, likely,
        shape_sd, collinearity=phase_collinearity(shape), deviation_deg=phase_deviation_deg(shape),
    )  # fmt: skip
