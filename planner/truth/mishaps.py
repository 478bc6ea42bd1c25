"""What is no physics of the robot: artefacts of the measurement, and causes outside the library."""

from dataclasses import replace

import numpy as np

from planner.truth.deviation import Feedback
from planner.truth.laws import Contact
from planner.truth.nonlinear import Port
from planner.truth.scene import (
    Draw,
    Drawn,
    Parameters,
    Scene,
    deviate,
    log_uniform,
    some_direction,
    triple,
)
from planner.truth.secret import Secret, Tone


def sensor_rotation(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """The sensor is mounted askew."""
    axis, angle = some_direction(rng), scene.size * np.deg2rad(rng.uniform(10, 45))
    skew = np.cross(np.eye(3), axis)
    rotation = np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew
    parameters: Parameters = {"axis": axis.tolist(), "angle_rad": float(angle)}
    change = replace(secret, artefact=replace(secret.artefact, rotation=rotation))
    return Drawn("sensor_rotation", "sensor", parameters, change)


def _channel(effect: str, factor: float, secret: Secret, rng: np.random.Generator) -> Drawn:
    which = int(rng.integers(3))
    x, y, z = (g * factor if i == which else g for i, g in enumerate(secret.artefact.gain))
    change = replace(secret, artefact=replace(secret.artefact, gain=(x, y, z)))
    return Drawn(effect, f"sensor_{'xyz'[which]}", {"gain": factor}, change)


def sensor_gain(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A wrong sensitivity of one channel."""
    factor = log_uniform(rng, 0.5, 0.8) if rng.random() < 0.5 else log_uniform(rng, 1.25, 2.0)
    return _channel("sensor_gain", factor**scene.size, secret, rng)


def polarity(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """One channel has the wrong sign."""
    return _channel("polarity", -1.0, secret, rng)


def channel_delay(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """Responses come later than the force."""
    delay = scene.size * log_uniform(rng, 0.8e-3, 6e-3)
    change = replace(secret, artefact=replace(secret.artefact, delay_s=delay))
    return Drawn("channel_delay", "sensor", {"delay_s": delay}, change)


def exponential_window(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """The analyser's window is left in the recordings."""
    time = log_uniform(rng, 0.25, 1.0) / scene.size
    change = replace(secret, artefact=replace(secret.artefact, window_s=time))
    return Drawn("exponential_window", "sensor", {"time_constant_s": time}, change)


def environment_contact(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """Something presses against a link; it lets go when the link moves away far enough."""
    number, direction = int(rng.integers(3, 7)), some_direction(rng)
    port = Port(Contact(1.0, 1.0), "", f"link_{number}", (0.0, 0.0, 0.0), triple(direction))
    q = scene.poses[0]
    at, matrix = port.vector(scene.truth, q), scene.truth.matrices(q)[2]
    stiffness = scene.size * log_uniform(rng, 0.5, 3.0) / float(at @ np.linalg.solve(matrix, at))
    law = Contact(stiffness, log_uniform(rng, 1e-6, 1e-3))
    parameters: Parameters = {
        "cause": "environment_contact",
        "link": port.link,
        "stiffness": law.stiffness,
        "preload_m": law.preload,
        "direction": direction.tolist(),
    }
    change = replace(secret, ports=(*secret.ports, replace(port, law=law)))
    return Drawn("unknown", None, parameters, change)


def nonreciprocal_feedback(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A controller turns one joint's twist into another's torque."""
    driven, sensed = (f"joint_{i}" for i in rng.choice([1, 2, 3], 2, replace=False))
    size = float(np.sqrt(scene.stiffness(driven) * scene.stiffness(sensed)))
    gain = scene.size * size * rng.uniform(0.25, 0.6) * rng.choice([-1, 1])
    loop = Feedback(driven, sensed, float(gain))
    parameters: Parameters = {
        "cause": "nonreciprocal_feedback",
        "driven": driven,
        "sensed": sensed,
        "gain": loop.gain,
    }
    return Drawn("unknown", None, parameters, deviate(secret, feedback=(loop,)))


def tonal_disturbance(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A pump or fan shakes a link all the time."""
    low, *_, high = scene.truth.modes(scene.poses[0], 4)[0]
    tone = Tone(
        f"link_{rng.integers(2, 5)}",
        triple(some_direction(rng)),
        log_uniform(rng, 0.8 * low, 1.2 * high),
        scene.size * scene.peak_n * log_uniform(rng, 0.01, 0.1),
    )
    parameters: Parameters = {
        "cause": "tonal_disturbance",
        "link": tone.link,
        "frequency_hz": tone.frequency_hz,
        "force_n": tone.force_n,
    }
    return Drawn("unknown", None, parameters, replace(secret, tone=tone))


ARTEFACTS: dict[str, Draw] = {
    "sensor_rotation": sensor_rotation,
    "sensor_gain": sensor_gain,
    "polarity": polarity,
    "channel_delay": channel_delay,
    "exponential_window": exponential_window,
}
OUTSIDERS: dict[str, Draw] = {
    "environment_contact": environment_contact,
    "nonreciprocal_feedback": nonreciprocal_feedback,
    "tonal_disturbance": tonal_disturbance,
}
