"""The physics that a case can conceal: one function per effect of the library.

Sizes follow the robot: its stiffnesses, its mass, and the joints' angles under a middling hit. Many
come in shapes that the planner's own models do not have.
"""

from dataclasses import replace

import numpy as np

from planner.proof import deviation, laws
from planner.proof.fault_injection import JointDrift, LoadChange
from planner.proof.imperfections import gas_spring
from planner.proof.nonlinear import Port
from planner.proof.scene import REFERENCE_HZ, Draw, Drawn, Parameters, Scene, triple

CHANGED_TOOL = 0.25  # how often properties change because the tool does


def joint_stiffness(scene: Scene) -> Drawn:
    """A joint about its own axis is far softer or stiffer than stated."""
    joint = scene.some_joint()
    softer = scene.rng.random() < 0.7
    factor = scene.log_uniform(0.3, 0.55) if softer else scene.log_uniform(2.0, 3.5)
    factor = factor**scene.size
    parameters: Parameters = {"factor": factor, "stiffness": factor * scene.stiffness(joint)}
    return joint, parameters, scene.adding(scaled=(deviation.ScaledJoint(joint, factor),))


def transverse_compliance(scene: Scene) -> Drawn:
    """A bearing tilts about both axes across its joint's own, softer than the others."""
    joint = scene.some_joint()
    first = scene.stiffness(joint) * scene.log_uniform(0.4, 2.5) / scene.size
    stiffness = [first, first * scene.log_uniform(0.7, 1.4)]
    before = scene.injected.deviation.extra
    own = [s.stiffness for s in before if s.joint == joint]
    if own:  # one body between two springs about the same axis would have no inertia
        stiffness = [_in_series(k, float(np.mean(own))) for k in stiffness]
    axes = np.eye(3)[np.abs(scene.axis(joint)) < 0.5]
    springs = [scene.spring(joint, a, k) for a, k in zip(axes, stiffness, strict=True)]
    others = (s for s in before if s.joint != joint)
    return joint, {"stiffness": stiffness}, scene.deviating(extra=(*others, *springs))


def _in_series(one: float, other: float) -> float:
    return 1 / (1 / one + 1 / other)


def base_compliance(scene: Scene) -> Drawn:
    """The floor gives way: two tilts, or sometimes all six."""
    tilt = scene.stiffness("joint_2") * scene.log_uniform(0.7, 4.0) / scene.size
    tilts = [tilt, tilt * scene.log_uniform(0.7, 1.4)]
    springs = [*deviation.soft_floor(tilts[0], tilts[1], scene.arm.damping_s)]
    parameters: Parameters = {"stiffness": tilts, "freedoms": 2.0}
    if scene.rng.random() < 0.35:
        reach = float(np.linalg.norm(scene.length(2)))
        shift = 2 * tilt / reach**2 * scene.log_uniform(0.7, 2.0)
        turn = 2 * tilt * scene.log_uniform(0.7, 2.0)
        springs += [scene.spring("base", a, shift, slide=True) for a in np.eye(3)]
        springs.append(scene.spring("base", np.eye(3)[2], turn))
        parameters |= {"freedoms": 6.0, "shift_stiffness": shift, "turn_stiffness": turn}
    return "base", parameters, scene.adding(extra=springs)


def link_flexibility(scene: Scene) -> Drawn:
    """A link is a beam of five elements or more; the one that bends a little anyway bends more."""
    lengths = {i: float(np.linalg.norm(scene.length(i))) for i in range(1, 5)}
    number = int(scene.rng.choice([i for i, length in lengths.items() if length > 0.15]))
    own = scene.stiffness(f"joint_{number}") / scene.size
    first = own * scene.log_uniform(0.4, 2.0)
    second, twist = first * scene.log_uniform(0.7, 1.4), first * scene.log_uniform(0.5, 3.0)
    link, elements = f"link_{number}", int(scene.rng.integers(5, 8))
    before = scene.injected.deviation.beams
    for beam in (b for b in before if b.link == link):
        first, second = (
            _in_series(k, b) for k, b in zip((first, second), beam.bending, strict=True)
        )
        twist = _in_series(twist, beam.torsion)
    beam = deviation.BentLink(link, (first, second), twist, scene.arm.damping_s, elements)
    others = tuple(b for b in before if b.link != link)
    parameters: Parameters = {"bending_stiffness": [first, second], "torsion_stiffness": twist}
    return link, parameters, scene.deviating(beams=(*others, beam))


