"""The physics that a case can conceal: one function per effect of the library.

Sizes follow the robot: its stiffnesses, its mass, and the joints' angles under a middling hit. Many
come in shapes that the planner's own models do not have.
"""

from dataclasses import replace

import numpy as np

from planner.proof import deviation, laws
from planner.proof.fault_injection import InjectedFaults, JointDrift, LoadChange
from planner.proof.imperfections import gas_spring
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

CHANGED_TOOL = 0.25  # how often properties change because the tool does


def joint_stiffness(
    scene: Scene, injected: InjectedFaults, rng: np.random.Generator
) -> DrawnEffect:
    """A joint about its own axis is far softer or stiffer than stated."""
    joint = some_joint(scene, rng)
    factor = log_uniform(rng, 0.3, 0.55) if rng.random() < 0.7 else log_uniform(rng, 2.0, 3.5)
    factor = factor**scene.size
    parameters: Parameters = {"factor": factor, "stiffness": factor * scene.stiffness(joint)}
    change = deviate(injected, scaled=(deviation.ScaledJoint(joint, factor),))
    return DrawnEffect("joint_stiffness", joint, parameters, change)


def transverse_compliance(
    scene: Scene, injected: InjectedFaults, rng: np.random.Generator
) -> DrawnEffect:
    """A bearing tilts about both axes across its joint's own, softer than the others."""
    joint = some_joint(scene, rng)
    first = scene.stiffness(joint) * log_uniform(rng, 0.4, 2.5) / scene.size
    stiffness = [first, first * log_uniform(rng, 0.7, 1.4)]
    before = injected.deviation.extra
    own = [s.stiffness for s in before if s.joint == joint]
    if own:  # one body between two springs about the same axis would have no inertia: in series
        stiffness = [1 / (1 / k + 1 / float(np.mean(own))) for k in stiffness]
    axes = np.eye(3)[np.abs(scene.axis(joint)) < 0.5]
    springs = [scene.spring(joint, a, k) for a, k in zip(axes, stiffness, strict=True)]
    others = (s for s in before if s.joint != joint)
    change = replace(injected, deviation=replace(injected.deviation, extra=(*others, *springs)))
    return DrawnEffect("transverse_compliance", joint, {"stiffness": stiffness}, change)


def base_compliance(
    scene: Scene, injected: InjectedFaults, rng: np.random.Generator
) -> DrawnEffect:
    """The floor gives way: two tilts, or sometimes all six."""
    tilt = scene.stiffness("joint_2") * log_uniform(rng, 0.7, 4.0) / scene.size
    tilts = [tilt, tilt * log_uniform(rng, 0.7, 1.4)]
    springs = [scene.spring("base", a, k) for a, k in zip(np.eye(3)[:2], tilts, strict=True)]
    parameters: Parameters = {"stiffness": tilts, "freedoms": 2.0}
    if rng.random() < 0.35:
        reach = float(np.linalg.norm(scene.length(2)))
        shift = 2 * tilt / reach**2 * log_uniform(rng, 0.7, 2.0)
        turn = 2 * tilt * log_uniform(rng, 0.7, 2.0)
        springs += [scene.spring("base", a, shift, slide=True) for a in np.eye(3)]
        springs.append(scene.spring("base", np.eye(3)[2], turn))
        parameters |= {"freedoms": 6.0, "shift_stiffness": shift, "turn_stiffness": turn}
    return DrawnEffect("base_compliance", "base", parameters, deviate(injected, extra=springs))


def link_flexibility(
    scene: Scene, injected: InjectedFaults, rng: np.random.Generator
) -> DrawnEffect:
    """A link is a beam of five elements or more; the one that bends a little anyway bends more."""
    lengths = {i: float(np.linalg.norm(scene.length(i))) for i in range(1, 5)}
    number = int(rng.choice([i for i, length in lengths.items() if length > 0.15]))
    own = scene.stiffness(f"joint_{number}") / scene.size
    first = own * log_uniform(rng, 0.4, 2.0)
    second, twist = first * log_uniform(rng, 0.7, 1.4), first * log_uniform(rng, 0.5, 3.0)
    link, elements = f"link_{number}", int(rng.integers(5, 8))
    for beam in (b for b in injected.deviation.beams if b.link == link):  # compliances in series
        first, second = (
            1 / (1 / k + 1 / b) for k, b in zip((first, second), beam.bending, strict=True)
        )
        twist = 1 / (1 / twist + 1 / beam.torsion)
    beam = deviation.BentLink(link, (first, second), twist, scene.arm.damping_s, elements)
    others = tuple(b for b in injected.deviation.beams if b.link != link)
    change = replace(injected, deviation=replace(injected.deviation, beams=(*others, beam)))
    parameters: Parameters = {"bending_stiffness": [first, second], "torsion_stiffness": twist}
    return DrawnEffect("link_flexibility", link, parameters, change)


