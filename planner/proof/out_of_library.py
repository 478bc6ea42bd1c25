"""Artefacts of the measurement, and causes that no effect of the library describes.

The right answer to each of OUT_OF_LIBRARY is "unknown".
"""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from planner.proof import deviation
from planner.proof.fault_injection import Tone
from planner.proof.laws import Backlash, Contact, QuadraticDamping, Stops
from planner.proof.nonlinear import Port
from planner.proof.scene import REFERENCE_HZ, Draw, Drawn, Parameters, Scene, triple


def _artefact(scene: Scene, at: str, parameters: Parameters, **changes: Any) -> Drawn:
    artefact = replace(scene.injected.artefact, **changes)
    return at, parameters, scene.changed(artefact=artefact)


def sensor_rotation(scene: Scene) -> Drawn:
    """The sensor is mounted askew."""
    axis, angle = scene.direction(), scene.size * np.deg2rad(scene.rng.uniform(10, 45))
    rotation = Rotation.from_rotvec(angle * np.array(axis)).as_matrix()
    told: Parameters = {"axis": list(axis), "angle_rad": float(angle)}
    return _artefact(scene, "sensor", told, rotation=rotation)


def _channel(scene: Scene, factor: float) -> Drawn:
    which, before = int(scene.rng.integers(3)), scene.injected.artefact.gain
    gain = tuple(g * factor if i == which else g for i, g in enumerate(before))
    return _artefact(scene, f"sensor_{'xyz'[which]}", {"gain": factor}, gain=gain)


def sensor_gain(scene: Scene) -> Drawn:
    """A wrong sensitivity of one channel."""
    smaller = scene.rng.random() < 0.5
    factor = scene.log_uniform(0.5, 0.8) if smaller else scene.log_uniform(1.25, 2.0)
    return _channel(scene, factor**scene.size)


def polarity(scene: Scene) -> Drawn:
    """One channel has the wrong sign."""
    return _channel(scene, -1.0)


def channel_delay(scene: Scene) -> Drawn:
    """Responses come later than the force."""
    delay = scene.size * scene.log_uniform(0.8e-3, 6e-3)
    return _artefact(scene, "sensor", {"delay_s": delay}, delay_s=delay)


def exponential_window(scene: Scene) -> Drawn:
    """The analyser's window is left in the recordings."""
    time = scene.log_uniform(0.25, 1.0) / scene.size
    return _artefact(scene, "sensor", {"time_constant_s": time}, window_s=time)


def _with_port(scene: Scene, port: Port) -> Scene:
    return scene.changed(ports=(*scene.injected.ports, port))


def environment_contact(scene: Scene) -> Drawn:
    """Something presses against a link; it lets go when the link moves away far enough."""
    number, direction = scene.some_link(3), scene.direction()
    port = Port(Contact(1.0, 1.0), "", f"link_{number}", (0.0, 0.0, 0.0), direction)
    soft = scene.compliance(port.vector(scene.truth, scene.poses[0]))
    stiffness = scene.size * scene.log_uniform(0.5, 3.0) / soft
    law = Contact(stiffness, scene.log_uniform(1e-6, 1e-3))
    told: Parameters = {
        "link": port.link, "stiffness": stiffness, "preload_m": law.preload,
        "direction": list(direction),
    }  # fmt: skip
    return None, told, _with_port(scene, replace(port, law=law))


def nonreciprocal_feedback(scene: Scene) -> Drawn:
    """A controller turns one joint's twist into another's torque."""
    driven, sensed = (f"joint_{i}" for i in scene.rng.choice([1, 2, 3], 2, replace=False))
    size = float(np.sqrt(scene.stiffness(driven) * scene.stiffness(sensed)))
    gain = float(scene.size * size * scene.rng.uniform(0.25, 0.6) * scene.rng.choice([-1, 1]))
    loop = deviation.Feedback(driven, sensed, gain)
    return None, {**vars(loop)}, scene.adding(feedback=(loop,))


def tonal_disturbance(scene: Scene) -> Drawn:
    """A pump or fan shakes a link all the time."""
    low, high = scene.band_of_modes
    tone = Tone(
        f"link_{scene.rng.integers(2, 5)}",
        scene.direction(),
        scene.log_uniform(0.8 * low, 1.2 * high),
        scene.size * scene.peak_n * scene.log_uniform(0.01, 0.1),
    )
    told: Parameters = {
        "link": tone.link, "frequency_hz": tone.frequency_hz, "force_n": tone.force_n
    }  # fmt: skip
    return None, told, scene.changed(tone=tone)


