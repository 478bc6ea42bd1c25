"""Artefacts of the measurement, looked for before any physics, and recordings corrected for them.

A matrix A and a delay between true and recorded accelerations are the same at all poses, for all
modes and all levels; no physics of the robot is. They are fitted together with the simulation's
springs and inertias (`chain.SensorChain`), and A is then read: a rotation, one channel's gain, one
channel's sign, or two channels exchanged.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from planner.dataset.dataset import Dataset
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.sensor_chain import SensorChain
from planner.diagnosis.finding import Finding
from planner.diagnosis.linear.fit import fit
from planner.diagnosis.linear.problem import Problem, tolerances_of
from planner.diagnosis.screens.exponential_window import screen_window
from planner.diagnosis.thresholds import (
    ALIKE,
    CHAIN_MISFIT,
    CLEAR,
    DELAY_OFF_S,
    DELAY_SD_S,
    MATRIX_OFF,
    READ_GAIN_LOG_SD,
    READ_ROTATION_SD,
    READ_SCALE_SD,
)
from planner.dynamics.simulation import Simulation
from planner.inference.evidence import laplace, savage_dickey, temper
from planner.measurement.measured_frfs import common_band
from planner.measurement.nuisances import Tolerances
from planner.recording.points import SENSOR
from planner.recording.records import AXES, Hit

LATE_S = 1.5e-3, 3e-3, 4.5e-3, 6e-3  # delays to begin with: from none, a large one is not found


@dataclass(frozen=True, eq=False)
class _Kind:
    """A family of matrices A(p), p being normal around 0 with `sd` (count,)."""

    effect: str
    at: str
    base: np.ndarray
    sd: np.ndarray

    def matrix(self, p: np.ndarray) -> np.ndarray:
        if self.effect == "sensor_rotation":
            return Rotation.from_rotvec(p).as_matrix()
        if self.effect == "sensor_gain":
            return self.base + (np.exp(p[0]) - 1) * np.outer(
                *2 * [self.base[AXES.index(self.at[-1])]]
            )
        return self.base


def _kinds() -> tuple[_Kind, ...]:
    one, none = np.eye(3), np.zeros(0)
    found = [
        _Kind("", "", one, none),
        _Kind("sensor_rotation", "sensor", one, np.full(3, READ_ROTATION_SD)),
    ]
    for i, axis in enumerate(AXES):
        found.append(_Kind("sensor_gain", f"sensor_{axis}", one, np.array([READ_GAIN_LOG_SD])))
        found.append(_Kind("polarity", f"sensor_{axis}", one - 2 * np.outer(one[i], one[i]), none))
    for i, j in combinations(range(3), 2):
        order = [j if k == i else i if k == j else k for k in range(3)]
        found.append(_Kind("swapped_axes", f"sensor_{AXES[i]}{AXES[j]}", one[order], none))
    return tuple(found)


KINDS = _kinds()


@dataclass(frozen=True, eq=False)
class Chain:
    """What a sensor's chain was found to be: A (3, 3), its covariance (9, 9), delay and sd in s.

    `gain` is by how much log evidence the data prefer it to a perfect chain.
    """

    sensor: str

    matrix: np.ndarray
    covariance: np.ndarray
    delay_s: float
    delay_sd_s: float
    misfit: float
    gain: float


def screen(recorded: Dataset, nominal: Simulation, *, chain: bool = True) -> tuple[Finding, ...]:
    """All artefacts that are clear, without `chain` windows alone; none where all is in order."""
    window = screen_window(recorded)
    told = window is not None and window.log_evidence > CLEAR
    found = [window] if window is not None and told else []
    clean = correct(recorded, found)
    told, t = [*found], tolerances_of(nominal)
    chains = [measure_chain(clean, nominal, s) for s in _triaxial(clean)] if chain else []
    if chains:
        told.append(_delay(chains, t))
    told += [f for f in (_matrix(one, t) for one in chains) if f]
    if len({visit.pose for visit in recorded.visits}) < 2:  # there all else may look the same
        told = [f for f in told if f.effect != "sensor_gain"]
    return tuple(f for f in told if f.log_evidence > CLEAR)


def _triaxial(recorded: Dataset) -> list[str]:
    """Sensors with all three axes, by which one alone tells a matrix."""
    hits = [hit for visit in recorded.visits for hit in visit.hits]
    return [
        name for name in recorded.sensors if any(hit.channels_of(name) is not None for hit in hits)
    ]


def measure_chain(recorded: Dataset, nominal: Simulation, sensor: str = SENSOR) -> Chain:
    """Fit A and delay of a sensor together with springs and inertias, to what it alone heard."""
    recorded = recorded if recorded.sensors == (sensor,) else recorded.channels_of(sensor)
    band = common_band(recorded.visit_frfs, recorded.band_hz)
    # Tolerances of the chain would hide what is looked for: they count when it is told.
    problem = Problem(recorded.visit_frfs, recorded.visit_q, nominal, band, exact=True)
    plain = fit(problem, Effect(""))
    bases = [kind.base for kind in KINDS if kind.effect != "sensor_gain"]
    effect = SensorChain.build(bases, late_s=LATE_S, sensor=sensor)
    found = fit(problem, effect)
    near = fit(problem, SensorChain.build([np.eye(3)], sensor=sensor), [plain])
    best = min(found, near, key=lambda f: f.per_value)
    t = temper(best.per_value, ALIKE)
    covariance = np.linalg.inv(best.precision(t))[-10:, -10:]
    psi = best.x[-10:]
    gain = float(plain.data.chi2.sum() - best.data.chi2.sum()) / (2 * t)
    return Chain(
        sensor,
        effect.matrix(psi),
        covariance[1:, 1:],
        float(psi[0]),
        float(np.sqrt(covariance[0, 0])),
        best.per_value,
        gain,
    )


def _off(chain: Chain, bounds: tuple[float, float]) -> float:
    low, high = bounds
    return float(np.hypot(low, high * np.sqrt(chain.misfit / CHAIN_MISFIT)))


def _delay(chains: Sequence[Chain], t: Tolerances) -> Finding:
    """One analyser records all sensors: what it delays, each of them shows.

    Where they disagree by more than their sds (physics that the simulation lacks may look like a
    delay at one of them), the sd of what they have in common grows with that (Birge 1932).
    """
    late = np.array([c.delay_s for c in chains])
    weight = np.array([c.delay_sd_s**2 + _off(c, DELAY_OFF_S) ** 2 for c in chains]) ** -1
    mean = float(weight @ late / weight.sum())
    apart = float(weight @ (late - mean) ** 2) / max(len(chains) - 1, 1)
    sd = float(np.sqrt(max(apart, 1.0) / weight.sum()))
    usual = float(np.hypot(sd, t.delay_s))  # what every chain has is no artefact
    evidence = min(savage_dickey(mean, usual, DELAY_SD_S), sum(c.gain for c in chains))
    text = (
        f"All responses come {1e3 * mean:.3g} ± {1e3 * sd:.1g} ms after the force: the "
        f"phase falls in proportion to frequency. Check filters and sampling of the channels."
    )
    return Finding("channel_delay", SENSOR, evidence, {"delay": (mean, sd, "s")}, text)


def _matrix(chain: Chain, t: Tolerances) -> Finding | None:
    usual = np.where(np.eye(3), t.gain, t.across).ravel()
    covariance = chain.covariance + _off(chain, MATRIX_OFF) ** 2 * np.eye(9) + np.diag(usual**2)
    weight = np.linalg.cholesky(np.linalg.inv(covariance)).T
    read = [_read(kind, chain.matrix, weight) for kind in KINDS]
    best = int(np.argmax([evidence for evidence, *_ in read]))
    evidence, p, sd = read[best]
    kind = KINDS[best]
    if not kind.effect:
        return None
    parameters, text = _say(kind, p, sd)
    if chain.sensor != SENSOR:
        text = text.replace("he sensor", f"he sensor at {chain.sensor}", 1)
    odds = min(evidence - read[0][0], chain.gain)
    at = kind.at.replace(SENSOR, chain.sensor, 1)
    return Finding(kind.effect, at, odds, parameters, text)


def _read(
    kind: _Kind, matrix: np.ndarray, weight: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """Log evidence, p and its sd of A = e^scale A(p), where scale is the robot's mass."""
    prior = np.concatenate([[READ_SCALE_SD], kind.sd])

    def residual(x: np.ndarray) -> np.ndarray:
        off = (np.exp(x[0]) * kind.matrix(x[1:]) - matrix).ravel()
        return np.concatenate([weight @ off, x / prior])

    start = np.zeros(len(prior))
    if kind.effect == "sensor_rotation":
        left, _, right = np.linalg.svd(matrix)
        turn = left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
        start[1:] = Rotation.from_matrix(turn).as_rotvec()
    found = least_squares(residual, start)
    precision = found.jac.T @ found.jac
    sd = np.sqrt(np.diagonal(np.linalg.inv(precision)))
    off, away = np.split(found.fun, [matrix.size])
    return laplace(float(off @ off), away, precision, prior, 1.0), found.x[1:], sd[1:]


