"""The simulation of a robot: modes and FRFs at any pose."""

import numpy as np

from planner.physics.dynamics import (
    Poles,
    SimulatedModes,
    accelerance,
    oscillatory,
    solve_poles,
)
from planner.physics.families import Families, rearranged, undamped_modes
from planner.robot.elastic import ElasticModel
from planner.robot.robot import Robot


class Simulation:
    """Flexible-joint simulation of a robot with the stiffness and damping of its robot.toml.

    Raises InputError if robot.toml lists no elastic degree of freedom.
    """

    def __init__(self, robot: Robot):
        self.robot = robot
        self.elastic = ElasticModel(robot)
        self.stiffness = np.diag(self.elastic.stiffness)
        self.damping = np.diag(self.elastic.damping)

    def poles(self, q: np.ndarray) -> Poles:
        """All poles and residues at q (n, dof) in rad."""
        m = self.elastic.matrices(q)
        return solve_poles(m.mass, self.damping, self.stiffness, m.hit, m.sensor)

    def modes(self, q: np.ndarray, count: int) -> SimulatedModes:
        """The `count` lowest oscillatory modes at q (n, dof) in rad, NaN where there are fewer."""
        return oscillatory(self.poles(q), count)

    def families(self, reference: np.ndarray, poses: np.ndarray) -> Families:
        """Families of modes followed from `reference` (dof,) over `poses` (n, dof), in rad."""
        return Families(reference, poses, self._undamped)

    def followed(self, q: np.ndarray, count: int, followed: Families) -> SimulatedModes:
        """Modes at q (n, dof) by family: they keep their column where they cross.

        NaN where a family's mode is overdamped.
        """
        everything = self.modes(q, self.elastic.size)
        return rearranged(everything, followed.places(q), self._undamped(q)[0], count)

    def _undamped(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return undamped_modes(self.elastic.matrices(q).mass, self.stiffness)

    def accelerance(self, q: np.ndarray, frequency_hz: np.ndarray) -> np.ndarray:
        """Accelerance (n, 3, 3, F) in m/s²/N: sensor frame by tcp frame, at frequency_hz (F,)."""
        return accelerance(self.poles(q), frequency_hz)
