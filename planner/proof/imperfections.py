"""Small unlisted imperfections: no robot is quite what its simulation has, with nothing wrong."""

import numpy as np

from planner.proof.deviation import AttachedResonator, BentLink, Compensator, StiffnessRipple
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


def imperfect(scene: Scene) -> tuple[InjectedFaults, tuple[tuple[str, str], ...]]:
    """Each joint a little nonlinear, rippled, drifting and soft across; links, hoses, a gas spring.

    Damping is partly viscous, partly a loss factor, by a share of each gear's own. With it the
    names (effect, place) by which a diagnosis could rightly call them.
    """
    rng = scene.rng
    common = scene.log_uniform(*SOFT) if rng.random() < SOFT_SHARE else 1.0
    scene = scene.deviating(common=common, mixed=1.0)
    places = [("structural_damping", "joints"), ("drift", "campaign")]
    for joint in scene.joints:
        scene, effects = _joint(scene, joint)
        places += [(effect, joint) for effect in effects]
        if abs(np.log(common)) > np.log(1.2):
            places.append(("joint_stiffness", joint))
    drifts = tuple((j, DRIFT_SD * float(rng.standard_normal()), "warming") for j in scene.joints)
    scene = scene.changed(drift=JointDrift(drifts))
    for _ in range(HOSES + int(rng.integers(HOSES + 1))):
        hose = _hose(scene)
        scene = scene.adding(resonators=(hose,))
        places.append(("local_resonator", hose.link))
    number = int(rng.choice([n for n in (2, 3) if np.linalg.norm(scene.length(n)) > 0]))
    stiff = scene.stiffness(f"joint_{number}")
    bending = scene.log_uniform(*BEAM) * stiff, scene.log_uniform(*BEAM) * stiff
    twist = scene.log_uniform(*BEAM) * stiff
    beam = BentLink(f"link_{number}", bending, twist, scene.arm.damping_s)
    scene = scene.adding(beams=(beam,), compensators=(gas_spring(scene, COMPENSATOR),))
    places += [("link_flexibility", beam.link), ("angle_dependent_stiffness", "joint_2")]
    return scene.injected, tuple(dict.fromkeys(places))


def _joint(scene: Scene, joint: str) -> tuple[Scene, list[str]]:
    own, angle, rng = scene.stiffness(joint), scene.angle(joint), scene.rng
    share = scene.log_uniform(*LAWS) * own
    laws: list[tuple[str, JointLaw]] = [
        ("nonlinear_stiffness", AmplitudeSoftening(share * rng.choice([-1, 1]), 0.3 * angle)),
        ("friction", Iwan(share, 0.3 * share * angle)),
        ("friction", Friction(share, 0.3 * share * angle)),
    ]
    effect, law = laws[int(rng.integers(len(laws)))]
    scene = scene.changed(ports=(*scene.injected.ports, Port(law, joint=joint)))
    cosine, sine = RIPPLE * rng.standard_normal(2)
    wave = StiffnessRipple(joint, int(rng.integers(1, 3)), float(cosine), float(sine))
    scene = scene.adding(harmonics=(wave,))
    effects = [effect, "angle_dependent_stiffness"]
    if scene.per_joint == 1:
        axes = across(scene.axis(joint))
        springs = [scene.spring(joint, a, own * scene.log_uniform(*BEARINGS)) for a in axes]
        scene = scene.adding(extra=springs)
        effects.append("transverse_compliance")
    return scene, effects


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
