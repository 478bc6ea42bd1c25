"""The measuring chain: sensor's place and mounting, gains, noise, converter, and its artefacts."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from planner.proof.tree.effects import Effect, log_uniform
from planner.proof.tree.hits import Clock
from planner.proof.tree.records import Motion, back, contour, shifted
from planner.proof.tree.spatial import random_turn, turn


@dataclass(frozen=True)
class Chain:
    """`matrix` (3, 3) on accelerations, `place` (m) off in the sensor's axes, gain of the force.

    `noise`: white rms (m/s2) and (N); `corner` (Hz) below which 1/f noise rules; converter's bits
    and full scale (m/s2), (N); readback's errors (rad) by pose.
    """

    matrix: np.ndarray
    place: np.ndarray
    force_gain: float
    noise: float
    force_noise: float
    corner: float
    bits: int
    scales: tuple[float, float]
    trembling: float  # rms of the floor's rumble at the sensor, m/s2
    artefact: dict[str, Any] = field(default_factory=dict)

    def sensed(self, motion: np.ndarray) -> np.ndarray:
        """Accelerations (…, 3, samples or lines) without noise from motion (…, 6, …)."""
        linear = motion[..., :3, :] + np.cross(
            motion[..., 3:, :], self.place[:, None], axisa=-2, axisb=-2, axisc=-2
        )
        return self.artefact.get("matrix", np.eye(3)) @ self.matrix @ linear


def draw_chain(rng: np.random.Generator, motions: list[Motion], artefact: dict[str, Any]) -> Chain:
    """Gains 1 to 2 %, cross-axis 1 to 3 %, mounting 1 deg, place 4 to 8 mm; noise by the hits."""
    gains = np.eye(3) + np.diag(rng.uniform(0.01, 0.02) * rng.normal(size=3))
    cross = rng.uniform(0.01, 0.03) * rng.normal(size=(3, 3)) * (1 - np.eye(3))
    mount = random_turn(rng, np.radians(1.0) * abs(rng.normal()) * 1.2)
    strongest = [np.max(np.sqrt(np.mean(m.motion[:3] ** 2, axis=1))) for m in motions]
    signal = float(np.median(strongest))
    peaks = max(float(np.max(np.abs(m.motion[:3]))) for m in motions)
    forces = np.array([np.max(m.force) for m in motions])
    noise = signal / log_uniform(rng, 40, 500)
    return Chain(
        gains @ (np.eye(3) + cross) @ mount, rng.uniform(0.004, 0.008) * rng.normal(size=3),
        1 + 0.02 * rng.normal(), noise, float(forces.min()) / log_uniform(rng, 400, 4000),
        float(rng.uniform(1, 10)), 24 if rng.random() < 0.7 else 16,
        (peaks * rng.uniform(2, 8), float(forces.max()) * rng.uniform(2, 5)),
        noise * log_uniform(rng, 0.1, 2), artefact,
    )  # fmt: skip


def noise_of(
    rng: np.random.Generator, rms: float, corner: float, shape: tuple, clock: Clock
) -> np.ndarray:
    """White noise of `rms` with 1/f power below `corner` Hz."""
    white = np.fft.rfft(rms * rng.normal(size=shape), axis=-1)
    lines = np.fft.rfftfreq(shape[-1], 1 / clock.rate)
    return np.fft.irfft(white * np.sqrt(1 + corner / np.maximum(lines, 0.2)), shape[-1], axis=-1)


def converted(signal: np.ndarray, bits: int, scale: float) -> np.ndarray:
    """Rounded to a converter's steps and clipped at full scale."""
    step = 2 * scale / 2**bits
    return np.clip(np.round(signal / step) * step, -scale, scale - step)


def recorded(
    rng: np.random.Generator, chain: Chain, motion: Motion, tremble: np.ndarray, clock: Clock
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Force (n), accelerations (3, n) as the file has them; and the accelerations' noise (3, n)."""
    clean = chain.sensed(motion.motion)
    delay = chain.artefact.get("delay", 0.0)
    if delay:
        s, sigma = contour(clock)
        clean = back(shifted(clean, sigma, clock) * np.exp(-s * delay), sigma, clock)
    rumbling = np.concatenate([tremble * chain.trembling, np.zeros_like(tremble)])
    noise = chain.sensed(rumbling) + noise_of(rng, chain.noise, chain.corner, clean.shape, clock)
    force = chain.force_gain * motion.force
    force = force + noise_of(rng, chain.force_noise, chain.corner, force.shape, clock)
    force = converted(force, chain.bits, chain.scales[1])
    answer = converted(clean + noise, chain.bits, chain.scales[0])
    window = chain.artefact.get("window")
    if window:
        shape = exponential(window["end"], clock)
        answer, noise = answer * shape, noise * shape
        force = force * shape if window["force_too"] else force
    return force, answer, noise


def exponential(end: float, clock: Clock) -> np.ndarray:
    """1 until the trigger, then falling to `end` at the record's end."""
    t = np.arange(clock.samples) / clock.rate - clock.trigger
    return end ** np.clip(t / t[-1], 0, None)


def _artefact(effect: str, at: str, parameters: dict, chain: dict) -> Effect:
    return Effect(effect, at, parameters, chain=chain)


def sensor_gain(rng: np.random.Generator, *_: Any) -> Effect:
    """One channel's sensitivity is entered wrongly: 0.8 to 1.25 of what it should be."""
    which = int(rng.integers(3))
    gain = float(np.exp(rng.choice([-1, 1]) * rng.uniform(0.02, np.log(1.25))))
    matrix = np.eye(3)
    matrix[which, which] = gain
    return _artefact("sensor_gain", f"sensor_{'xyz'[which]}", {"gain": gain}, {"matrix": matrix})


def polarity(rng: np.random.Generator, *_: Any) -> Effect:
    """One channel is the wrong way round."""
    which = int(rng.integers(3))
    matrix = np.eye(3)
    matrix[which, which] = -1
    return _artefact("polarity", f"sensor_{'xyz'[which]}", {"sign": -1}, {"matrix": matrix})


def channel_delay(rng: np.random.Generator, *_: Any) -> Effect:
    """The accelerations are late against the force by 0.1 to 2 ms."""
    delay = log_uniform(rng, 1e-4, 2e-3)
    return _artefact("channel_delay", "sensor", {"delay_s": delay}, {"delay": delay})


def sensor_rotation(rng: np.random.Generator, *_: Any) -> Effect:
    """The sensor is glued on turned by 10 to 90 deg about an axis of its own, or about any."""
    angle = log_uniform(rng, 10, 90) * float(rng.choice([-1, 1]))
    axis = np.eye(3)[rng.integers(3)]
    if rng.random() < 0.4:
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
    told = {"angle_deg": angle, "axis": axis.tolist()}
    return _artefact("sensor_rotation", "sensor", told, {"matrix": turn(axis, np.radians(angle)).T})


def exponential_window(rng: np.random.Generator, *_: Any) -> Effect:
    """The analyser multiplied by an exponential window and did not say so."""
    end, both = log_uniform(rng, 0.01, 0.5), bool(rng.integers(2))
    window = {"end": end, "force_too": both}
    return _artefact("exponential_window", "sensor", dict(window), {"window": window})


ARTEFACTS = (sensor_gain, polarity, channel_delay, sensor_rotation, exponential_window)
