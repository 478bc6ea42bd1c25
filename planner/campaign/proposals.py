"""Where to measure next, as the log records it; what acquisitions see of a campaign's model."""

from dataclasses import replace
from itertools import count as counted
from typing import TYPE_CHECKING

import numpy as np

from planner.campaign.cell import Cell
from planner.campaign.events import Proposal
from planner.campaign.state import CampaignState
from planner.design.cost import axis_shares
from planner.design.frequency_posterior import FrequencyOutputs, Poses, Target
from planner.design.parameter_sensitivity import (
    BetterPlaces,
    FrfNoise,
    UncertainParameters,
    better_places,
)
from planner.design.propose import DESCRIPTIONS, INFORMED, Pick, Travel
from planner.design.propose import propose as choose
from planner.design.space_filling import DESIGNS
from planner.dynamics.vibration import SimulatedModes
from planner.errors import NoPoseLeftError
from planner.fit.posterior import RobotBelief
from planner.words import small

if TYPE_CHECKING:
    from planner.campaign.model import Model

# Radius, in model coordinates over √d, around a pose whose neighbours are to be avoided too.
AVOIDED = 0.1
# The first of the candidates (a Sobol prefix: evenly spread), which stand for the workspace, and
# whose information about parameters is worked out.
MOST_INFORMED = 200


def propose(
    model: "Model", state: CampaignState, count: int, acquisition: str
) -> tuple[Proposal, ...]:
    """The next poses to measure; NoPoseLeftError when no candidate is left.

    Where drift is suspected the first of them is a measured pose that tells whether there is any.
    """
    if state.doubt is None:
        return _new_poses(model, state, count, acquisition)
    robot, (pose, hint) = model.cell.robot, state.doubt
    joints_deg = state.measurements[pose].joints_deg
    position_m = robot.forward_batch(robot.joints.internal([joints_deg]))[1][0]
    reason = f"repeat: {hint} hints at drift, and {pose} hit again tells whether the robot changed"
    again = Proposal(pose, joints_deg, _xyz(position_m), None, reason)
    return (again, *(_new_poses(model, state, count - 1, acquisition) if count > 1 else ()))


def _new_poses(
    model: "Model", state: CampaignState, count: int, acquisition: str
) -> tuple[Proposal, ...]:
    cell = model.cell
    candidates = cell.candidates
    picks = _picks(model, state, count, acquisition)
    if not picks:
        raise NoPoseLeftError(
            f"No reachable pose is left among {len(candidates.q)} candidates of the workspace; "
            f"widen [workspace] or raise candidates in campaign.toml."
        )
    joints = cell.robot.joints
    angles = [
        tuple(round(float(v), 4) for v in joints.shown(candidates.q[pick.index])) for pick in picks
    ]
    return tuple(
        Proposal(
            pose=name,
            joints_deg=joints_deg,
            position_m=_xyz(candidates.position_m[pick.index]),
            score=float(pick.score) if np.isfinite(pick.score) else None,
            reason=_reason(model, pick.index, acquisition),
            hits=tuple("xyz"[axis] for axis in pick.axes),
            minutes=round(pick.minutes, 2) if np.isfinite(pick.minutes) else None,
        )
        for pick, joints_deg, name in zip(picks, angles, _names(state, angles), strict=True)
    )


def _names(state: CampaignState, angles: list[tuple[float, ...]]) -> list[str]:
    """Names of proposed poses: the one that a pose was proposed under before, else a new one.

    A new one is of no other pose, also of none that was measured without a proposal.
    """
    taken = {*(m.pose for m in state.measured), *state.held}
    known = {p.joints_deg: name for name, p in state.proposals.items() if name not in taken}
    every = (f"P{number:03d}" for number in counted(state.proposals_made + 1))
    given = {*state.proposals, *state.measurements, *state.held}
    new = (name for name in every if name not in given)
    return [known.get(joints_deg) or next(new) for joints_deg in angles]


def _picks(model: "Model", state: CampaignState, count: int, acquisition: str) -> tuple[Pick, ...]:
    cell = model.cell
    joints, x = cell.robot.joints, cell.candidates.features
    stood = [m.joints_deg for m in state.measurements.values()]
    at = joints.internal(stood[-1]) if stood else None
    taken = [m.joints_deg for m in state.measured]
    taken += [m.joints_deg for m in state.held.values()]
    shares = None
    if cell.config.acquisition.hit_axes == "best" and acquisition not in DESIGNS:
        shares = axis_shares(model.low.simulate(cell.candidates.q).residue)
    travel = Travel(cell.cost, cell.candidates.q, at, shares)
    taken += [state.proposals[pose].joints_deg for pose in state.skipped]
    allowed = cell.allowed
    for pose in state.avoided:
        there = cell.features(joints.internal([state.proposals[pose].joints_deg]))
        allowed = allowed & (np.linalg.norm(x - there, axis=1) > AVOIDED * np.sqrt(x.shape[1]))
    asked, seen = np.arange(len(x)), None
    if acquisition in INFORMED:
        asked = informed_candidates(cell)
        seen = model.deciding if acquisition == "stability" else model.informed
    elif acquisition not in DESIGNS:
        seen = model.acquisition_inputs
    exclude = cell.features(joints.internal(taken)) if taken else x[:0]
    free = travel.among(asked), allowed[asked]
    picks = choose(acquisition, x[asked], count, exclude, state.events, seen, *free)
    return tuple(replace(pick, index=int(asked[pick.index])) for pick in picks)


