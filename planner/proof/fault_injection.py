"""A robot with something concealed, the sensor that listens to it, and the hits on it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import ndimage

from planner.proof.deviation import Deviation
from planner.proof.hits import AXES, Hammer, SimulatedHit, noisy, pulse, sampled, signed
from planner.proof.measurement_errors import EXACT, HitError, MeasurementErrors, MeasuringChain
from planner.proof.model import Truth
from planner.proof.nonlinear import HitPose, Port, respond

# How far a drift has come, of progress 0 to 1 over the campaign.
COURSES: dict[str, Callable[[float], float]] = {
    "linear": lambda progress: progress,
    "warming": lambda progress: 1 - np.exp(-4 * progress),  # nearly done at the end
    "step": lambda progress: float(progress >= 0.5),
}


@dataclass(frozen=True)
class JointDrift:
    """Stiffnesses that warm up or settle joint by joint: (joint, change, course) of each.

    They are multiplied by 1 + change · course(progress), by one of COURSES; joint "": every spring.
    """

    joints: tuple[tuple[str, float, str], ...]

    def applied(self, truth: Truth, progress: float) -> Truth:
        """The robot at a time of the campaign."""
        factors = np.ones(len(truth.springs))
        for joint, change, course in self.joints:
            own = [joint in ("", spring.joint) for spring in truth.springs]
            factors[own] *= 1 + change * COURSES[course](progress)
        return truth.changed(factors)


@dataclass(frozen=True)
class DampingScatter:
    """Every joint's damping times a factor of its own at each visit, of log-sd `sd`.

    Brakes engage anew, grease is warm or cold.
    """

    sd: float
    seed: int = 0

    def applied(self, truth: Truth, progress: float) -> Truth:
        """The robot at a time of the campaign: the same at the same `progress`."""
        rng = np.random.default_rng([self.seed, round(1e6 * progress)])
        names = dict.fromkeys(spring.joint for spring in truth.springs)
        factors = {name: float(np.exp(self.sd * rng.standard_normal())) for name in names}
        return truth.changed(damping=np.array([factors[s.joint] for s in truth.springs]))


@dataclass(frozen=True)
class LoadChange:
    """From a time of the campaign on, a link has `factor` times its mass and inertia."""

    link: str
    factor: float
    start: float = 0.5


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

    `rotation` and `gain` make x' = gain · rotation · x of one sensor's channels; all of them come
    late by `delay_s`; all channels are multiplied by exp(-t / window_s) from the hit on.
    """

    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    delay_s: float = 0.0
    window_s: float = np.inf
    sensor: str = "sensor"


@dataclass(frozen=True)
class InjectedFaults:
    """What is concealed: physics of the robot, disturbances, and artefacts of the measurement.

    `chain` is what is no artefact: a measuring chain within its tolerances. That of sensors at
    other points is in `chains`, by point, but for force and delay, which are common.
    """

    deviation: Deviation
    ports: tuple[Port, ...] = ()
    drift: JointDrift | DampingScatter | None = None
    load: LoadChange | None = None
    tone: Tone | None = None
    artefact: Artefact = field(default_factory=Artefact)
    chain: MeasuringChain = field(default_factory=MeasuringChain)
    chains: Mapping[str, MeasuringChain] = field(default_factory=dict)

    def at(self, truth: Truth, progress: float) -> Truth:
        """The robot at a time of the campaign."""
        if self.load is not None and progress >= self.load.start:
            truth = truth.loaded(self.load.link, self.load.factor)
        return truth if self.drift is None else self.drift.applied(truth, progress)


@dataclass(frozen=True, eq=False)
class HitVisit:
    """Hits (axis "+x", peak in N) at a pose q (rad); progress 0 to 1 through the campaign.

    `aims`, one a hit, say how each misses its axis and the point that is hit; none: all are exact.
    `hit_point` and `sensors` are points of robot.toml, or the tool's own.
    """

    q: np.ndarray
    shots: Sequence[tuple[str, float]]
    progress: float = 0.0
    aims: Sequence[HitError] = ()
    hit_point: str = "tcp"
    sensors: tuple[str, ...] = ("sensor",)


def hand_visits(
    errors: MeasurementErrors,
    q: np.ndarray,
    shots: Sequence[tuple[str, float]],
    rng: np.random.Generator,
    common: Sequence[HitError] = EXACT,
) -> list[HitVisit]:
    """Visits of poses whose readback is q (n, dof) in rad, the same shots at each.

    The robot stands beside its readback, each hit misses by itself and by what is in common.
    """
    axes = [AXES.index(axis[1]) for axis, _ in shots]
    found = []
    for number, one in enumerate(q):
        there = errors.beside(one, rng)
        found.append(HitVisit(there, shots, number / len(q), errors.aims(axes, rng, common)))
    return found


def hit_poses(
    truth: Truth,
    injected: InjectedFaults,
    visits: Sequence[HitVisit],
    hammer: Hammer,
    rng: np.random.Generator,
) -> list[list[SimulatedHit]]:
    """All hits of all visits; `truth` has the secret's deviation."""
    quiet = quiet_hits(truth, injected, visits, hammer, rng)
    return [
        [windowed(injected.artefact, noisy(hit, hammer, rng), hammer) for hit in hits]
        for hits in quiet
    ]


