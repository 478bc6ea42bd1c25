"""Which of the poses measured so far is wrong, where they do not agree together."""

from collections.abc import Container, Sequence
from dataclasses import dataclass

import numpy as np

from planner.campaign.alternatives import (
    LOG_ODDS,
    Alternative,
    StatedHits,
    flipped_signs,
    joint_offsets,
)
from planner.fit.expected import ExpectedFrfs
from planner.fit.fitted import StructureFit, explains_all
from planner.fit.identified_robot import PLACED
from planner.fit.posterior import RobotPosterior
from planner.fit.search import Search
from planner.frf.frf import Frf
from planner.inference.parallel import parallel_map
from planner.recording.joints import JointUnits

# Measured poses before which another structure may explain what nothing known fits: until then
# the simulation alone tells of the chain, as before the first; no joint is looked for elsewhere.
SURE = 2


@dataclass(frozen=True, eq=False)
class PosesTogether:
    """Hits of poses q (n, dof) in rad, the new one last, that do not agree: which one is wrong?

    Each is held against what the others alone let expect, and all are fitted with each angle that
    they fit better: by all springs that there may be and the other effects that `found` has, which
    is quick.
    """

    found: RobotPosterior
    band_hz: tuple[float, float]
    joints: JointUnits
    q: np.ndarray
    frfs: tuple[Frf, ...]

    def wrong(
        self, likely: Sequence[Sequence[Alternative]], answered: Container[int] = ()
    ) -> tuple[int, Alternative] | None:
        """The earlier pose, and its angle, with which all is explained, and likelier than as
        stated, or with any angle of the new pose.

        Of the first ones, that is: what came later was asked about when it came. `likely` are each
        pose's own alternatives; the angles of those `answered` are right.
        """
        new = len(self.q) - 1
        tried = [*(i for i in range(min(new, PLACED)) if i not in answered), new]
        angles = parallel_map(lambda i: self._angle(i, likely[i]), tried)
        found = [(i, angle) for i, angle in zip(tried, angles, strict=True) if angle is not None]
        if not any(i < new for i, _ in found):
            return None
        (stated, _), *each = parallel_map(self._evidence, [None, *found])
        (most, explains, (i, angle)), *others = sorted(
            ((*one, which) for one, which in zip(each, found, strict=True)),
            key=lambda one: one[0],
            reverse=True,
        )
        least = max([stated, *(value for value, _, (k, _) in others if k == new)])
        return (i, angle) if i < new and explains and most > least + LOG_ODDS else None

    def _fit(self, q: np.ndarray, poses: Sequence[int]) -> StructureFit:
        """Of some of the poses, at q (n, dof)."""
        frfs, p = tuple(self.frfs[k] for k in poses), self.found
        prior = p.structure.prior
        return Search(prior, frfs, q[list(poses)], self.band_hz, p.tolerances).freed(p)

    def _angle(self, i: int, likely: Sequence[Alternative]) -> Alternative | None:
        """Of one pose, by which it fits the others better; None where none does."""
        others = [k for k in range(len(self.q)) if k != i]
        expected = ExpectedFrfs(RobotPosterior.of(self._fit(self.q, others)), self.band_hz)
        stated = tuple(self.joints.shown(self.q[i]))
        hits = StatedHits(expected, self.q[i], self.frfs[i], len(others) >= PLACED)
        typed = [*likely, *flipped_signs(self.joints, stated)]
        if len(others) >= SURE and not hits.agree():
            typed += joint_offsets(self.joints, expected, self.frfs[i], stated)
        return hits.best_alternative(typed)

    def _evidence(self, one: tuple[int, Alternative] | None) -> tuple[float, bool]:
        """Of all together, with one pose's other angle, and whether that explains them."""
        q, rarer = self.q.copy(), 0.0
        if one is not None:
            q[one[0]], rarer = one[1].q, one[1].rarer
        found = self._fit(q, range(len(q)))
        return found.evidence - rarer, explains_all(found)