def bridging_cable(scene: Scene) -> Drawn:
    """A cable or hose that is stretched from one link to another, past the joints between."""
    low, high = int(scene.rng.integers(1, 3)), scene.some_link(4)
    direction = scene.direction()
    links = f"link_{low}", f"link_{high}"
    places = triple(scene.rng.uniform(0.2, 1.0) * scene.length(low)), (0.0, 0.0, 0.0)
    one, other = (
        scene.truth.along(scene.poses[0], link, np.array(at), np.array(direction))
        for link, at in zip(links, places, strict=True)
    )
    stiffness = scene.size * scene.log_uniform(0.5, 3.0) / scene.compliance(one - other)
    damping = scene.arm.damping_s * stiffness
    bridge = deviation.Bridge(links, places, direction, stiffness, damping)
    told: Parameters = {"links": " ".join(links), "stiffness": stiffness}
    return None, told, scene.adding(bridges=(bridge,))


def rattling_part(scene: Scene) -> Drawn:
    """A part that is hardly held, and knocks against stops."""
    number, (low, _) = scene.some_link(), scene.band_of_modes
    mass = scene.size * scene.moving_kg * scene.log_uniform(0.01, 0.05)
    place = triple(scene.rng.uniform(0.3, 1.0) * scene.length(number))
    part = deviation.AttachedResonator(
        f"link_{number}", place, scene.direction(), mass, 0.3 * low, 0.1
    )
    stops = Stops(mass * (2 * np.pi * 3 * low) ** 2, scene.log_uniform(1e-5, 2e-4))
    scene = scene.adding(resonators=(part,))
    where = f"resonator {len(scene.injected.deviation.resonators) - 1}"
    told: Parameters = {"link": part.link, "mass": mass, "gap_m": stops.gap}
    return None, told, _with_port(scene, Port(stops, joint=where))


def turning_spindle(scene: Scene) -> Drawn:
    """The spindle was left running: its rotor couples the tool's rotations."""
    inertia = float(np.mean(scene.arm.bodies[-1].moments)) * scene.log_uniform(0.1, 0.5)
    spin = scene.size * inertia * 2 * np.pi * scene.log_uniform(100.0, 400.0)
    return None, {"spin": spin}, scene.deviating(spin=spin)


def servo_loop(scene: Scene) -> Drawn:
    """A drive's controller gives way slowly and holds against fast motion: a relaxing joint."""
    joint, share = scene.some_joint(3), scene.size * scene.log_uniform(0.3, 1.5)
    loop = deviation.ServoLoop(joint, share, scene.log_uniform(3.0, 30.0))
    return None, {"joint": joint, "share": share}, scene.adding(servos=(loop,))


def loose_anchor(scene: Scene) -> Drawn:
    """A foot of the base lifts off: a tilt that is stiff only beyond a gap."""
    stiffness = scene.stiffness("joint_2") * scene.log_uniform(2.0, 6.0) / scene.size
    x, y, _ = scene.direction()
    tilt = scene.spring("base", np.array([x, y, 0.0]) / float(np.hypot(x, y)), stiffness)
    gap = 0.3 * scene.angle("joint_2") * scene.stiffness("joint_2") / stiffness
    law = Backlash(stiffness * scene.rng.uniform(0.4, 0.8), gap * scene.log_uniform(0.3, 1.5))
    scene = scene.adding(extra=(tilt,))
    where = f"extra {len(scene.injected.deviation.extra) - 1}"
    told: Parameters = {"stiffness": stiffness, "half_gap_rad": law.gap}
    return None, told, _with_port(scene, Port(law, joint=where))


def quadratic_damping(scene: Scene) -> Drawn:
    """A balancer's oil: torque with the square of a joint's speed."""
    joint = scene.some_joint(3)
    speed = 2 * np.pi * REFERENCE_HZ * scene.angle(joint)
    viscous = scene.arm.damping_s * scene.stiffness(joint)
    size = scene.size * viscous / speed * scene.log_uniform(1.0, 4.0)
    port = Port(QuadraticDamping(size, 5 * speed), joint=joint)
    return None, {"joint": joint, "damping": size}, _with_port(scene, port)


def coupled_stiffness(scene: Scene) -> Drawn:
    """One joint's stiffness goes with another's angle, as of a belt or a coupled wrist."""
    driven, by = (str(joint) for joint in scene.rng.choice(scene.joints[:5], 2, replace=False))
    cosine, sine = scene.ripple()
    wave = deviation.StiffnessRipple(driven, int(scene.rng.integers(1, 4)), cosine, sine, by)
    told: Parameters = {"joint": driven, "by": by, "size": float(np.hypot(cosine, sine))}
    return None, told, scene.adding(harmonics=(wave,))


ARTEFACTS: dict[str, Draw] = {
    artefact.__name__: artefact
    for artefact in (sensor_rotation, sensor_gain, polarity, channel_delay, exponential_window)
}
OUT_OF_LIBRARY: dict[str, Draw] = {
    cause.__name__: cause
    for cause in (
        environment_contact, nonreciprocal_feedback, tonal_disturbance, bridging_cable,
        rattling_part, turning_spindle, servo_loop, loose_anchor, quadratic_damping,
        coupled_stiffness,
    )
}  # fmt: skip