def _say(
    kind: _Kind, p: np.ndarray, sd: np.ndarray
) -> tuple[dict[str, tuple[float, float, str]], str]:
    channel = kind.at.removeprefix("sensor_")
    if kind.effect == "sensor_rotation":
        angle = float(np.linalg.norm(p))
        names = [f"rotation_{axis}" for axis in AXES]
        told = {n: (float(v), float(s), "rad") for n, v, s in zip(names, p, sd, strict=True)}
        spread = float(np.linalg.norm(sd * p) / angle)
        told["angle"] = (angle, spread, "rad")
        axis = ", ".join(f"{v / angle:.2f}" for v in p)
        return told, (
            f"The sensor is mounted askew: what it shows is turned by {np.rad2deg(angle):.1f} ± "
            f"{np.rad2deg(spread):.1f}° about ({axis}); correct the sensor frame or its mounting."
        )
    if kind.effect == "sensor_gain":
        gain = float(np.exp(p[0]))
        return {"gain": (gain, gain * float(sd[0]), "1")}, (
            f"Channel {channel} of the sensor shows {gain:.3g} ± {gain * sd[0]:.1g} times the true "
            f"acceleration at all poses: check its sensitivity."
        )
    if kind.effect == "polarity":
        return {}, f"Channel {channel} of the sensor has the wrong sign: check mounting and wiring."
    return {}, f"Channels {channel[0]} and {channel[1]} of the sensor are exchanged."


