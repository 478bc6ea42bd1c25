"""Artefacts of the measurement, and causes that no effect of the library describes.

The right answer to each of OUT_OF_LIBRARY is "unknown".
"""

from dataclasses import replace
from typing import Any

import numpy as np

from planner.proof import deviation
from planner.proof.fault_injection import InjectedFaults, Tone
from planner.proof.laws import Backlash, Contact, QuadraticDamping, Stops
from planner.proof.nonlinear import Port
from planner.proof.scene import (
    REFERENCE_HZ,
    Draw,
    DrawnEffect,
    Parameters,
    Scene,
    deviate,
    log_uniform,
    some_direction,
    some_joint,
    triple,
)


def _artefact(
    effect: str, at: str, parameters: Parameters, injected: InjectedFaults, **changes: Any
) -> DrawnEffect:
    change = replace(injected, artefact=replace(injected.artefact, **changes))
    return DrawnEffect(effect, at, parameters, change)


def sensor_rotation(
    scene: Scene, injected: InjectedFaults, rng: np.random.Generator
) -> DrawnEffect:
    """The sensor is mounted askew."""
    axis, angle = some_direction(rng), scene.size * np.deg2rad(rng.uniform(10, 45))
    skew = np.cross(np.eye(3), axis)
    rotation = np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew
    parameters: Parameters = {"axis": axis.tolist(), "angle_rad": float(angle)}
    return _artefact("sensor_rotation", "sensor", parameters, injected, rotation=rotation)


def _channel(
    effect: str, factor: float, injected: InjectedFaults, rng: np.random.Generator
) -> DrawnEffect:
    which = int(rng.integers(3))
    gain = tuple(g * factor if i == which else g for i, g in enumerate(injected.artefact.gain))
    return _artefact(effect, f"sensor_{'xyz'[which]}", {"gain": factor}, injected, gain=gain)


def sensor_gain(scene: Scene, injected: InjectedFaults, rng: np.random.Generator) -> DrawnEffect:
    """A wrong sensitivity of one channel."""
    factor = log_uniform(rng, 0.5, 0.8) if rng.random() < 0.5 else log_uniform(rng, 1.25, 2.0)
    return _channel("sensor_gain", factor**scene.size, injected, rng)


def polarity(scene: Scene, injected: InjectedFaults, rng: np.random.Generator) -> DrawnEffect:
    """One channel has the wrong sign."""
    return _channel("polarity", -1.0, injected, rng)


def channel_delay(scene: Scene, injected: InjectedFaults, rng: np.random.Generator) -> DrawnEffect:
    """Responses come later than the force."""
    delay = scene.size * log_uniform(rng, 0.8e-3, 6e-3)
    return _artefact("channel_delay", "sensor", {"delay_s": delay}, injected, delay_s=delay)


def exponential_window(
    scene: Scene, injected: InjectedFaults, rng: np.random.Generator
) -> DrawnEffect:
    """The analyser's window is left in the recordings."""
    time = log_uniform(rng, 0.25, 1.0) / scene.size
    told: Parameters = {"time_constant_s": time}
    return _artefact("exponential_window", "sensor", told, injected, window_s=time)


def _unknown(
    cause: str, change: InjectedFaults, **numbers: float | str | list[float]
) -> DrawnEffect:
    return DrawnEffect("unknown", None, {"cause": cause, **numbers}, change)


def environment_contact(
    scene: Scene, injected: InjectedFaults, rng: np.random.Generator
) -> DrawnEffect:
    """Something presses against a link; it lets go when the link moves away far enough."""
    number, direction = scene.some_link(rng, 3), some_direction(rng)
    port = Port(Contact(1.0, 1.0), "", f"link_{number}", (0.0, 0.0, 0.0), triple(direction))
    soft = scene.compliance(port.vector(scene.truth, scene.poses[0]))
    stiffness = scene.size * log_uniform(rng, 0.5, 3.0) / soft
    law = Contact(stiffness, log_uniform(rng, 1e-6, 1e-3))
    change = replace(injected, ports=(*injected.ports, replace(port, law=law)))
    return _unknown(
        "environment_contact", change, link=port.link, stiffness=law.stiffness,
        preload_m=law.preload, direction=direction.tolist(),
    )  # fmt: skip


