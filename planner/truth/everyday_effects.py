"""The library's effects in shapes that the planner's own models do not have."""

from dataclasses import replace

import numpy as np

from planner.truth import effects
from planner.truth.deviation import AttachedResonator, BentLink
from planner.truth.imperfections import gas_spring
from planner.truth.laws import Backlash, Friction, Hardening, JointLaw
from planner.truth.nonlinear import Port
from planner.truth.other_laws import (
    AmplitudeSoftening,
    BoucWen,
    HarmonicDrive,
    ImpactDamping,
    Iwan,
    LuGre,
)
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
from planner.truth.secret import JointDrift, LoadChange, Secret

REFERENCE_HZ = 15.0  # at which speeds of joints are estimated
CHANGED_TOOL = 0.25  # how often properties change because the tool does


def _in_joint(effect: str, scene: Scene, secret: Secret, joint: str, law: JointLaw) -> Drawn:
    """A law at a joint, with its own numbers and its class as parameters."""
    numbers: Parameters = {k: float(v) for k, v in vars(law).items()}
    change = replace(secret, ports=(*secret.ports, Port(law, joint=joint)))
    return Drawn(effect, joint, {**numbers, "law": type(law).__name__}, change)


def _joint(scene: Scene, secret: Secret, rng: np.random.Generator) -> tuple[str, float, float]:
    """A joint, what stiffness it has left, and its angle under a middling hit."""
    joint = some_joint(rng)
    return joint, effects.left(scene, secret, joint), scene.angle(joint)