def matrix_of(finding: Finding, sensor: str = SENSOR) -> np.ndarray:
    """A (3, 3) of a finding; the identity where it is no matter of the sensor's channels."""
    for kind in KINDS:
        if (kind.effect, kind.at.replace(SENSOR, sensor, 1)) == (finding.effect, finding.at):
            if kind.effect == "sensor_rotation":
                return kind.matrix(np.array([finding.parameters[f"rotation_{a}"][0] for a in AXES]))
            if kind.effect == "sensor_gain":
                return kind.matrix(np.log([finding.parameters["gain"][0]]))
            return kind.base
    return np.eye(3)


def correct(recorded: Dataset, findings: Sequence[Finding]) -> Dataset:
    """Recordings without the artefacts that were found; other findings change nothing.

    Accelerations are turned and shifted back; a window's rate is told to all that is estimated
    from them (`window_rate_1_s`) and the samples keep it.
    """
    inverse: dict[str, np.ndarray] = {}
    delay, rate = dict.fromkeys(recorded.sensors, 0.0), recorded.window_rate_1_s
    for finding in findings:
        for sensor in recorded.sensors:
            own = np.linalg.inv(matrix_of(finding, sensor))
            if not np.array_equal(own, np.eye(3)):
                inverse[sensor] = inverse.get(sensor, np.eye(3)) @ own
            if finding.effect == "channel_delay":
                delay[sensor] += finding.parameters["delay"][0]
        if finding.effect == "exponential_window":
            rate += finding.parameters["rate"][0]
    if inverse or any(delay.values()):
        visits = tuple(
            replace(v, hits=tuple(_corrected(hit, inverse, delay) for hit in v.hits))
            for v in recorded.visits
        )
        return recorded.corrected(visits, rate)
    return (
        recorded if rate == recorded.window_rate_1_s else recorded.corrected(recorded.visits, rate)
    )


def _corrected(hit: Hit, inverse: Mapping[str, np.ndarray], delay_s: Mapping[str, float]) -> Hit:
    for sensor in hit.layout.sensors:
        rows = [i for i, dof in enumerate(hit.responses) if dof.node == sensor]
        if len(rows) == len(AXES) and (sensor in inverse or delay_s[sensor]):
            own = _turned_back(hit, rows, inverse.get(sensor, np.eye(3)), delay_s[sensor])
            a = hit.acceleration_m_s2.copy()
            a[rows] = own
            hit = replace(hit, acceleration_m_s2=a)
    return hit


def _turned_back(hit: Hit, rows: list[int], inverse: np.ndarray, delay_s: float) -> np.ndarray:
    """Accelerations (3, n) of one sensor as they were, of its rows x, y, z."""
    a = inverse @ hit.acceleration_m_s2[rows]
    if delay_s:
        n = a.shape[1]
        early = np.exp(2j * np.pi * np.fft.rfftfreq(2 * n, 1 / hit.sampling_rate_hz) * delay_s)
        # Mirrored at its end, so that no step is shifted.
        whole = np.concatenate([a, a[:, ::-1]], axis=1)
        a = np.fft.irfft(np.fft.rfft(whole, axis=1) * early, 2 * n, axis=1)[:, :n]
    return a