def places_for(model: "Model", state: CampaignState, proposal: Proposal) -> BetterPlaces | None:
    """Where one more sensor, or another point to hit, would tell more at a proposed pose.

    None where nothing would, or the simulation does not learn.
    """
    cell = model.cell
    # Before the first hits nobody knows what will be open.
    open_ = uncertain_parameters(model) if model.labelled else None
    if open_ is None or not cell.robot.points.axes:
        return None
    joints = cell.robot.joints
    q = joints.internal([proposal.joints_deg])
    at, _ = poses_at(model, q)
    cost, taken = cell.cost, [m.joints_deg for m in state.measurements.values()]
    travel = cost.travel(q, joints.internal(taken[-1]) if taken else None)
    pose = proposal.pose, at, q[0]
    target = cell.config.stop.frequency_sd_percent
    return better_places(open_, model.acquisition_inputs[0], pose, cost, float(travel[0]), target)


def _xyz(position_m: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (round(float(v), 5) for v in position_m)
    return x, y, z


def _reason(model: "Model", index: int, acquisition: str) -> str:
    hz, sd = (row[0] for row in model.frequencies(model.cell.candidates.q[[index]]))
    k = int(np.argmax(sd / hz))
    percent = small(100 * sd[k] / hz[k], ".1f")
    text = f"mode {k + 1} is expected at {hz[k]:.2f} Hz ± {percent} %"
    if model.labelled:
        x = model.cell.features(np.array([pose.q for pose in model.labelled]))
        distance = np.linalg.norm(x - model.cell.candidates.features[index], axis=1)
        near = model.labelled[int(np.argmin(distance))].pose
        text += f" here, nearest measured pose {near}"
    return f"{DESCRIPTIONS[acquisition]} ({acquisition.replace('_', ' ')}); {text}"


def uncertain_parameters(model: "Model") -> UncertainParameters | None:
    """The simulation's parameters as measured so far; None where it does not learn."""
    config, low = model.cell.config, model.low
    # One that was identified and then set aside has nothing to learn that would be believed.
    if config.fidelity.simulation != "updated" or low.rejected is not None:
        return None
    noise = model.frf_noise or FrfNoise.of((), config.modes.band_hz, 1.0)
    fit = low.identified_robot  # None: before it is measured
    known = fit.posterior if fit else RobotBelief.stated(low.prior, low.tolerances)
    return UncertainParameters(known, noise, config.modes.band_hz)


def informed_candidates(cell: Cell) -> np.ndarray:
    """Indices of the candidates whose information about parameters is asked for; own ones too."""
    own = np.arange(cell.spread, len(cell.candidates.q))
    return np.concatenate([np.arange(min(cell.spread, MOST_INFORMED)), own])


def acquisition_inputs(model: "Model", informed: bool) -> tuple[FrequencyOutputs, Poses]:
    """Posterior over the workspace (and the goal), and candidates as poses.

    `informed`: the poses are those of `informed_candidates`, with what they tell of parameters.
    """
    cell, open_ = model.cell, uncertain_parameters(model)
    candidates, simulated = cell.candidates, model.simulated_candidates
    asked = informed_candidates(cell) if informed else np.arange(len(candidates.q))
    there = candidates.features[asked], candidates.q[asked], simulated[asked]
    poses, covariance = _poses(model, *there, informed), open_.covariance if open_ else None
    workspace = poses[: min(MOST_INFORMED, cell.spread)]
    weights = cell.config.acquisition.mode_weights
    target = Target.evenly(workspace, None if weights is None else np.array(weights))
    return FrequencyOutputs.of(model.surrogate, target, _goal(model, target), covariance), poses


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
    said = model.low.simulate(q)
    return _poses(model, model.cell.features(q), q, said), said.frequency_hz


def _poses(
    model: "Model", x: np.ndarray, q: np.ndarray, said: SimulatedModes, informed: bool = False
) -> Poses:
    """At features x (n, d), where the simulation says `said`."""
    inputs, open_ = model.surrogate.frequency_inputs(said), uncertain_parameters(model)
    return open_.poses(x, inputs, q, said, informed) if open_ else Poses.plain(x, inputs)
