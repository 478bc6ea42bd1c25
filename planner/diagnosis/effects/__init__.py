"""The registry of effects: each kind by name, and all of them at all their places."""

from planner.diagnosis.effects.added_mass import AddedMass
from planner.diagnosis.effects.angle_dependent_stiffness import AngleDependentStiffness
from planner.diagnosis.effects.base_compliance import BaseCompliance
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.exponential_window import ExponentialWindow
from planner.diagnosis.effects.joint_stiffness import JointStiffness
from planner.diagnosis.effects.link_flexibility import LinkFlexibility
from planner.diagnosis.effects.local_resonator import LocalResonator
from planner.diagnosis.effects.sensor_channel import ChannelDelay, Polarity, SensorGain
from planner.diagnosis.effects.sensor_rotation import SensorRotation
from planner.diagnosis.effects.structural_damping import StructuralDamping
from planner.diagnosis.effects.transverse_compliance import TransverseCompliance
from planner.dynamics.simulation import Simulation
from planner.recording.points import SENSOR

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


OF_SENSORS = SensorRotation, SensorGain, Polarity  # each sensor has its own


def library(simulation: Simulation, sensors: tuple[str, ...] = (SENSOR,)) -> tuple[Effect, ...]:
    """Every effect at every place where a simulation of this robot, or a sensor, can have it."""
    found: list[Effect] = []
    for kind in KINDS.values():
        if issubclass(kind, OF_SENSORS):
            found += kind.everywhere(simulation, sensors)
        else:
            found += kind.everywhere(simulation)
    return tuple(found)
