"""A robot with something concealed, the sensor that listens to it, and the hits on it."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from planner.truth.deviation import Deviation
from planner.truth.hits import AXES, OVERSAMPLING, Hammer, SimulatedHit, pulse, sampled
from planner.truth.model import Truth
from planner.truth.nonlinear import Port, respond, structural


@dataclass(frozen=True)
class Drift:
    """All stiffnesses times 1 + change · course(progress), progress 0 to 1 over the campaign.

    course: "linear", "warming" (1 - exp(-4 p), nearly done at the end) or "step" (at half).
    """

    change: float
    course: str = "linear"

    def factor(self, progress: float) -> float:
        """The factor at a time of the campaign."""
        courses = {
            "linear": progress,
            "warming": 1 - np.exp(-4 * progress),
            "step": float(progress >= 0.5),
        }
        return float(1 + self.change * courses[self.course])


@dataclass(frozen=True)
class Tone:
    """A force (N) of one frequency on a link's origin, at any phase; direction in the world."""

    link: str
    direction: tuple[float, float, float]
    frequency_hz: float
    force_n: float


@dataclass(frozen=True, eq=False)
class Artefact:
    """What the measuring chain does wrong, without anybody knowing.

    `rotation` and `gain` make x' = gain · rotation · x of the sensor's channels; all of them come
    late by `delay_s`; all channels are multiplied by exp(-t / window_s) from the hit on.
    """

    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    delay_s: float = 0.0
    window_s: float = np.inf


@dataclass(frozen=True)
class Secret:
    """What is concealed: physics of the robot, disturbances, and artefacts of the measurement."""

    deviation: Deviation
    ports: tuple[Port, ...] = ()
    loss_factor: float | None = None
    drift: Drift | None = None
    tone: Tone | None = None
    artefact: Artefact = field(default_factory=Artefact)


def hit_pose(
    truth: Truth,
    secret: Secret,
    q: np.ndarray,
    hits: Sequence[tuple[str, float]],
    hammer: Hammer,
    rng: np.random.Generator,
    progress: float = 0.0,
) -> list[SimulatedHit]:
    """Hits (axis "+x", peak in N) at a pose (rad); `truth` has the secret's deviation."""
    step_s = 1 / (hammer.sampling_rate_hz * OVERSAMPLING)
    forces = np.array([pulse(replace(hammer, peak_n=peak), rng) for _, peak in hits])
    senses = np.array([-1.0 if axis[0] == "-" else 1.0 for axis, _ in hits])
    axes = [AXES.index(axis[1]) for axis, _ in hits]
    now = truth if secret.drift is None else truth.changed(secret.drift.factor(progress))
    signed = senses[:, None] * forces
    if secret.loss_factor is not None:
        responses = structural(now, secret.loss_factor, q, signed, axes, step_s)
    else:
        responses = respond(now, secret.ports, q, signed, axes, step_s)
    if secret.tone is not None:
        phases = rng.uniform(0, 2 * np.pi, len(hits))
        responses = responses + _hum(now, secret.tone, q, phases, step_s, forces.shape[1])
    wrong = [_heard(secret.artefact, response, step_s) for response in responses]
    return [
        _windowed(secret.artefact, sampled(axis, force, response, hammer, rng), hammer)
        for (axis, _), force, response in zip(hits, forces, wrong, strict=True)
    ]


def _hum(
    truth: Truth, tone: Tone, q: np.ndarray, phases: np.ndarray, step_s: float, n: int
) -> np.ndarray:
    """Steady accelerations (h, 3, n) that a tone gives."""
    poles, shapes, entry, _, sensor = truth.modal(q)
    at = truth.along(q, tone.link, np.zeros(3), np.array(tone.direction))
    iw = 2j * np.pi * tone.frequency_hz
    steady = tone.force_n * iw**2 * (sensor @ shapes) @ ((entry @ at) / (iw - poles))
    turning = np.exp(iw * np.arange(n) * step_s + 1j * phases[:, None])
    return np.real(steady[None, :, None] * turning[:, None, :])


def _heard(artefact: Artefact, response: np.ndarray, step_s: float) -> np.ndarray:
    late = round(artefact.delay_s / step_s)
    mixed = np.array(artefact.gain)[:, None] * (artefact.rotation @ response)
    return np.pad(mixed, ((0, 0), (late, 0)))[:, : response.shape[1]]


def _windowed(artefact: Artefact, hit: SimulatedHit, hammer: Hammer) -> SimulatedHit:
    t = np.arange(hit.force_n.size) / hammer.sampling_rate_hz
    window = np.exp(-np.maximum(t - hammer.pretrigger_s, 0.0) / artefact.window_s)
    return SimulatedHit(hit.axis, window * hit.force_n, window * hit.acceleration_m_s2)


def frfs(
    truth: Truth,
    secret: Secret,
    q: np.ndarray,
    peak_n: float,
    hammer: Hammer,
    band_hz: tuple[float, float],
    seed: int = 0,
    progress: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (F,) in Hz and FRFs (3, 3, F) in m/s²/N of one hit along each axis."""
    rng = np.random.default_rng(seed)
    hits = [(f"+{axis}", peak_n) for axis in AXES]
    found = hit_pose(truth, secret, q, hits, hammer, rng, progress)
    frequency = np.fft.rfftfreq(found[0].force_n.size, 1 / hammer.sampling_rate_hz)
    used = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    columns = [
        np.fft.rfft(hit.acceleration_m_s2)[:, used] / np.fft.rfft(hit.force_n)[used]
        for hit in found
    ]
    return frequency[used], np.stack(columns, axis=1)
