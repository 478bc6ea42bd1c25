"""A spring between two links, or between a link and what stands outside."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from planner.dynamics.gradient import Impedance
from planner.effects.effect import Gain, Motions, Operator, PosedBodies, Start

PAIRS = tuple((i, k) for i in range(3) for k in range(i, 3))
SHAPES = np.array([
    np.outer(np.eye(3)[i], np.eye(3)[k]) + (i != k) * np.outer(np.eye(3)[k], np.eye(3)[i])
    for i, k in PAIRS
])  # fmt: skip


@dataclass(frozen=True)
class LinkSpring(Operator):
    """A symmetric stiffness ψ (6,) in sds, of what moves at a place of a link, and its damping.

    `inner` is the joint of the link at its other end; none: it stands on the ground.
    """

    joint: str = ""
    inner: str = ""
    place_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale_n_m: float = 1.0
    damping_s: float = 1e-3

    general = True

    def port(self, poses: PosedBodies) -> np.ndarray:
        """(n, 3, e): how springs move the place, of those between both ends."""
        ports = poses.carried(self.joint, np.array(self.place_m))
        if not self.inner:
            return ports
        before = np.any(poses.body(self.inner) != 0, axis=(0, 1))
        return np.where(before, 0.0, ports)

    def impedance(self, poses: PosedBodies, psi: np.ndarray) -> Impedance:
        """Pᵀ Σ ψ S P, with a damper in proportion."""
        unit = self.scale_n_m * (1 + self.damping_s * poses.s)
        values = tuple((k, v * unit) for k, v in enumerate(psi))
        slope = tuple(((k, unit),) for k in range(len(SHAPES)))
        return Impedance(self.port(poses), SHAPES, values, slope)

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """By its columns"""
        columns = motions.changed_by(self.impedance(motions.poses, np.zeros(len(SHAPES))))
        [(nats, psi)] = gain(columns, self.sd)
        return (Start(self, psi, nats),)

    def vanishing(self, psi: np.ndarray) -> np.ndarray:
        """See `Operator.vanishing`."""
        return -psi


@dataclass(frozen=True)
class BetweenLinks(LinkSpring):
    """A cable, a strut, a balancer."""

    kind = "between_links"

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        return f"Something joins {self.at.replace('-', ' and ')}: a cable, a hose, a balancer."


@dataclass(frozen=True)
class GroundContact(LinkSpring):
    """Something outside that touches a link."""

    kind = "ground_contact"

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        return f"Something outside holds or touches {self.at}: a cable, a fence, a support."
