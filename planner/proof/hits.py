"""Simulated hammer hits: exact response to a pulse, the analyser's filter, noise."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import signal

from planner.proof.model import Truth

OVERSAMPLING = 16  # time steps of the solution per sample of the analyser
AXES = ("x", "y", "z")
LEAST_HZ = 0.2  # below which 1/f noise grows no more
FULL_SCALE = 4.0  # of a converter over what comes
FLOOR_DAMPING = 0.3  # ratio, of a floor's first mode with machines on it; chosen


def signed(axis: str) -> tuple[int, float]:
    """Number and sense of an axis such as "-y": 1, -1.0."""
    return AXES.index(axis[1]), -1.0 if axis[0] == "-" else 1.0


@dataclass(frozen=True)
class Hammer:
    """What the person, the hammer, the analyser and the floor are like.

    Noise is relative: of the responses to the hit's largest response (rms), of the force to its
    peak. Readback angles scatter by `readback_deg` around the setpoint.
    """

    peak_n: float = 1200.0
    duration_s: float = 0.008
    sampling_rate_hz: float = 400.0
    record_s: float = 2.56
    pretrigger_s: float = 0.06
    noise: float = 0.02
    force_noise: float = 5e-4
    readback_deg: float = 0.01
    oversampling: int = OVERSAMPLING
    corner_hz: float = 0.0  # below which noise grows as 1/f
    bits: int = 0  # of the converter, whose full scale is four times what comes; 0: exact
    rumble_m_s2: float = 0.0  # rms of the floor's slow vibration, in every channel
    rumble_hz: float = 4.0  # where most of it is

    @property
    def step_s(self) -> float:
        """Between time steps of the solution."""
        return 1 / (self.sampling_rate_hz * self.oversampling)


@dataclass(frozen=True, eq=False)
class SimulatedHit:
    """force_n (n,) ≥ 0 along `axis` of the hit point, acceleration_m_s2 (3s, n) of the sensors."""

    axis: str
    force_n: np.ndarray
    acceleration_m_s2: np.ndarray
    hit_point: str = "tcp"
    sensors: tuple[str, ...] = ("sensor",)


def simulate_hit(
    truth: Truth, q: np.ndarray, axis: str, hammer: Hammer, rng: np.random.Generator
) -> SimulatedHit:
    """One hit at pose q (rad) along a signed axis of the tcp frame ("+x")."""
    force = pulse(hammer, rng)
    index, sense = signed(axis)
    response = truth.respond(q, sense * force, index, hammer.step_s)
    return noisy(sampled(axis, force, response, hammer), hammer, rng)


def pulse(hammer: Hammer, rng: np.random.Generator) -> np.ndarray:
    """A hammer's pulse (n,) at the fine rate, sin^1.5 over its duration; no two hits are alike."""
    rate_hz = 1 / hammer.step_s
    t = np.arange(round(hammer.record_s * rate_hz)) / rate_hz
    start = hammer.pretrigger_s + rng.uniform(0, 2 / hammer.sampling_rate_hz)
    duration = hammer.duration_s * rng.uniform(0.85, 1.15)
    phase = np.clip((t - start) / duration, 0.0, 1.0)
    return hammer.peak_n * rng.uniform(0.75, 1.25) * np.sin(np.pi * phase) ** 1.5


def sampled(axis: str, force: np.ndarray, response: np.ndarray, hammer: Hammer) -> SimulatedHit:
    """What the analyser keeps of a force (n,) and responses (3, n) at the fine rate, noise-free."""
    fine = hammer.sampling_rate_hz * hammer.oversampling
    # The analyser's anti-alias filter, the same on all channels.
    sos = signal.butter(6, 0.4 * hammer.sampling_rate_hz, fs=fine, output="sos")
    filtered = np.asarray(signal.sosfilt(sos, np.vstack([force, response])))
    step = hammer.oversampling
    return SimulatedHit(axis, filtered[0, ::step], filtered[1:, ::step])


def largest_rms(hit: SimulatedHit) -> float:
    """Of the accelerations, in m/s²."""
    return float(np.max(np.sqrt(np.mean(hit.acceleration_m_s2**2, axis=1))))


def noisy(hit: SimulatedHit, hammer: Hammer, rng: np.random.Generator) -> SimulatedHit:
    """The hit with the noise of all channels, and the floor's rumble."""
    f, a = hit.force_n, hit.acceleration_m_s2
    f = f + hammer.force_noise * np.max(f) * _noise(f.shape, hammer, rng)
    a = a + hammer.noise * largest_rms(hit) * _noise(a.shape, hammer, rng)
    if hammer.rumble_m_s2 > 0:
        a = a + _rumble(a.shape, hammer, rng)
    f, a = (_converted(samples, hammer) for samples in (f, a))
    return replace(hit, force_n=f, acceleration_m_s2=a)


def noise_power(hit: SimulatedHit, hammer: Hammer) -> np.ndarray:
    """Mean square (lines,) of an acceleration channel's noise in each line of `rfft`; of `hit`."""
    n = hit.force_n.size
    own = n * (hammer.noise * largest_rms(hit)) ** 2 * _pink(n, hammer)
    return own + (n * hammer.rumble_m_s2) ** 2 * _rumble_shape(n, hammer)


def _noise(shape: tuple[int, ...], hammer: Hammer, rng: np.random.Generator) -> np.ndarray:
    """White noise of 1, and 1/f below the corner."""
    white = rng.standard_normal(shape)
    if hammer.corner_hz == 0:
        return white
    shaped = np.fft.rfft(white) * np.sqrt(_pink(shape[-1], hammer))
    return np.fft.irfft(shaped, shape[-1])


def _pink(n: int, hammer: Hammer) -> np.ndarray:
    """Power (lines,) of noise over that of white noise."""
    frequency = np.fft.rfftfreq(n, 1 / hammer.sampling_rate_hz)
    return 1 + hammer.corner_hz / np.maximum(frequency, LEAST_HZ)


def _converted(samples: np.ndarray, hammer: Hammer) -> np.ndarray:
    if hammer.bits == 0:
        return samples
    step = 2 * FULL_SCALE * np.max(np.abs(samples)) / 2**hammer.bits
    return np.round(samples / step) * step


def _rumble_shape(n: int, hammer: Hammer) -> np.ndarray:
    """Shares (lines,) of the lines of `rfft` in a rumble's mean square: a floor's first mode."""
    frequency = np.fft.rfftfreq(n, 1 / hammer.sampling_rate_hz)
    ratio = frequency / hammer.rumble_hz
    power = ratio**2 / ((1 - ratio**2) ** 2 + (2 * FLOOR_DAMPING * ratio) ** 2)
    return power / (2 * np.sum(power))  # each line stands for two


def _rumble(shape: tuple[int, ...], hammer: Hammer, rng: np.random.Generator) -> np.ndarray:
    n = shape[-1]
    size = n * hammer.rumble_m_s2 * np.sqrt(_rumble_shape(n, hammer) / 2)
    phase = rng.standard_normal((2, *shape[:-1], n // 2 + 1))
    return np.fft.irfft(size * (phase[0] + 1j * phase[1]), n)