def added_mass(scene: Scene) -> Drawn:
    """A lump on a link, or a payload missing from the robot folder."""
    number = scene.some_link()
    mass = scene.size * scene.moving_kg * scene.log_uniform(0.03, 0.15)
    along = scene.rng.uniform(0.1, 1.0) * scene.length(number)
    place = triple(along + 0.1 * np.array(scene.direction()))
    lump = deviation.AttachedMass(f"link_{number}", place, mass)
    parameters: Parameters = {"mass": mass, "position_m": list(place)}
    return lump.link, parameters, scene.adding(added=(lump,))


def local_resonator(scene: Scene) -> Drawn:
    """A loose part, or a hose pack that swings at up to three frequencies in as many directions."""
    number = scene.some_link()
    low, high = scene.band_of_modes
    main = deviation.AttachedResonator(
        f"link_{number}",
        triple(scene.rng.uniform(0.3, 1.0) * scene.length(number)),
        scene.direction(),
        scene.size * scene.moving_kg * scene.log_uniform(0.01, 0.05),
        scene.log_uniform(0.9 * low, 1.1 * high),
        scene.log_uniform(0.01, 0.05),
    )
    more = [
        replace(
            main,
            direction=scene.direction(),
            mass_kg=main.mass_kg * scene.log_uniform(0.1, 0.5),
            frequency_hz=main.frequency_hz * scene.log_uniform(0.6, 1.7),
        )
        for _ in range(int(scene.rng.integers(3)))
    ]
    parameters: Parameters = {
        "mass": main.mass_kg,
        "frequency_hz": main.frequency_hz,
        "damping_ratio": main.damping_ratio,
        "direction": list(main.direction),
        "position_m": list(main.position_m),
    }
    return main.link, parameters, scene.adding(resonators=(main, *more))


def angle_dependent_stiffness(scene: Scene) -> Drawn:
    """First or second harmonic of the angle, or a gas spring that robot.toml does not have."""
    if scene.rng.random() < 0.7:
        joint, order = scene.some_joint(), int(scene.rng.integers(1, 3))
        cosine, sine = scene.ripple()
        parameters: Parameters = {"order": float(order), "cosine": cosine, "sine": sine}
        wave = deviation.StiffnessRipple(joint, order, cosine, sine)
        return joint, parameters, scene.adding(harmonics=(wave,))
    spring = gas_spring(scene, (0.3 * scene.size, 0.6 * scene.size))
    parameters = {k: float(v) for k, v in vars(spring).items() if k != "joint"}
    return spring.joint, parameters, scene.adding(compensators=(spring,))


def _law(scene: Scene, joint: str, *choice: laws.JointLaw) -> Drawn:
    """One of some laws at a joint, with its own numbers and its class as parameters."""
    law = choice[int(scene.rng.integers(len(choice)))]
    numbers: Parameters = {k: float(v) for k, v in vars(law).items()}
    ports = (*scene.injected.ports, Port(law, joint=joint))
    return joint, {**numbers, "law": type(law).__name__}, scene.changed(ports=ports)


def _joint(scene: Scene) -> tuple[str, float, float]:
    """A joint, what stiffness (N·m/rad) it has left, and its angle under a middling hit.

    What earlier effects leave where they leave least: a law takes its share of this, so that no
    joint pushes away from its rest.
    """
    joint, share = scene.some_joint(), 1.0
    for change in scene.injected.deviation.scaled:
        share *= change.factor if change.joint == joint else 1.0
    for wave in scene.injected.deviation.harmonics:
        share *= 1 - float(np.hypot(wave.cosine, wave.sine)) if wave.joint == joint else 1.0
    return joint, share * scene.stiffness(joint), scene.angle(joint)


