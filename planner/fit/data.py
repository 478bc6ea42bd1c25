"""FRFs of several poses on chosen lines, and the robot's matrices there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.effects.effect import PosedBodies
from planner.fit.structure import Levers, RobotPrior, RobotStructure
from planner.fit.weights import Weights
from planner.frf.frf import Frf
from planner.measurement.measured_frfs import Measured, common_band, matrices_at, stack
from planner.robot.elastic_model import AngleSlopes, ElasticModel, Matrices

SMALLEST = 1e-4  # relative sd of any value: no record is more exact


@dataclass(frozen=True, eq=False)
class FrfData:
    """What was measured at q (n, dof) in rad, and matrices with every spring that there may be."""

    q: np.ndarray
    measured: Measured
    matrices: Matrices
    jacobians: np.ndarray
    order: np.ndarray | None = None  # nothing changes in the course of time
    off: np.ndarray | float = 0.0  # (n, dof), rad or m: joints stood so far off q
    # (n,): a visit's own share of the chain's tolerances, in multiples of `visit_chain`
    multiples: np.ndarray | float = 1.0
    levers: Levers = ()  # how springs shift others as they turn

    @classmethod
    def of(
        cls,
        prior: RobotPrior,
        frfs: Sequence[Frf],
        q: np.ndarray,
        band_hz: tuple[float, float],
        lines: int,
        order: np.ndarray | None = None,
    ) -> "FrfData":
        """On so many lines a pose, closer together where half-power bands are narrow.

        `order` (n,) is how much of the campaign was over, 0 to 1, when each was hit.
        """
        seen = common_band(frfs, band_hz)
        measured = stack(frfs, seen, lines, SMALLEST, geometric=True)
        elastic = prior.carried
        matrices = matrices_at(elastic, q, frfs)
        return cls(q, measured, matrices, elastic.body_jacobians(q), order)

    @cached_property
    def weights(self) -> Weights:
        """How much what was measured counts."""
        return Weights(self.measured)

    @property
    def sensors(self) -> int:
        """How many sensors heard the hits."""
        return self.measured.accelerance.shape[1] // 3

    def poses(self, structure: RobotStructure) -> PosedBodies:
        """As effects see them."""
        springs = list(structure.springs)
        bodies = structure.prior.effect_library.simulation.elastic.bodies
        jacobians = self.jacobians[..., springs]
        order = np.zeros(len(self.q)) if self.order is None else self.order
        stood, s = self.q + self.off, self.measured.s
        return PosedBodies(stood, s, jacobians, bodies, structure.springs, order, self.q)

    def stood(self, off: np.ndarray, elastic: ElasticModel) -> "FrfData":
        """The same where joints stood off (n, dof) in rad or m beside their readback; kept for the
        latest `off`."""
        key = off.tobytes()
        if key not in self._stood:
            self._stood.clear()
            self._stood[key] = self._moved(off, elastic)
        return self._stood[key]

    @cached_property
    def _stood(self) -> dict[bytes, "FrfData"]:
        return {}

    def __getstate__(self) -> Mapping[str, object]:
        """For another process, which finds that itself."""
        return {name: value for name, value in vars(self).items() if name != "_stood"}

    def _moved(self, off: np.ndarray, elastic: ElasticModel) -> "FrfData":
        rows = np.flatnonzero(np.any(off != 0, axis=1))
        q, measured = (self.q + off)[rows], self.measured.at(rows)
        found = measured.loaded(
            elastic.matrices(q, layout=measured.layout, slopes=True), elastic.robot
        )
        jacobians = self.jacobians.copy()
        jacobians[rows] = elastic.body_jacobians(q)
        other = replace(
            self, matrices=self.matrices.replaced(rows, found), jacobians=jacobians, off=off
        )
        vars(other)["weights"] = self.weights
        return other

    def levered(self, levers: Levers) -> "FrfData":
        """The same where springs shift others as they turn: numbers of slide and turn, m/rad."""
        to = np.eye(self.matrices.mass.shape[-1])
        for slide, turn, lever in levers:
            to[slide, turn] = lever
        moved = in_coordinates(self.matrices, to), self.jacobians @ to
        other = replace(self, matrices=moved[0], jacobians=moved[1], levers=levers)
        vars(other).update((n, v) for n, v in vars(self).items() if n == "weights")
        return other

    def at(self, poses: np.ndarray) -> "FrfData":
        """Of some of the poses, by their numbers."""
        return FrfData(
            self.q[poses],
            self.measured.at(poses),
            self.matrices[poses],
            self.jacobians[poses],
            None if self.order is None else self.order[poses],
            self.off if isinstance(self.off, float) else self.off[poses],
            self.multiples if isinstance(self.multiples, float) else self.multiples[poses],
            self.levers,
        )


def in_coordinates(m: Matrices, to: np.ndarray) -> Matrices:
    """Matrices of other coordinates, of which `to` (e, e) tells how they move those of `m`."""
    by = m.by_angle
    if by is not None:
        by = AngleSlopes(to.T @ by.mass @ to, by.hit @ to, by.sensor @ to, by.stiffness)
    turned = {name: getattr(m, name) @ to for name in ("hit", "sensor", "hit_turn", "sensor_turn")}
    mass, geometric = to.T @ m.mass @ to, to.T @ m.geometric @ to
    return replace(m, mass=mass, geometric=geometric, by_angle=by, **turned)


def among(m: Matrices, springs: Sequence[int]) -> Matrices:
    """Matrices of some of the springs, by their numbers."""
    some = list(springs)
    square = np.ix_(range(len(m.mass)), some, some)
    by = m.by_angle
    if by is not None:
        by = AngleSlopes(
            by.mass[:, :, some][:, :, :, some],
            by.hit[..., some],
            by.sensor[..., some],
            by.stiffness[..., some],
        )
    return replace(
        m,
        mass=m.mass[square],
        hit=m.hit[..., some],
        sensor=m.sensor[..., some],
        geometric=m.geometric[square],
        hit_turn=m.hit_turn[..., some],
        sensor_turn=m.sensor_turn[..., some],
        by_angle=by,
    )