def nonreciprocal_feedback(
    scene: Scene, injected: InjectedFaults, rng: np.random.Generator
) -> DrawnEffect:
    """A controller turns one joint's twist into another's torque."""
    driven, sensed = (f"joint_{i}" for i in rng.choice([1, 2, 3], 2, replace=False))
    size = float(np.sqrt(scene.stiffness(driven) * scene.stiffness(sensed)))
    gain = float(scene.size * size * rng.uniform(0.25, 0.6) * rng.choice([-1, 1]))
    change = deviate(injected, feedback=(deviation.Feedback(driven, sensed, gain),))
    return _unknown("nonreciprocal_feedback", change, driven=driven, sensed=sensed, gain=gain)


def tonal_disturbance(
    scene: Scene, injected: InjectedFaults, rng: np.random.Generator
) -> DrawnEffect:
    """A pump or fan shakes a link all the time."""
    low, high = scene.band_of_modes
    tone = Tone(
        f"link_{rng.integers(2, 5)}",
        triple(some_direction(rng)),
        log_uniform(rng, 0.8 * low, 1.2 * high),
        scene.size * scene.peak_n * log_uniform(rng, 0.01, 0.1),
    )
    told = {"frequency_hz": tone.frequency_hz, "force_n": tone.force_n}
    return _unknown("tonal_disturbance", replace(injected, tone=tone), link=tone.link, **told)


def bridging_cable(scene: Scene, injected: InjectedFaults, rng: np.random.Generator) -> DrawnEffect:
    """A cable or hose that is stretched from one link to another, past the joints between."""
    low, high = int(rng.integers(1, 3)), scene.some_link(rng, 4)
    direction = some_direction(rng)
    links = f"link_{low}", f"link_{high}"
    places = triple(rng.uniform(0.2, 1.0) * scene.length(low)), (0.0, 0.0, 0.0)
    one, other = (
        scene.truth.along(scene.poses[0], link, np.array(at), direction)
        for link, at in zip(links, places, strict=True)
    )
    stiffness = scene.size * log_uniform(rng, 0.5, 3.0) / scene.compliance(one - other)
    damping = scene.arm.damping_s * stiffness
    bridge = deviation.Bridge(links, places, triple(direction), stiffness, damping)
    change = deviate(injected, bridges=(bridge,))
    return _unknown("bridging_cable", change, links=" ".join(links), stiffness=stiffness)


def rattling_part(scene: Scene, injected: InjectedFaults, rng: np.random.Generator) -> DrawnEffect:
    """A part that is hardly held, and knocks against stops."""
    number, (low, _) = scene.some_link(rng), scene.band_of_modes
    mass = scene.size * scene.moving_kg * log_uniform(rng, 0.01, 0.05)
    place = triple(rng.uniform(0.3, 1.0) * scene.length(number))
    part = deviation.AttachedResonator(
        f"link_{number}", place, triple(some_direction(rng)), mass, 0.3 * low, 0.1
    )
    stops = Stops(mass * (2 * np.pi * 3 * low) ** 2, log_uniform(rng, 1e-5, 2e-4))
    change = deviate(injected, resonators=(part,))
    where = f"resonator {len(change.deviation.resonators) - 1}"
    change = replace(change, ports=(*change.ports, Port(stops, joint=where)))
    return _unknown("rattling_part", change, link=part.link, mass=mass, gap_m=stops.gap)


def turning_spindle(
    scene: Scene, injected: InjectedFaults, rng: np.random.Generator
) -> DrawnEffect:
    """The spindle was left running: its rotor couples the tool's rotations."""
    inertia = float(np.mean(scene.arm.bodies[-1].moments)) * log_uniform(rng, 0.1, 0.5)
    spin = scene.size * inertia * 2 * np.pi * log_uniform(rng, 100.0, 400.0)
    change = replace(injected, deviation=replace(injected.deviation, spin=spin))
    return _unknown("turning_spindle", change, spin=spin)