def nonlinear_stiffness(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A gear that hardens or softens: smoothly, in steps of a catalogue, or with amplitude."""
    joint, left, angle = _joint(scene, secret, rng)
    hardens = rng.random() < 0.6
    change = scene.size * left * (log_uniform(rng, 0.6, 2.0) if hardens else rng.uniform(0.3, 0.6))
    knee, sign = angle * log_uniform(rng, 0.2, 1.0), 1.0 if hardens else -1.0
    laws: list[JointLaw] = [
        Hardening(sign * change, knee),
        HarmonicDrive(sign * change / 2, knee, knee * rng.uniform(1.5, 3.0)),
        AmplitudeSoftening(-sign * change, knee),
    ]
    return _in_joint("nonlinear_stiffness", scene, secret, joint, laws[int(rng.integers(3))])


def friction(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """Hysteresis of Dahl, Bouc and Wen, Iwan, or bristles with Stribeck's fall."""
    joint, left, angle = _joint(scene, secret, rng)
    stiffness = scene.size * left * log_uniform(rng, 0.3, 1.5)
    coulomb = stiffness * angle * log_uniform(rng, 0.05, 0.4)
    speed = 2 * np.pi * REFERENCE_HZ * angle
    stribeck, stiction = speed * log_uniform(rng, 0.05, 0.5), coulomb * rng.uniform(1.1, 1.6)
    laws: list[JointLaw] = [
        Friction(stiffness, coulomb),
        BoucWen(stiffness, coulomb),
        Iwan(stiffness, coulomb),
        LuGre(stiffness, coulomb, float(stiction), stribeck, 0.02 * coulomb / speed),
    ]
    return _in_joint("friction", scene, secret, joint, laws[int(rng.integers(4))])


def backlash(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """Play in a gear; its teeth may dissipate as they meet."""
    joint, left, angle = _joint(scene, secret, rng)
    stiffness = float(scene.size * left * rng.uniform(0.4, 0.8))
    gap = angle * log_uniform(rng, 0.1, 0.5)
    damping = stiffness / (2 * np.pi * REFERENCE_HZ * angle) * log_uniform(rng, 0.02, 0.2)
    laws: list[JointLaw] = [Backlash(stiffness, gap), ImpactDamping(stiffness, gap, damping)]
    return _in_joint("backlash", scene, secret, joint, laws[int(rng.integers(2))])


def link_flexibility(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A link is a beam of five elements or more; the one that bends a little anyway bends more."""
    lengths = {i: float(np.linalg.norm(scene.length(i))) for i in range(1, 5)}
    number = int(rng.choice([i for i, length in lengths.items() if length > 0.15]))
    own = scene.stiffness(f"joint_{number}") / scene.size
    first = own * log_uniform(rng, 0.4, 2.0)
    second, twist = first * log_uniform(rng, 0.7, 1.4), first * log_uniform(rng, 0.5, 3.0)
    link, elements = f"link_{number}", int(rng.integers(5, 8))
    before = [beam for beam in secret.deviation.beams if beam.link == link]
    if before:  # compliances in series
        first, second = (
            1 / (1 / k + 1 / b) for k, b in zip((first, second), before[0].bending, strict=True)
        )
        twist = 1 / (1 / twist + 1 / before[0].torsion)
    beam = BentLink(link, (first, second), twist, scene.arm.damping_s, elements)
    others = tuple(b for b in secret.deviation.beams if b.link != link)
    change = replace(secret, deviation=replace(secret.deviation, beams=(*others, beam)))
    parameters: Parameters = {"bending_stiffness": [first, second], "torsion_stiffness": twist}
    return Drawn("link_flexibility", link, parameters, change)


def transverse_compliance(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A bearing that is softer than the others, which give way a little too."""
    drawn = effects.transverse_compliance(scene, secret, rng)
    springs, before = drawn.secret.deviation.extra[-2:], secret.deviation.extra
    own = [s.stiffness for s in before if s.joint == drawn.at]
    if own:  # one body between two springs about the same axis would have no inertia
        rest = float(np.mean(own))
        series = [1 / (1 / s.stiffness + 1 / rest) for s in springs]
        springs = tuple(
            replace(s, stiffness=k, damping=s.damping * k / s.stiffness)
            for s, k in zip(springs, series, strict=True)
        )
    others = tuple(s for s in before if s.joint != drawn.at)
    deviation = replace(secret.deviation, extra=(*others, *springs))
    parameters: Parameters = {"stiffness": [s.stiffness for s in springs]}
    return replace(drawn, parameters=parameters, secret=replace(secret, deviation=deviation))


def local_resonator(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """A loose part, or a hose pack that swings at up to three frequencies in as many directions."""
    drawn = effects.local_resonator(scene, secret, rng)
    main = drawn.secret.deviation.resonators[-1]
    more = [
        AttachedResonator(
            main.link,
            main.position_m,
            triple(some_direction(rng)),
            main.mass_kg * log_uniform(rng, 0.1, 0.5),
            main.frequency_hz * log_uniform(rng, 0.6, 1.7),
            main.damping_ratio,
        )
        for _ in range(int(rng.integers(3)))
    ]
    return replace(drawn, secret=deviate(drawn.secret, resonators=more))


def angle_dependent_stiffness(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """Harmonics of the angle, or a gas spring that robot.toml does not have."""
    if rng.random() < 0.7:
        return effects.angle_dependent_stiffness(scene, secret, rng)
    spring = gas_spring(scene, (0.3 * scene.size, 0.6 * scene.size), rng)
    parameters: Parameters = {k: float(v) for k, v in vars(spring).items() if k != "joint"}
    change = deviate(secret, compensators=(spring,))
    return Drawn("angle_dependent_stiffness", spring.joint, parameters, change)


def drift(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    """Joints warm up each by itself, some much, some hardly; or another tool half-way through."""
    if rng.random() < CHANGED_TOOL:
        return _changed_tool(scene, secret, rng)
    course = str(rng.choice(["linear", "warming", "step"]))
    size = scene.size * rng.uniform(0.12, 0.35) * rng.choice([-1, 1])
    own = {f"joint_{n}": float(size * rng.uniform(0.1, 1.5)) for n in range(1, 7)}
    before = secret.drift.joints if isinstance(secret.drift, JointDrift) else ()
    law = JointDrift((*before, *((joint, change, course) for joint, change in own.items())))
    parameters: Parameters = {"course": course, **own}
    return Drawn("drift", "campaign", parameters, replace(secret, drift=law))


def _changed_tool(scene: Scene, secret: Secret, rng: np.random.Generator) -> Drawn:
    factor = 1 + scene.size * log_uniform(rng, 0.1, 0.6)
    load = LoadChange("spindle", factor, float(rng.uniform(0.3, 0.7)))
    parameters: Parameters = {"load_factor": factor, "start": load.start}
    return Drawn("drift", "campaign", parameters, replace(secret, load=load))


EVERYDAY_EFFECTS: dict[str, Draw] = {
    "nonlinear_stiffness": nonlinear_stiffness,
    "friction": friction,
    "backlash": backlash,
    "link_flexibility": link_flexibility,
    "transverse_compliance": transverse_compliance,
    "local_resonator": local_resonator,
    "angle_dependent_stiffness": angle_dependent_stiffness,
    "drift": drift,
}
