"""Springs that dissipate by a loss factor beside their dampers, as gears and bearings do."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from planner.dynamics.gradient import Impedance
from planner.effects.effect import Gain, Motions, Operator, PosedBodies, Start

LEAST, MOST = 0.002, 0.3  # of a start
INSTEAD = 0.8  # share of the dissipation, from which loss factors take the place of dampers


@dataclass(frozen=True)
class LossFactors(Operator):
    """i k η of every stated spring; ψ are the ln η. `stiffness` are those that robot.toml states.

    `blocks` are the springs' numbers, those with a number in common together.
    """

    blocks: tuple[tuple[int, ...], ...] = ()
    stiffness: tuple[float, ...] = ()

    kind = "structural_damping"

    def impedance(self, poses: PosedBodies, psi: np.ndarray) -> Impedance:
        """A loss factor η of a spring k turns it into k (1 + i η)."""
        every = [spring for group in self.blocks for spring in group]
        ports = np.zeros((len(poses.q), len(every), len(poses.springs)))
        for row, spring in enumerate(every):
            ports[:, row, poses.springs.index(spring)] = 1.0
        shapes = np.zeros((len(self.blocks), len(every), len(every)))
        for k, group in enumerate(self.blocks):
            at = [every.index(spring) for spring in group]
            shapes[k, at, at] = 1.0
        one = 1j * np.ones(poses.s.shape)
        pairs = zip(self.stiffness, np.exp(psi), strict=True)
        values = tuple((k, stiffness * eta * one) for k, (stiffness, eta) in enumerate(pairs))
        return Impedance(ports, shapes, values, tuple((value,) for value in values))

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """By the columns of all loss factors."""
        usual = np.exp(self.mean)
        columns = motions.changed_by(self.impedance(motions.poses, self.mean))
        [(nats, share)] = gain(columns, np.ones(len(usual)))
        return (Start(self, np.log(np.clip(share * usual, LEAST, MOST)), nats),)

    def beyond(self, psi: np.ndarray, viscous: Mapping[int, float]) -> bool:
        """Whether most springs dissipate so instead of by their dampers."""
        shares = [eta / (eta + viscous[spring]) for spring, eta in self.losses(psi).items()]
        return float(np.median(shares)) > INSTEAD

    def losses(self, psi: np.ndarray) -> dict[int, float]:
        """See `Operator.losses`."""
        pairs = zip(self.blocks, np.exp(psi), strict=True)
        return {spring: float(eta) for group, eta in pairs for spring in group}

    def vanishing(self, psi: np.ndarray) -> np.ndarray:
        """See `Operator.vanishing`."""
        return -np.ones(len(psi))

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        least, most = (100 * f(v for v, _ in values.values()) for f in (min, max))
        return f"Gears and bearings dissipate by loss factors, of {least:.1g} to {most:.1g} %."
