"""The simulation of a robot: modes and FRFs at any pose."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from planner.dynamics.mode_families import Families, rearranged, undamped_modes
from planner.dynamics.vibration import (
    Poles,
    SimulatedModes,
    accelerance,
    oscillatory,
    receptance,
    solve_poles,
)
from planner.robot.config import HammerTable
from planner.robot.elastic_model import ElasticModel, Matrices
from planner.robot.joint_laws import LawTable
from planner.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class Elasticity:
    """Stiffness (e,) in N·m/rad, damping (e,) in N·m·s/rad, loss factor (e,) of the rotations."""

    stiffness: np.ndarray
    damping: np.ndarray
    loss_factor: np.ndarray


class Simulation:
    """Flexible-joint simulation of a robot with the stiffness and damping of its robot.toml.

    Raises InputError if robot.toml lists no elastic degree of freedom.
    """

    def __init__(self, robot: Robot):
        self.robot = robot
        self.elastic = ElasticModel(robot)
        self.elasticity = Elasticity(
            self.elastic.stiffness, self.elastic.damping, self.elastic.loss_factor
        )

    def changed(
        self, elasticity: Elasticity, inertia_change: np.ndarray | None = None
    ) -> "Simulation":
        """The same robot with other springs, and with inertia_change (bodies, 10) added.

        The change is counted from the robot's own inertias (`ElasticModel.inertia`).
        """
        other = copy.copy(self)
        other.elasticity = elasticity
        elastic = self.elastic
        if inertia_change is not None:
            elastic = ElasticModel(self.robot, inertia_change)
        other.elastic = elastic.carried_by(elasticity.stiffness)
        return other

    def with_laws(self, laws: Sequence[LawTable], hammer: HammerTable) -> "Simulation":
        """The same with other laws of its joints, and another hammer."""
        other, config = copy.copy(self), self.robot.config
        config = msgspec.structs.replace(config, law=tuple(laws), hammer=hammer)
        other.robot = replace(self.robot, config=config)
        return other

    @property
    def law_springs(self) -> list[int]:
        """Numbers of the joints' own springs beside which its laws are."""
        return [self.elastic.own_spring(law.joint) for law in self.robot.config.law]

    @property
    def stiffness(self) -> np.ndarray:
        """K (e, e) without gravity's part; complex where there is structural damping."""
        k, eta = self.elasticity.stiffness, self.elasticity.loss_factor
        return np.diag(k * (1 + 1j * eta) if eta.any() else k)

    @property
    def damping(self) -> np.ndarray:
        """C (e, e)."""
        return np.diag(self.elasticity.damping)

    def poles(self, q: np.ndarray) -> Poles:
        """All poles and residues at q (n, dof) in rad."""
        return self.solved(self.elastic.matrices(q))

    def solved(self, m: Matrices) -> Poles:
        """The same between the points of the matrices."""
        return solve_poles(m.mass, self.damping, self.stiffness + m.geometric, m.hit, m.sensor)

    def modes(self, q: np.ndarray, count: int) -> SimulatedModes:
        """The `count` lowest oscillatory modes at q (n, dof) in rad, NaN where there are fewer."""
        return oscillatory(self.poles(q), count)

    def frequencies(self, q: np.ndarray, count: int) -> SimulatedModes:
        """The same modes by frequency and damping alone, in half the time; residues are empty."""
        m, none = self.elastic.matrices(q), np.zeros((len(q), 0, self.elastic.size))
        return oscillatory(self.solved(replace(m, hit=none, sensor=none)), count)

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
        m = self.elastic.matrices(q)
        return undamped_modes(m.mass, self.stiffness.real + m.geometric)

    def accelerance(self, q: np.ndarray, frequency_hz: np.ndarray) -> np.ndarray:
        """Accelerance (n, 3, 3, F) in m/s²/N: sensor frame by tcp frame, at frequency_hz (F,)."""
        return accelerance(self.poles(q), frequency_hz)

    def frfs(
        self,
        q: np.ndarray,
        frequency_hz: np.ndarray,
        hits: Sequence[str] = (),
        sensors: Sequence[str] = (),
        quantity: str = "accelerance",
    ) -> np.ndarray:
        """FRFs (n, s, 3, h, 3, F) from every hit frame to every sensor frame, in their own axes.

        `hits` and `sensors` name frames of the URDF or points of robot.toml (none: the tcp and the
        sensor); `quantity` is "accelerance" (m/s²/N) or "receptance" (m/N). Raises InputError for
        unknown ones.
        """
        synthesis = {"accelerance": accelerance, "receptance": receptance}[quantity]
        values = synthesis(self.solved(self.elastic.matrices(q, hits, sensors)), frequency_hz)
        n, rows, columns, lines = values.shape
        return values.reshape(n, rows // 3, 3, columns // 3, 3, lines)