def added_mass(scene: Scene, injected: InjectedFaults, rng: np.random.Generator) -> DrawnEffect:
    """A lump on a link, or a payload missing from the robot folder."""
    number = scene.some_link(rng)
    mass = scene.size * scene.moving_kg * log_uniform(rng, 0.03, 0.15)
    place = rng.uniform(0.1, 1.0) * scene.length(number) + 0.1 * some_direction(rng)
    lump = deviation.AttachedMass(f"link_{number}", triple(place), mass)
    parameters: Parameters = {"mass": mass, "position_m": place.tolist()}
    return DrawnEffect("added_mass", lump.link, parameters, deviate(injected, added=(lump,)))


def local_resonator(
    scene: Scene, injected: InjectedFaults, rng: np.random.Generator
) -> DrawnEffect:
    """A loose part, or a hose pack that swings at up to three frequencies in as many directions."""
    number = scene.some_link(rng)
    low, high = scene.band_of_modes
    place = rng.uniform(0.3, 1.0) * scene.length(number)
    main = deviation.AttachedResonator(
        f"link_{number}",
        triple(place),
        triple(some_direction(rng)),
        scene.size * scene.moving_kg * log_uniform(rng, 0.01, 0.05),
        log_uniform(rng, 0.9 * low, 1.1 * high),
        log_uniform(rng, 0.01, 0.05),
    )
    more = [
        replace(
            main,
            direction=triple(some_direction(rng)),
            mass_kg=main.mass_kg * log_uniform(rng, 0.1, 0.5),
            frequency_hz=main.frequency_hz * log_uniform(rng, 0.6, 1.7),
        )
        for _ in range(int(rng.integers(3)))
    ]
    parameters: Parameters = {
        "mass": main.mass_kg,
        "frequency_hz": main.frequency_hz,
        "damping_ratio": main.damping_ratio,
        "direction": list(main.direction),
        "position_m": list(main.position_m),
    }
    change = deviate(injected, resonators=(main, *more))
    return DrawnEffect("local_resonator", main.link, parameters, change)


def angle_dependent_stiffness(
    scene: Scene, injected: InjectedFaults, rng: np.random.Generator
) -> DrawnEffect:
    """First or second harmonic of the angle, or a gas spring that robot.toml does not have."""
    if rng.random() < 0.7:
        joint, order = some_joint(scene, rng), int(rng.integers(1, 3))
        cosine, sine = scene.ripple(rng)
        parameters: Parameters = {"order": float(order), "cosine": cosine, "sine": sine}
        change = deviate(
            injected, harmonics=(deviation.StiffnessRipple(joint, order, cosine, sine),)
        )
        return DrawnEffect("angle_dependent_stiffness", joint, parameters, change)
    spring = gas_spring(scene, (0.3 * scene.size, 0.6 * scene.size), rng)
    parameters = {k: float(v) for k, v in vars(spring).items() if k != "joint"}
    change = deviate(injected, compensators=(spring,))
    return DrawnEffect("angle_dependent_stiffness", spring.joint, parameters, change)


def least_stiffness(scene: Scene, injected: InjectedFaults, joint: str) -> float:
    """Stiffness that a joint has where earlier effects leave it least, in N·m/rad.

    A law takes its share of this: no joint pushes away from its rest.
    """
    share = 1.0
    for change in injected.deviation.scaled:
        share *= change.factor if change.joint == joint else 1.0
    for wave in injected.deviation.harmonics:
        share *= 1 - float(np.hypot(wave.cosine, wave.sine)) if wave.joint == joint else 1.0
    return share * scene.stiffness(joint)


def _joint(
    scene: Scene, injected: InjectedFaults, rng: np.random.Generator
) -> tuple[str, float, float]:
    """A joint, what stiffness it has left, and its angle under a middling hit."""
    joint = some_joint(scene, rng)
    return joint, least_stiffness(scene, injected, joint), scene.angle(joint)