def nonlinear_stiffness(scene: Scene) -> Drawn:
    """A gear that hardens or softens: smoothly, in steps of a catalogue, or with amplitude."""
    (joint, stiffness, angle), rng = _joint(scene), scene.rng
    hardens = rng.random() < 0.6
    share = scene.log_uniform(0.6, 2.0) if hardens else rng.uniform(0.3, 0.6)
    change = scene.size * stiffness * share
    knee, sign = angle * scene.log_uniform(0.2, 1.0), 1.0 if hardens else -1.0
    return _law(
        scene,
        joint,
        laws.Hardening(sign * change, knee),
        laws.HarmonicDrive(sign * change / 2, knee, knee * rng.uniform(1.5, 3.0)),
        laws.AmplitudeSoftening(-sign * change, knee),
    )


def friction(scene: Scene) -> Drawn:
    """Hysteresis of Dahl, Bouc and Wen, Iwan, or bristles with Stribeck's fall."""
    joint, stiffness, angle = _joint(scene)
    stiffness = scene.size * stiffness * scene.log_uniform(0.3, 1.5)
    coulomb = stiffness * angle * scene.log_uniform(0.05, 0.4)
    speed = 2 * np.pi * REFERENCE_HZ * angle
    stribeck, stiction = speed * scene.log_uniform(0.05, 0.5), coulomb * scene.rng.uniform(1.1, 1.6)
    return _law(
        scene,
        joint,
        laws.Friction(stiffness, coulomb),
        laws.BoucWen(stiffness, coulomb),
        laws.Iwan(stiffness, coulomb),
        laws.LuGre(stiffness, coulomb, float(stiction), stribeck, 0.02 * coulomb / speed),
    )


def backlash(scene: Scene) -> Drawn:
    """Play in a gear, in which some stiffness is left; its teeth may dissipate as they meet."""
    joint, stiffness, angle = _joint(scene)
    stiffness = float(scene.size * stiffness * scene.rng.uniform(0.4, 0.8))
    gap = angle * scene.log_uniform(0.1, 0.5)
    damping = stiffness / (2 * np.pi * REFERENCE_HZ * angle) * scene.log_uniform(0.02, 0.2)
    play, knock = laws.Backlash(stiffness, gap), laws.ImpactDamping(stiffness, gap, damping)
    return _law(scene, joint, play, knock)


def drift(scene: Scene) -> Drawn:
    """Joints warm up each by itself, some much, some hardly; or another tool half-way through."""
    rng = scene.rng
    if rng.random() < CHANGED_TOOL:
        factor = 1 + scene.size * scene.log_uniform(0.1, 0.6)
        load = LoadChange("spindle", factor, float(rng.uniform(0.3, 0.7)))
        parameters: Parameters = {"load_factor": factor, "start": load.start}
        return "campaign", parameters, scene.changed(load=load)
    course = str(rng.choice(["linear", "warming", "step"]))
    size = scene.size * rng.uniform(0.12, 0.35) * rng.choice([-1, 1])
    own = {joint: float(size * rng.uniform(0.1, 1.5)) for joint in scene.joints}
    earlier = scene.injected.drift
    before = earlier.joints if isinstance(earlier, JointDrift) else ()
    law = JointDrift((*before, *((joint, change, course) for joint, change in own.items())))
    return "campaign", {"course": course, **own}, scene.changed(drift=law)


LINEAR: dict[str, Draw] = {
    effect.__name__: effect
    for effect in (
        joint_stiffness, transverse_compliance, base_compliance, link_flexibility, added_mass,
        local_resonator, angle_dependent_stiffness,
    )
}  # fmt: skip
NONLINEAR: dict[str, Draw] = {e.__name__: e for e in (nonlinear_stiffness, friction, backlash)}
EFFECTS: dict[str, Draw] = {**LINEAR, **NONLINEAR, "drift": drift}
