"""Whether a cut is stable, as a campaign's model knows it, and what would tell it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import norm

from planner.campaign.proposals import poses_at
from planner.design.acquisitions import share_left, stability, with_margins
from planner.design.frequency_posterior import FrequencyOutputs, Margins
from planner.errors import InputError
from planner.frf.synthesis import frequency_lines
from planner.milling.cut import cuts_at
from planner.milling.cutter_frf import of_accelerance
from planner.milling.path import PoseDecision, decide
from planner.milling.structure import of_frf

if TYPE_CHECKING:
    from planner.campaign.model import Model

POSES = 16  # of the workspace at which a cut is looked at, where no path is given
AHEAD = 8  # measurements that are looked ahead
NEAR = 0.05  # relative: how far a fitted mode may be from a label's frequency to be that mode


@dataclass(frozen=True, eq=False)
class Decision:
    """At poses q (u, dof) in rad: what is known of the cut's stability."""

    q: np.ndarray
    poses: tuple[PoseDecision, ...]

    @property
    def probability(self) -> np.ndarray:
        """(u,) of being stable."""
        return np.array([pose.probability for pose in self.poses])

    def sure(self, probability: float) -> bool:
        """Whether each pose's answer is right with at least this probability."""
        p = self.probability
        return bool(np.all(np.maximum(p, 1 - p) >= probability))

    def shrunk(self, share: np.ndarray, probability: float) -> bool:
        """Whether it were sure if of the margins' variances these shares (u,) were left."""
        size = [abs(pose.margin) / pose.sd for pose in self.poses] / np.sqrt(share)
        return bool(np.min(norm.cdf(size)) >= probability)


def cut_decision(model: "Model") -> Decision | None:
    """At the poses of the path, or of the workspace; None where no cut is named."""
    cell = model.cell
    table, cut = cell.config.cut, cell.cut
    if not table or cut is None:
        return None
    if table.joints_deg is not None:
        q = cell.robot.joints.internal(table.joints_deg)
    else:
        q = cell.candidates.q[: min(POSES, cell.spread)]
    lines = frequency_lines(cell.config.modes.band_hz)
    mean, sd = model.frf(q, lines)
    names = [f"pose {i + 1} of the cut" for i in range(len(q))]
    cuts = cuts_at(cut, *cell.robot.forward_batch(q), names)
    found = []
    for at, name, one, unsure in zip(cuts, names, mean, sd, strict=True):
        structure = of_frf(of_accelerance(name, lines, one, unsure), at)
        found.append(decide(structure, at, table.speed_rpm, table.depth_m))
    return Decision(q, tuple(found))


def deciding_outputs(model: "Model", outputs: FrequencyOutputs) -> FrequencyOutputs:
    """The posterior, asked for the margins of the decision and the modes on which they hang."""
    decision = model.decision
    if decision is None:
        raise InputError(
            'Acquisition "stability" needs [cut] in campaign.toml, with speed_rpm and depth_m.'
        )
    poses, _ = poses_at(model, decision.q)
    expected = model.predict(decision.q).frequency_hz
    found = decision.poses
    margins = Margins(
        poses,
        np.array([pose.margin for pose in found]),
        np.array([pose.sd for pose in found]),
        np.array([_slope(pose, hertz) for pose, hertz in zip(found, expected, strict=True)]),
        np.zeros(len(found)),
    )
    return with_margins(outputs, margins)


def _slope(pose: PoseDecision, expected_hz: np.ndarray) -> np.ndarray:
    """(k,) of each label: the margin's change per relative change of its frequency."""
    off = np.abs(pose.frequency_hz / expected_hz[:, None] - 1)
    found = np.where(off.min(axis=1) < NEAR, pose.slope[off.argmin(axis=1)], 0.0)
    # Where no label is known to matter, all do.
    return found if found.any() else np.ones_like(found)


def measurements_left(model: "Model") -> int | None:
    """How many more poses to measure until the decision is sure; None: more than looked ahead.

    By the acquisition's own choice of them, if each margin's variance falls as that of the
    frequencies on which it hangs.
    """
    decision, probability = model.decision, model.cell.config.stop.probability
    assert decision is not None
    if decision.sure(probability):
        return 0
    outputs, poses = model.deciding
    for count in range(1, AHEAD + 1):
        best = int(np.argmax(stability(outputs, poses)))
        outputs = outputs.planning(poses[[best]])
        if decision.shrunk(share_left(outputs), probability):
            return count
    return None