def _in_joint(
    effect: str,
    injected: InjectedFaults,
    joint: str,
    choice: list[laws.JointLaw],
    rng: np.random.Generator,
) -> DrawnEffect:
    """One of some laws at a joint, with its own numbers and its class as parameters."""
    law = choice[int(rng.integers(len(choice)))]
    numbers: Parameters = {k: float(v) for k, v in vars(law).items()}
    change = replace(injected, ports=(*injected.ports, Port(law, joint=joint)))
    return DrawnEffect(effect, joint, {**numbers, "law": type(law).__name__}, change)


def nonlinear_stiffness(
    scene: Scene, injected: InjectedFaults, rng: np.random.Generator
) -> DrawnEffect:
    """A gear that hardens or softens: smoothly, in steps of a catalogue, or with amplitude."""
    joint, stiffness, angle = _joint(scene, injected, rng)
    hardens = rng.random() < 0.6
    share = log_uniform(rng, 0.6, 2.0) if hardens else rng.uniform(0.3, 0.6)
    change = scene.size * stiffness * share
    knee, sign = angle * log_uniform(rng, 0.2, 1.0), 1.0 if hardens else -1.0
    choice: list[laws.JointLaw] = [
        laws.Hardening(sign * change, knee),
        laws.HarmonicDrive(sign * change / 2, knee, knee * rng.uniform(1.5, 3.0)),
        laws.AmplitudeSoftening(-sign * change, knee),
    ]
    return _in_joint("nonlinear_stiffness", injected, joint, choice, rng)


def friction(scene: Scene, injected: InjectedFaults, rng: np.random.Generator) -> DrawnEffect:
    """Hysteresis of Dahl, Bouc and Wen, Iwan, or bristles with Stribeck's fall."""
    joint, stiffness, angle = _joint(scene, injected, rng)
    stiffness = scene.size * stiffness * log_uniform(rng, 0.3, 1.5)
    coulomb = stiffness * angle * log_uniform(rng, 0.05, 0.4)
    speed = 2 * np.pi * REFERENCE_HZ * angle
    stribeck, stiction = speed * log_uniform(rng, 0.05, 0.5), coulomb * rng.uniform(1.1, 1.6)
    choice: list[laws.JointLaw] = [
        laws.Friction(stiffness, coulomb),
        laws.BoucWen(stiffness, coulomb),
        laws.Iwan(stiffness, coulomb),
        laws.LuGre(stiffness, coulomb, float(stiction), stribeck, 0.02 * coulomb / speed),
    ]
    return _in_joint("friction", injected, joint, choice, rng)


def backlash(scene: Scene, injected: InjectedFaults, rng: np.random.Generator) -> DrawnEffect:
    """Play in a gear, in which some stiffness is left; its teeth may dissipate as they meet."""
    joint, stiffness, angle = _joint(scene, injected, rng)
    stiffness = float(scene.size * stiffness * rng.uniform(0.4, 0.8))
    gap = angle * log_uniform(rng, 0.1, 0.5)
    damping = stiffness / (2 * np.pi * REFERENCE_HZ * angle) * log_uniform(rng, 0.02, 0.2)
    choice: list[laws.JointLaw] = [
        laws.Backlash(stiffness, gap),
        laws.ImpactDamping(stiffness, gap, damping),
    ]
    return _in_joint("backlash", injected, joint, choice, rng)


def drift(scene: Scene, injected: InjectedFaults, rng: np.random.Generator) -> DrawnEffect:
    """Joints warm up each by itself, some much, some hardly; or another tool half-way through."""
    if rng.random() < CHANGED_TOOL:
        factor = 1 + scene.size * log_uniform(rng, 0.1, 0.6)
        load = LoadChange("spindle", factor, float(rng.uniform(0.3, 0.7)))
        changed: Parameters = {"load_factor": factor, "start": load.start}
        return DrawnEffect("drift", "campaign", changed, replace(injected, load=load))
    course = str(rng.choice(["linear", "warming", "step"]))
    size = scene.size * rng.uniform(0.12, 0.35) * rng.choice([-1, 1])
    own = {joint: float(size * rng.uniform(0.1, 1.5)) for joint in scene.joints}
    before = injected.drift.joints if isinstance(injected.drift, JointDrift) else ()
    law = JointDrift((*before, *((joint, change, course) for joint, change in own.items())))
    parameters: Parameters = {"course": course, **own}
    return DrawnEffect("drift", "campaign", parameters, replace(injected, drift=law))


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
EFFECTS: dict[str, Draw] = {**LINEAR, **NONLINEAR, "drift": drift}