def servo_loop(scene: Scene, injected: InjectedFaults, rng: np.random.Generator) -> DrawnEffect:
    """A drive's controller gives way slowly and holds against fast motion: a relaxing joint."""
    joint = some_joint(scene, rng, 3)
    share = scene.size * log_uniform(rng, 0.3, 1.5)
    loop = deviation.ServoLoop(joint, share, log_uniform(rng, 3.0, 30.0))
    return _unknown("servo_loop", deviate(injected, servos=(loop,)), joint=joint, share=share)


def loose_anchor(scene: Scene, injected: InjectedFaults, rng: np.random.Generator) -> DrawnEffect:
    """A foot of the base lifts off: a tilt that is stiff only beyond a gap."""
    stiffness = scene.stiffness("joint_2") * log_uniform(rng, 2.0, 6.0) / scene.size
    x, y, z = np.append(some_direction(rng)[:2], 0.0)
    size = float(np.hypot(x, y))
    tilt = deviation.Spring(
        "base", (x / size, y / size, z), stiffness, scene.arm.damping_s * stiffness
    )
    change = deviate(injected, extra=(tilt,))
    gap = 0.3 * scene.angle("joint_2") * scene.stiffness("joint_2") / stiffness
    law = Backlash(stiffness * rng.uniform(0.4, 0.8), gap * log_uniform(rng, 0.3, 1.5))
    where = f"extra {len(change.deviation.extra) - 1}"
    change = replace(change, ports=(*change.ports, Port(law, joint=where)))
    return _unknown("loose_anchor", change, stiffness=stiffness, half_gap_rad=law.gap)


def quadratic_damping(
    scene: Scene, injected: InjectedFaults, rng: np.random.Generator
) -> DrawnEffect:
    """A balancer's oil: torque with the square of a joint's speed."""
    joint = some_joint(scene, rng, 3)
    speed = 2 * np.pi * REFERENCE_HZ * scene.angle(joint)
    viscous = scene.arm.damping_s * scene.stiffness(joint)
    size = scene.size * viscous / speed * log_uniform(rng, 1.0, 4.0)
    port = Port(QuadraticDamping(size, 5 * speed), joint=joint)
    change = replace(injected, ports=(*injected.ports, port))
    return _unknown("quadratic_damping", change, joint=joint, damping=size)


def coupled_stiffness(
    scene: Scene, injected: InjectedFaults, rng: np.random.Generator
) -> DrawnEffect:
    """One joint's stiffness goes with another's angle, as of a belt or a coupled wrist."""
    driven, by = (str(joint) for joint in rng.choice(scene.joints[:5], 2, replace=False))
    cosine, sine = scene.ripple(rng)
    wave = deviation.StiffnessRipple(driven, int(rng.integers(1, 4)), cosine, sine, by)
    size = float(np.hypot(cosine, sine))
    change = deviate(injected, harmonics=(wave,))
    return _unknown("coupled_stiffness", change, joint=driven, by=by, size=size)


ARTEFACTS: dict[str, Draw] = {
    "sensor_rotation": sensor_rotation,
    "sensor_gain": sensor_gain,
    "polarity": polarity,
    "channel_delay": channel_delay,
    "exponential_window": exponential_window,
}
OUT_OF_LIBRARY: dict[str, Draw] = {
    "environment_contact": environment_contact,
    "nonreciprocal_feedback": nonreciprocal_feedback,
    "tonal_disturbance": tonal_disturbance,
    "bridging_cable": bridging_cable,
    "rattling_part": rattling_part,
    "turning_spindle": turning_spindle,
    "servo_loop": servo_loop,
    "loose_anchor": loose_anchor,
    "quadratic_damping": quadratic_damping,
    "coupled_stiffness": coupled_stiffness,
}
