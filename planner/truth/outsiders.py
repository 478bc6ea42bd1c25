"""More causes that no effect of the library describes; the right answer to each is "unknown"."""

from dataclasses import replace

import numpy as np

from planner.truth.deviation import AttachedResonator, Bridge, ServoLoop, Spring, StiffnessRipple
from planner.truth.laws import Backlash
from planner.truth.nonlinear import Port
from planner.truth.other_laws import QuadraticDamping, Stops
from planner.truth.scene import (
    Draw,
    Drawn,
    Parameters,
    Scene,
    deviate,
    log_uniform,
    some_direction,
    some_joint,
    triple,
)
from planner.truth.secret import Secret


def _unknown(cause: str, change: Secret, **numbers: float | str | list[float]) -> Drawn:
    parameters: Parameters = {"cause": cause, **numbers}
    return Drawn("unknown", None, parameters, change)


def bridging_cable(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A cable or hose that is stretched from one link to another, past the joints between."""
    low, high = int(rng.integers(1, 3)), int(rng.integers(4, 7))
    direction = some_direction(rng)
    bridge = Bridge(
        (f"link_{low}", f"link_{high}"),
        (triple(rng.uniform(0.2, 1.0) * scene.length(low)), (0.0, 0.0, 0.0)),
        triple(direction),
        1.0,
        scene.arm.damping_s,
    )
    q = scene.poses[0]
    one, other = (
        scene.truth.along(q, link, np.array(at), direction)
        for link, at in zip(bridge.links, bridge.positions_m, strict=True)
    )
    soft = float((one - other) @ np.linalg.solve(scene.truth.matrices(q)[2], one - other))
    stiffness = scene.size * log_uniform(rng, 0.5, 3.0) / soft
    bridge = replace(bridge, stiffness=stiffness, damping=scene.arm.damping_s * stiffness)
    change = deviate(secret, bridges=(bridge,))
    return _unknown("bridging_cable", change, links=" ".join(bridge.links), stiffness=stiffness)


def rattling_part(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A part that is hardly held, and knocks against stops."""
    number = int(rng.integers(2, 7))
    low, *_ = scene.truth.modes(scene.poses[0], 4)[0]
    mass = scene.size * scene.moving_kg * log_uniform(rng, 0.01, 0.05)
    place = triple(rng.uniform(0.3, 1.0) * scene.length(number))
    part = AttachedResonator(
        f"link_{number}", place, triple(some_direction(rng)), mass, 0.3 * low, 0.1
    )
    stops = Stops(mass * (2 * np.pi * 3 * low) ** 2, log_uniform(rng, 1e-5, 2e-4))
    change = deviate(secret, resonators=(part,))
    where = f"resonator {len(change.deviation.resonators) - 1}"
    change = replace(change, ports=(*change.ports, Port(stops, joint=where)))
    return _unknown("rattling_part", change, link=part.link, mass=mass, gap_m=stops.gap)


def turning_spindle(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """The spindle was left running: its rotor couples the tool's rotations."""
    inertia = float(np.mean(scene.arm.bodies[-1].moments)) * log_uniform(rng, 0.1, 0.5)
    spin = scene.size * inertia * 2 * np.pi * log_uniform(rng, 100.0, 400.0)
    change = replace(secret, deviation=replace(secret.deviation, spin=spin))
    return _unknown("turning_spindle", change, spin=spin)


def servo_loop(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A drive's controller gives way slowly and holds against fast motion: a relaxing joint."""
    joint = some_joint(rng, 3)
    loss = scene.size * log_uniform(rng, 0.3, 1.5)
    loop = ServoLoop(joint, loss, log_uniform(rng, 3.0, 30.0))
    change = deviate(secret, servos=(loop,))
    return _unknown("servo_loop", change, joint=joint, share=loss)


def loose_anchor(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A foot of the base lifts off: a tilt that is stiff only beyond a gap."""
    stiffness = scene.stiffness("joint_2") * log_uniform(rng, 2.0, 6.0) / scene.size
    x, y, z = np.append(some_direction(rng)[:2], 0.0)
    size = float(np.hypot(x, y))
    tilt = Spring("base", (x / size, y / size, z), stiffness, scene.arm.damping_s * stiffness)
    change = deviate(secret, extra=(tilt,))
    gap = 0.3 * scene.angle("joint_2") * scene.stiffness("joint_2") / stiffness
    law = Backlash(stiffness * rng.uniform(0.4, 0.8), gap * log_uniform(rng, 0.3, 1.5))
    where = f"extra {len(change.deviation.extra) - 1}"
    change = replace(change, ports=(*change.ports, Port(law, joint=where)))
    return _unknown("loose_anchor", change, stiffness=stiffness, half_gap_rad=law.gap)


def quadratic_damping(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A balancer's oil: torque with the square of a joint's speed."""
    joint = some_joint(rng, 3)
    speed = 2 * np.pi * 15.0 * scene.angle(joint)  # at the middle of the bands
    viscous = scene.arm.damping_s * scene.stiffness(joint)
    size = scene.size * viscous / speed * log_uniform(rng, 1.0, 4.0)
    law = QuadraticDamping(size, 5 * speed)
    change = replace(secret, ports=(*secret.ports, Port(law, joint=joint)))
    return _unknown("quadratic_damping", change, joint=joint, damping=size)


def coupled_stiffness(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """One joint's stiffness goes with another's angle, as of a belt or a coupled wrist."""
    driven, by = (f"joint_{n}" for n in rng.choice(np.arange(1, 6), 2, replace=False))
    size, phase = scene.size * rng.uniform(0.3, 0.6), rng.uniform(0, 2 * np.pi)
    cosine, sine = float(size * np.cos(phase)), float(size * np.sin(phase))
    wave = StiffnessRipple(driven, int(rng.integers(1, 4)), cosine, sine, by)
    change = deviate(secret, harmonics=(wave,))
    return _unknown("coupled_stiffness", change, joint=driven, by=by, size=float(size))


MORE_OUTSIDERS: dict[str, Draw] = {
    "bridging_cable": bridging_cable,
    "rattling_part": rattling_part,
    "turning_spindle": turning_spindle,
    "servo_loop": servo_loop,
    "loose_anchor": loose_anchor,
    "quadratic_damping": quadratic_damping,
    "coupled_stiffness": coupled_stiffness,
}
