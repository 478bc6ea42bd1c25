"""The physics that a case can conceal: one function per effect of the library.

Sizes follow the robot: its stiffnesses, its mass, and the joints' angles under a middling hit.
"""

from dataclasses import replace

import numpy as np

from planner.truth.deviation import AttachedMass, AttachedResonator, ScaledJoint, StiffnessRipple
from planner.truth.laws import Backlash, Friction, Hardening, JointLaw
from planner.truth.nonlinear import Port
from planner.truth.scene import (
    Draw,
    Drawn,
    Parameters,
    Scene,
    across,
    deviate,
    log_uniform,
    some_direction,
    some_joint,
    triple,
)
from planner.truth.secret import Secret, StiffnessDrift

PARALLEL_COSINE = 0.9  # from which a link runs along an axis


def joint_stiffness(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A joint about its own axis is far softer or stiffer than stated."""
    joint = some_joint(rng)
    factor = log_uniform(rng, 0.3, 0.55) if rng.random() < 0.7 else log_uniform(rng, 2.0, 3.5)
    factor = factor**scene.size
    parameters: Parameters = {"factor": factor, "stiffness": factor * scene.stiffness(joint)}
    change = deviate(secret, scaled=(ScaledJoint(joint, factor),))
    return Drawn("joint_stiffness", joint, parameters, change)


def transverse_compliance(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A joint's bearing tilts about both axes across its own."""
    joint = some_joint(rng)
    axis = np.array(scene.arm.joints[int(joint[-1]) - 1].axis, dtype=float)
    stiffness = [scene.stiffness(joint) * log_uniform(rng, 0.4, 2.5) / scene.size]
    stiffness.append(stiffness[0] * log_uniform(rng, 0.7, 1.4))
    springs = [
        scene.spring(joint, a, k)
        for a, k in zip(np.eye(3)[np.abs(axis) < 0.5], stiffness, strict=True)
    ]
    return Drawn(
        "transverse_compliance", joint, {"stiffness": stiffness}, deviate(secret, extra=springs)
    )


def base_compliance(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """The floor gives way: two tilts, or sometimes all six."""
    tilt = scene.stiffness("joint_2") * log_uniform(rng, 0.7, 4.0) / scene.size
    tilts = [tilt, tilt * log_uniform(rng, 0.7, 1.4)]
    springs = [scene.spring("base", a, k) for a, k in zip(np.eye(3)[:2], tilts, strict=True)]
    parameters: Parameters = {"stiffness": tilts, "freedoms": 2.0}
    if rng.random() < 0.35:
        reach = float(np.linalg.norm(scene.length(2)))
        shift, turn = (
            2 * tilt / reach**2 * log_uniform(rng, 0.7, 2.0),
            2 * tilt * log_uniform(rng, 0.7, 2.0),
        )
        springs += [scene.spring("base", a, shift, slide=True) for a in np.eye(3)]
        springs.append(scene.spring("base", np.eye(3)[2], turn))
        parameters |= {"freedoms": 6.0, "shift_stiffness": shift, "turn_stiffness": turn}
    return Drawn("base_compliance", "base", parameters, deviate(secret, extra=springs))


def link_flexibility(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A link bends about two axes, twists, or both.

    Twist alone of a link along its joint's own axis is that joint's stiffness: it bends instead.
    """
    lengths = {i: float(np.linalg.norm(scene.length(i))) for i in range(1, 5)}
    number = int(rng.choice([i for i, length in lengths.items() if length > 0.15]))
    link, along = f"link_{number}", scene.length(number)
    kind = str(rng.choice(["bending", "torsion", "both"], p=[0.5, 0.25, 0.25]))
    axis = np.array(scene.arm.joints[number - 1].axis, dtype=float)
    if kind == "torsion" and abs(axis @ along) > PARALLEL_COSINE * np.linalg.norm(along):
        kind = "bending"
    own = scene.stiffness(f"joint_{number}") / scene.size
    parameters: Parameters = {"kind": kind}
    springs = []
    if kind != "torsion":
        bending = [own * log_uniform(rng, 0.4, 2.0)]
        bending.append(bending[0] * log_uniform(rng, 0.7, 1.4))
        springs += [scene.spring(link, a, k) for a, k in zip(across(along), bending, strict=True)]
        parameters["bending_stiffness"] = bending
    if kind != "bending":
        torsion = own * log_uniform(rng, 0.2, 1.0)
        springs.append(scene.spring(link, along / np.linalg.norm(along), torsion))
        parameters["torsion_stiffness"] = torsion
    return Drawn("link_flexibility", link, parameters, deviate(secret, extra=springs))


def added_mass(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A lump on a link, or a payload missing from the robot folder."""
    number = int(rng.integers(2, 7))
    mass = scene.size * scene.moving_kg * log_uniform(rng, 0.03, 0.15)
    place = rng.uniform(0.1, 1.0) * scene.length(number) + 0.1 * some_direction(rng)
    lump = AttachedMass(f"link_{number}", triple(place), mass)
    parameters: Parameters = {"mass": mass, "position_m": place.tolist()}
    return Drawn("added_mass", lump.link, parameters, deviate(secret, added=(lump,)))


def local_resonator(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A hose pack, a bracket or a loose part on a spring of its own, tuned into the modes."""
    number = int(rng.integers(2, 7))
    low, *_, high = scene.truth.modes(scene.poses[0], 4)[0]
    place = rng.uniform(0.3, 1.0) * scene.length(number)
    small = AttachedResonator(
        f"link_{number}",
        triple(place),
        triple(some_direction(rng)),
        scene.size * scene.moving_kg * log_uniform(rng, 0.01, 0.05),
        log_uniform(rng, 0.9 * low, 1.1 * high),
        log_uniform(rng, 0.01, 0.05),
    )
    parameters: Parameters = {
        "mass": small.mass_kg,
        "frequency_hz": small.frequency_hz,
        "damping_ratio": small.damping_ratio,
        "direction": list(small.direction),
        "position_m": list(small.position_m),
    }
    return Drawn("local_resonator", small.link, parameters, deviate(secret, resonators=(small,)))


def angle_dependent_stiffness(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """Stiffness that goes with the joint's angle: first or second harmonic."""
    joint, order = some_joint(rng), int(rng.integers(1, 3))
    size, phase = scene.size * rng.uniform(0.3, 0.6), rng.uniform(0, 2 * np.pi)
    wave = StiffnessRipple(joint, order, float(size * np.cos(phase)), float(size * np.sin(phase)))
    parameters: Parameters = {"order": float(order), "cosine": wave.cosine, "sine": wave.sine}
    change = deviate(secret, harmonics=(wave,))
    return Drawn("angle_dependent_stiffness", joint, parameters, change)


def structural_damping(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """K(1 + iη) in all joints instead of viscous damping."""
    loss = scene.size * log_uniform(rng, 0.04, 0.15)
    change = replace(secret, loss_factor=loss)
    return Drawn("structural_damping", "joints", {"loss_factor": loss}, change)


def _in_joint(
    effect: str, joint: str, law: JointLaw, parameters: Parameters, secret: Secret
) -> Drawn:
    change = replace(secret, ports=(*secret.ports, Port(law, joint=joint)))
    return Drawn(effect, joint, parameters, change)


def left(scene: Scene, secret: Secret, joint: str) -> float:
    """Stiffness that a joint has where earlier effects leave it least, in N·m/rad.

    A law takes its share of this: no joint pushes away from its rest.
    """
    share = 1.0
    for change in secret.deviation.scaled:
        share *= change.factor if change.joint == joint else 1.0
    for wave in secret.deviation.harmonics:
        share *= 1 - float(np.hypot(wave.cosine, wave.sine)) if wave.joint == joint else 1.0
    return share * scene.stiffness(joint)


def nonlinear_stiffness(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A gear that hardens or softens."""
    joint = some_joint(rng)
    factor = log_uniform(rng, 0.6, 2.0) if rng.random() < 0.6 else -rng.uniform(0.3, 0.6)
    law = Hardening(
        scene.size * factor * left(scene, secret, joint),
        scene.angle(joint) * log_uniform(rng, 0.2, 1.0),
    )
    parameters: Parameters = {"stiffness_change": law.stiffness, "angle_rad": law.angle}
    return _in_joint("nonlinear_stiffness", joint, law, parameters, secret)


def friction(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """Presliding and Coulomb friction beside the spring."""
    joint = some_joint(rng)
    stiffness = scene.size * left(scene, secret, joint) * log_uniform(rng, 0.3, 1.5)
    law = Friction(stiffness, stiffness * scene.angle(joint) * log_uniform(rng, 0.05, 0.4))
    parameters: Parameters = {"presliding_stiffness": law.stiffness, "coulomb_torque": law.coulomb}
    return _in_joint("friction", joint, law, parameters, secret)


def backlash(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """Play in a gear, in which some stiffness is left."""
    joint = some_joint(rng)
    law = Backlash(
        scene.size * left(scene, secret, joint) * rng.uniform(0.4, 0.8),
        scene.angle(joint) * log_uniform(rng, 0.1, 0.5),
    )
    parameters: Parameters = {"lost_stiffness": law.stiffness, "half_gap_rad": law.gap}
    return _in_joint("backlash", joint, law, parameters, secret)


def drift(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """Stiffnesses change in the course of the campaign."""
    size = scene.size * rng.uniform(0.12, 0.35) * rng.choice([-1, 1])
    law = StiffnessDrift(float(size), str(rng.choice(["linear", "warming", "step"])))
    parameters: Parameters = {"change": law.change, "course": law.course}
    return Drawn("drift", "campaign", parameters, replace(secret, drift=law))


LINEAR: dict[str, Draw] = {
    "joint_stiffness": joint_stiffness,
    "transverse_compliance": transverse_compliance,
    "base_compliance": base_compliance,
    "link_flexibility": link_flexibility,
    "added_mass": added_mass,
    "local_resonator": local_resonator,
    "angle_dependent_stiffness": angle_dependent_stiffness,
}
NONLINEAR: dict[str, Draw] = {
    "nonlinear_stiffness": nonlinear_stiffness,
    "friction": friction,
    "backlash": backlash,
}
OTHER: dict[str, Draw] = {"structural_damping": structural_damping, "drift": drift}
