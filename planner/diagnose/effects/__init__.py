"""The registry of effects: each kind by name, and all of them at all their places."""

from planner.diagnose.effects.angle import AngleDependentStiffness
from planner.diagnose.effects.base import BaseCompliance
from planner.diagnose.effects.channel import ChannelDelay, Polarity, SensorGain
from planner.diagnose.effects.damping import StructuralDamping
from planner.diagnose.effects.effect import Effect
from planner.diagnose.effects.link import LinkFlexibility
from planner.diagnose.effects.mass import AddedMass
from planner.diagnose.effects.resonator import LocalResonator
from planner.diagnose.effects.rotation import SensorRotation
from planner.diagnose.effects.stiffness import JointStiffness
from planner.diagnose.effects.transverse import TransverseCompliance
from planner.diagnose.effects.window import ExponentialWindow
from planner.physics.simulation import Simulation

KINDS: dict[str, type[Effect]] = {
    "joint_stiffness": JointStiffness,
    "transverse_compliance": TransverseCompliance,
    "base_compliance": BaseCompliance,
    "link_flexibility": LinkFlexibility,
    "added_mass": AddedMass,
    "local_resonator": LocalResonator,
    "angle_dependent_stiffness": AngleDependentStiffness,
    "structural_damping": StructuralDamping,
    "sensor_rotation": SensorRotation,
    "sensor_gain": SensorGain,
    "polarity": Polarity,
    "channel_delay": ChannelDelay,
    "exponential_window": ExponentialWindow,
}


def library(simulation: Simulation) -> tuple[Effect, ...]:
    """Every effect at every place where a simulation of this robot can have it."""
    return tuple(effect for kind in KINDS.values() for effect in kind.everywhere(simulation))
