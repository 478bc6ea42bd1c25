"""Small unlisted imperfections: no robot is quite what its simulation has, with nothing wrong."""

from collections import defaultdict

import numpy as np

from planner.proof.deviation import (
    AttachedResonator,
    BentLink,
    Compensator,
    Spring,
    StiffnessRipple,
)
from planner.proof.fault_injection import InjectedFaults, JointDrift
from planner.proof.laws import AmplitudeSoftening, Friction, Iwan, JointLaw
from planner.proof.nonlinear import Port
from planner.proof.scene import Scene, triple
from planner.proof.springs import across

# All chosen, so that FRFs change by some percent together: what an engineer would let pass.
SOFT_SHARE, SOFT = 0.4, (0.5, 1.3)  # of the cases: all stated stiffnesses times such a factor
BEARINGS = 60.0, 300.0  # stiffness across a joint's axis over that about it
LAWS = 1e-3, 1e-2  # of a joint's stiffness, that is not linear
HOSES = 2  # at least; and up to as many more
HOSE_MASS = 3e-4, 2e-3  # of the moving mass
RIPPLE = 0.01  # of a joint's stiffness
DRIFT_SD = 0.004  # of each joint's stiffness, over the campaign
BEAM = 30.0, 100.0  # stiffness of a link as a beam over that of its joint
COMPENSATOR = 0.005, 0.03  # of joint 2's stiffness
Step = tuple[InjectedFaults, InjectedFaults]  # without what it puts in, and with it


def imperfect(scene: Scene) -> tuple[InjectedFaults, dict[tuple[str, str], list[Step]]]:
    """Each joint a little nonlinear, rippled, drifting and soft across; links, hoses, a gas spring.

    Damping is partly viscous, partly a loss factor, by a share of each gear's own. Beside the
    robot: what a diagnosis may call an effect, at a place, and the steps that put it in.
    """
    rng, found = scene.rng, defaultdict[tuple[str, str], list[Step]](list)

    def with_it(changed: Scene, effect: str, at: str) -> Scene:
        found[effect, at].append((scene.injected, changed.injected))
        return changed

    common = scene.log_uniform(*SOFT) if rng.random() < SOFT_SHARE else 1.0
    softer = scene.deviating(common=common)
    for joint in scene.joints if abs(np.log(common)) > np.log(1.2) else ():
        with_it(softer, "joint_stiffness", at=joint)
    scene = softer
    scene = with_it(scene.deviating(mixed=1.0), "structural_damping", at="joints")
    for joint in scene.joints:
        effect, port = _law(scene, joint)
        scene = with_it(scene.changed(ports=(*scene.injected.ports, port)), effect, at=joint)
        wave = _ripple(scene, joint)
        scene = with_it(scene.adding(harmonics=(wave,)), "angle_dependent_stiffness", at=joint)
        if scene.per_joint == 1:
            bearings = scene.adding(extra=_bearings(scene, joint))
            scene = with_it(bearings, "transverse_compliance", at=joint)
    drifts = tuple((j, DRIFT_SD * float(rng.standard_normal()), "warming") for j in scene.joints)
    scene = with_it(scene.changed(drift=JointDrift(drifts)), "drift", at="campaign")
    for _ in range(HOSES + int(rng.integers(HOSES + 1))):
        hose = _hose(scene)
        scene = with_it(scene.adding(resonators=(hose,)), "local_resonator", at=hose.link)
    beam = _beam(scene)
    scene = with_it(scene.adding(beams=(beam,)), "link_flexibility", at=beam.link)
    spring = gas_spring(scene, COMPENSATOR)
    scene = with_it(scene.adding(compensators=(spring,)), "angle_dependent_stiffness", at="joint_2")
    return scene.injected, dict(found)


def _law(scene: Scene, joint: str) -> tuple[str, Port]:
    own, angle = scene.stiffness(joint), scene.angle(joint)
    share = scene.log_uniform(*LAWS) * own
    laws: list[tuple[str, JointLaw]] = [
        ("nonlinear_stiffness", AmplitudeSoftening(share * scene.rng.choice([-1, 1]), 0.3 * angle)),
        ("friction", Iwan(share, 0.3 * share * angle)),
        ("friction", Friction(share, 0.3 * share * angle)),
    ]
    effect, law = laws[int(scene.rng.integers(len(laws)))]
    return effect, Port(law, joint=joint)


def _ripple(scene: Scene, joint: str) -> StiffnessRipple:
    cosine, sine = RIPPLE * scene.rng.standard_normal(2)
    return StiffnessRipple(joint, int(scene.rng.integers(1, 3)), float(cosine), float(sine))


def _bearings(scene: Scene, joint: str) -> list[Spring]:
    own, axes = scene.stiffness(joint), across(scene.axis(joint))
    return [scene.spring(joint, a, own * scene.log_uniform(*BEARINGS)) for a in axes]


def _beam(scene: Scene) -> BentLink:
    usable = [n for n in (2, 3) if np.linalg.norm(scene.length(n)) > 0]
    number = int(scene.rng.choice(usable))
    stiff = scene.stiffness(f"joint_{number}")
    bending = scene.log_uniform(*BEAM) * stiff, scene.log_uniform(*BEAM) * stiff
    twist = scene.log_uniform(*BEAM) * stiff
    return BentLink(f"link_{number}", bending, twist, scene.arm.damping_s)


def _hose(scene: Scene) -> AttachedResonator:
    number, (low, high) = scene.some_link(), scene.band_of_modes
    return AttachedResonator(
        f"link_{number}",
        triple(scene.rng.uniform(0.1, 1.0) * scene.length(number)),
        scene.direction(),
        scene.moving_kg * scene.log_uniform(*HOSE_MASS),
        scene.log_uniform(0.5 * low, 2 * high),
        scene.log_uniform(0.03, 0.15),
    )


def gas_spring(scene: Scene, share: tuple[float, float]) -> Compensator:
    """Of joint 2; its stiffness is of the size of a share of the joint's own."""
    arm, base = scene.rng.uniform(0.15, 0.3), scene.rng.uniform(0.5, 0.9)
    size = scene.log_uniform(*share) * scene.stiffness("joint_2")
    force, stiffness = 0.3 * size / arm, 0.7 * size / arm**2
    offset = float(scene.rng.uniform(0.3, np.pi - 0.3))
    return Compensator("joint_2", float(arm), float(base), offset, float(force), float(stiffness))