def quiet_hits(
    truth: Truth,
    injected: InjectedFaults,
    visits: Sequence[HitVisit],
    hammer: Hammer,
    rng: np.random.Generator,
) -> list[list[SimulatedHit]]:
    """The same without noise and before any window; the pulses depend on `rng` alone."""
    offsets = {name: chain.offset_m for name, chain in injected.chains.items()}
    truth = replace(truth, sensor_offset_m=injected.chain.offset_m, offsets_m=offsets)
    pulses = [
        np.array([pulse(replace(hammer, peak_n=peak), rng) for _, peak in visit.shots])
        for visit in visits
    ]
    responses = _responses(truth, injected, visits, pulses, hammer.step_s, rng)
    gain, step_s = injected.chain.force_gain, hammer.step_s
    return [
        [
            replace(
                sampled(axis, gain * force, _heard(injected, a, step_s, visit.sensors), hammer),
                hit_point=visit.hit_point,
                sensors=visit.sensors,
            )
            for (axis, _), force, a in zip(visit.shots, forces, response, strict=True)
        ]
        for visit, forces, response in zip(visits, pulses, responses, strict=True)
    ]


def _responses(
    truth: Truth,
    injected: InjectedFaults,
    visits: Sequence[HitVisit],
    pulses: Sequence[np.ndarray],
    step_s: float,
    rng: np.random.Generator,
) -> list[np.ndarray]:
    """Accelerations (h, 3s, n) of the sensors at each visit."""
    poses = []
    for visit, forces in zip(visits, pulses, strict=True):
        now = injected.at(truth, visit.progress)
        now = replace(now, hit_point=visit.hit_point, sensors=visit.sensors)
        axes, senses = zip(*(signed(axis) for axis, _ in visit.shots), strict=True)
        aims = visit.aims or [HitError()] * len(axes)
        wrench = np.array([a.wrench(axis) for a, axis in zip(aims, axes, strict=True)])
        poses.append(HitPose(now, visit.q, np.array(senses)[:, None] * forces, wrench))
    responses = respond(poses, injected.ports, step_s)
    if injected.tone is None:
        return responses
    return [
        response + _hum(pose, injected.tone, rng.uniform(0, 2 * np.pi, len(response)), step_s)
        for pose, response in zip(poses, responses, strict=True)
    ]


def _hum(pose: HitPose, tone: Tone, phases: np.ndarray, step_s: float) -> np.ndarray:
    """Steady accelerations (h, 3, n) that a tone gives."""
    poles, shapes, entry, _, sensor = pose.truth.modal(pose.q)
    at = pose.truth.along(pose.q, tone.link, np.zeros(3), np.array(tone.direction))
    iw = 2j * np.pi * tone.frequency_hz
    steady = tone.force_n * iw**2 * (sensor @ shapes) @ ((entry @ at) / (iw - poles))
    turning = np.exp(iw * np.arange(pose.forces_n.shape[1]) * step_s + 1j * phases[:, None])
    return np.real(steady[None, :, None] * turning[:, None, :])


def _heard(
    injected: InjectedFaults, response: np.ndarray, step_s: float, sensors: Sequence[str]
) -> np.ndarray:
    """What the sensors show (3s, n); the artefact is one of `artefact.sensor`'s channels."""
    artefact, chain = injected.artefact, injected.chain
    each = []
    for sensor, own in zip(sensors, np.split(response, len(sensors)), strict=True):
        of_tool = chain if sensor == "sensor" else MeasuringChain()
        matrix = injected.chains.get(sensor, of_tool).matrix
        if sensor == artefact.sensor:
            matrix = np.array(artefact.gain)[:, None] * (artefact.rotation @ matrix)
        each.append(matrix @ own)
    mixed = np.concatenate(each)
    late = (artefact.delay_s + chain.delay_s) / step_s
    return mixed if late == 0 else ndimage.shift(mixed, (0, late), order=3)


def windowed(artefact: Artefact, hit: SimulatedHit, hammer: Hammer) -> SimulatedHit:
    """The hit times the window that was left on it."""
    t = np.arange(hit.force_n.size) / hammer.sampling_rate_hz
    window = np.exp(-np.maximum(t - hammer.pretrigger_s, 0.0) / artefact.window_s)
    return replace(
        hit, force_n=window * hit.force_n, acceleration_m_s2=window * hit.acceleration_m_s2
    )


def frfs(
    truth: Truth,
    injected: InjectedFaults,
    visits: Sequence[HitVisit],
    hammer: Hammer,
    band_hz: tuple[float, float],
) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (F,) in Hz and FRFs (visit, 3, 3, F) in m/s²/N of visits from `once`."""
    recorded = hit_poses(truth, injected, visits, hammer, np.random.default_rng(0))
    n = recorded[0][0].force_n.size
    frequency = np.fft.rfftfreq(n, 1 / hammer.sampling_rate_hz)
    used = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    columns = [
        [np.fft.rfft(h.acceleration_m_s2)[:, used] / np.fft.rfft(h.force_n)[used] for h in hits]
        for hits in recorded
    ]
    return frequency[used], np.moveaxis(np.array(columns), 1, 2)


def once(q: np.ndarray, peak_n: float, progress: float = 0.0) -> HitVisit:
    """One hit along each axis."""
    return HitVisit(q, [(f"+{axis}", peak_n) for axis in AXES], progress)
