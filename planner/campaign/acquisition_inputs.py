"""A campaign's model as acquisitions see it: what is open, and what matters."""

from typing import TYPE_CHECKING

import numpy as np

from planner.campaign.cell import Cell
from planner.design.frequency_posterior import FrequencyOutputs, Poses, Target
from planner.design.parameter_sensitivity import FrfNoise, UncertainParameters
from planner.fit.posterior import RobotBelief

if TYPE_CHECKING:
    from planner.campaign.model import Model

# The first of the candidates (a Sobol prefix: evenly spread), which stand for the workspace, and
# whose information about parameters is worked out.
MOST_INFORMED = 200


def uncertain_parameters(model: "Model") -> UncertainParameters | None:
    """The simulation's parameters as measured so far; None where it does not learn."""
    config, low = model.cell.config, model.low
    # One that was identified and then set aside has nothing to learn that would be believed.
    if config.fidelity.simulation != "updated" or low.nominal is None or low.rejected is not None:
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
    cell, surrogate, open_ = model.cell, model.surrogate, uncertain_parameters(model)
    candidates, simulated = cell.candidates, model.simulated_candidates
    asked = informed_candidates(cell) if informed else np.arange(len(candidates.q))
    x, inputs = candidates.features[asked], surrogate.frequency_inputs(simulated)[asked]
    if open_ is None:
        poses, covariance = Poses.plain(x, inputs), None
    else:
        poses = open_.poses(x, inputs, candidates.q[asked], simulated[asked], informed)
        covariance = open_.covariance
    workspace = poses[: min(MOST_INFORMED, cell.spread)]
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
    said, x, open_ = model.low.simulate(q), model.cell.features(q), uncertain_parameters(model)
    inputs = model.surrogate.frequency_inputs(said)
    poses = open_.poses(x, inputs, q, said, False) if open_ else Poses.plain(x, inputs)
    return poses, said.frequency_hz
