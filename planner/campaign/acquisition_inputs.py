"""A campaign's model as acquisitions see it: what is open, what matters, if a cut is stable."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from scipy.stats import norm

from planner.campaign.cell import Cell
from planner.design.acquisitions import share_left, stability, with_margins
from planner.design.frequency_posterior import FrequencyOutputs, Margins, Poses, Target
from planner.design.parameter_sensitivity import FrfNoise, OpenParameters
from planner.design.propose import WORKSPACE_POSES
from planner.effects.parameters import parametrise
from planner.errors import InputError
from planner.frf.synthesis import frequency_lines
from planner.inference.block_diagonal import block_diagonal
from planner.milling.cut import cuts_at
from planner.milling.cutter_frf import of_accelerance
from planner.milling.path import PoseDecision, decide
from planner.milling.structure import of_frf

if TYPE_CHECKING:
    from planner.campaign.model import Model

# The first of the candidates, evenly spread, whose information about parameters is worked out.
MOST_INFORMED = 200
POSES = 16  # of the workspace at which a cut is looked at, where no path is given
AHEAD = 8  # measurements that are looked ahead
NEAR = 0.05  # relative: how far a fitted mode may be from a label's frequency to be that mode


def open_parameters(model: "Model") -> OpenParameters | None:
    """The simulation's parameters as measured so far; None where it does not learn."""
    config, low = model.cell.config, model.low
    # One that was identified and then set aside has nothing to learn that would be believed.
    if config.fidelity.simulation != "updated" or low.nominal is None or low.suspect is not None:
        return None
    band, learned = config.modes.band_hz, low.learned
    noise = model.frf_noise or FrfNoise.of((), band, 1.0)
    if learned is None:
        p = parametrise(low.nominal, low.priors)
        known = block_diagonal(p.covariance, np.eye(len(p.nuisances)))
        return OpenParameters(low.nominal, p, known, noise, band)
    p, found = parametrise(learned.structure.simulation, learned.priors), learned.identified
    return OpenParameters(found.simulation, p, found.covariance, noise, band)


def informed_candidates(cell: Cell) -> np.ndarray:
    """Indices of the candidates whose information about parameters is asked for; own ones too."""
    own = np.arange(cell.spread, len(cell.candidates.q))
    return np.concatenate([np.arange(min(cell.spread, MOST_INFORMED)), own])


def outlook(model: "Model", informed: bool) -> tuple[FrequencyOutputs, Poses]:
    """Posterior over the workspace (and the goal), and candidates as poses.

    `informed`: the poses are those of `informed_candidates`, with what they tell of parameters.
    """
    cell, surrogate, open_ = model.cell, model.surrogate, open_parameters(model)
    candidates, simulated = cell.candidates, model.simulated_candidates
    asked = informed_candidates(cell) if informed else np.arange(len(candidates.q))
    x, inputs = candidates.features[asked], surrogate.frequency_inputs(simulated)[asked]
    if open_ is None:
        poses, covariance = Poses.plain(x, inputs), None
    else:
        poses = open_.poses(x, inputs, candidates.q[asked], simulated[asked], informed)
        covariance = open_.covariance
    workspace = poses[: min(WORKSPACE_POSES, MOST_INFORMED, cell.spread)]
    weights = cell.config.acquisition.mode_weights
    target = Target.evenly(workspace, None if weights is None else np.array(weights))
    return FrequencyOutputs.of(surrogate, target, _goal(model, target), covariance), poses


def _goal(model: "Model", workspace: Target) -> Target:
    """What [goal] names: poses, and the modes that lie in a band there."""
    table, poses = model.cell.config.goal, workspace.poses
    hertz = model.simulated_candidates.frequency_hz[: len(poses)]
    if table.joints_deg is not None:
        poses, hertz = poses_at(model, model.cell.robot.joints.internal(table.joints_deg))
    importance = np.tile(workspace.importance.sum(axis=0), (len(poses), 1))
    if table.band_hz is not None:
        with np.errstate(invalid="ignore"):
            inside = (hertz >= table.band_hz[0]) & (hertz <= table.band_hz[1])
        importance = importance * (inside if inside.any() else 1.0)
    return Target(poses, importance / importance.sum())


def poses_at(model: "Model", q: np.ndarray) -> tuple[Poses, np.ndarray]:
    """Poses q (n, dof) in rad as targets, and their simulated frequencies (n, k) in Hz."""
    said, x, open_ = model.low.simulate(q), model.cell.features(q), open_parameters(model)
    inputs = model.surrogate.frequency_inputs(said)
    poses = open_.poses(x, inputs, q, said, False) if open_ else Poses.plain(x, inputs)
    return poses, said.frequency_hz


@dataclass(frozen=True, eq=False)
class Decision:
    """At poses q (u, dof) in rad: what is known of the cut's stability."""

    q: np.ndarray
    poses: tuple[PoseDecision, ...]

    @property
    def probability(self) -> np.ndarray:
        """(u,) of being stable."""
        return np.array([pose.probability for pose in self.poses])

    @property
    def certainty(self) -> np.ndarray:
        """(u,) probability of the likelier answer."""
        p = self.probability
        return np.maximum(p, 1 - p)

    def sure(self, probability: float) -> bool:
        """Whether each pose's answer is right with at least this probability."""
        return bool(np.all(self.certainty >= probability))

    def shrunk(self, share: np.ndarray, probability: float) -> bool:
        """Whether it were sure if of the margins' variances these shares (u,) were left."""
        size = [abs(pose.margin) / pose.sd for pose in self.poses] / np.sqrt(share)
        return bool(np.min(norm.cdf(size)) >= probability)


def decided(model: "Model") -> Decision | None:
    """At the poses of the path, or of the workspace; None where no cut is named."""
    cell = model.cell
    table, cut = cell.config.cut, cell.cut
    if table is msgspec.UNSET or cut is None:
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
    found = np.zeros(len(expected_hz))
    for k, hertz in enumerate(expected_hz):
        off = np.abs(pose.frequency_hz / hertz - 1)
        nearest = int(np.argmin(off))
        if off[nearest] < NEAR:
            found[k] = pose.slope[nearest]
    # Where no label is known to matter, all do.
    return found if found.any() else np.ones_like(found)


def measurements_left(model: "Model") -> int | None:
    """How many more poses to measure until the decision is sure; None: more than looked ahead.

    By the acquisition's own choice of them, if each margin's variance falls as that of the
    frequencies on which it hangs.
    """
    decision = model.decision
    probability = model.cell.config.stop.probability
    if decision is None:
        return None
    if decision.sure(probability):
        return 0
    outputs, poses = model.deciding
    for count in range(1, AHEAD + 1):
        best = int(np.argmax(stability(outputs, poses)))
        outputs = outputs.planning(poses.one(best))
        if decision.shrunk(share_left(outputs), probability):
            return count
    return None
