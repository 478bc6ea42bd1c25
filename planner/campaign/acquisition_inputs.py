"""A campaign's model as acquisitions see it: what is open, what matters, what measuring costs."""

import numpy as np

from planner.campaign.cell import Cell
from planner.campaign.low_fidelity import LowFidelity
from planner.design.cost import Cost
from planner.design.frequency_posterior import FrequencyOutputs, Poses, Target
from planner.design.parameter_sensitivity import FrfNoise, OpenParameters
from planner.design.propose import WORKSPACE_POSES
from planner.dynamics.vibration import SimulatedModes
from planner.effects.parameters import parametrise
from planner.inference.block_diagonal import block_diagonal
from planner.surrogate.modal_surrogate import Surrogate

# The first of the candidates, evenly spread, whose information about parameters is worked out.
MOST_INFORMED = 200


def open_parameters(cell: Cell, low: LowFidelity, noise: FrfNoise | None) -> OpenParameters | None:
    """The simulation's parameters as measured so far; None where it does not learn."""
    nominal, learned = low.nominal, low.learned
    # One that was identified and then set aside has nothing to learn that would be believed.
    if cell.config.fidelity.simulation != "updated" or nominal is None or low.suspect is not None:
        return None
    band = cell.config.modes.band_hz
    noise = noise or FrfNoise.of((), band, 1.0)
    if learned is None:
        p = parametrise(nominal, low.priors)
        known = block_diagonal(p.covariance, np.eye(len(p.nuisances)))
        return OpenParameters(nominal, p, known, noise, band)
    p, found = parametrise(learned.structure.simulation, learned.priors), learned.identified
    return OpenParameters(found.simulation, p, found.covariance, noise, band)


def informed_candidates(cell: Cell) -> np.ndarray:
    """Indices of the candidates whose information about parameters is asked for; own ones too."""
    spread = cell.spread
    own = np.arange(spread, len(cell.candidates.q))
    return np.concatenate([np.arange(min(spread, MOST_INFORMED)), own])


def outlook(
    cell: Cell,
    low: LowFidelity,
    surrogate: Surrogate,
    simulated: SimulatedModes,
    noise: FrfNoise | None,
    informed: bool,
) -> tuple[FrequencyOutputs, Poses]:
    """Posterior over the workspace (and the goal), and candidates as poses.

    `simulated` is what the low fidelity says at the candidates, `noise` that of FRFs so far.
    `informed`: the poses are those of `informed_candidates`, with what they tell of parameters.
    """
    candidates = cell.candidates
    inputs = surrogate.frequency_inputs(simulated)
    open_ = open_parameters(cell, low, noise)
    asked = informed_candidates(cell) if informed else np.arange(len(candidates.q))
    if open_ is None:
        poses, covariance = Poses.plain(candidates.features[asked], inputs[asked]), None
    else:
        poses = open_.poses(
            candidates.features[asked],
            inputs[asked],
            candidates.q[asked],
            simulated[asked],
            informed,
        )
        covariance = open_.covariance
    workspace = poses[: min(WORKSPACE_POSES, MOST_INFORMED, cell.spread)]
    weights = cell.config.acquisition.mode_weights
    target = Target.evenly(workspace, None if weights is None else np.array(weights))
    goal = _goal(cell, low, surrogate, open_, target, simulated)
    return FrequencyOutputs.of(surrogate, target, goal, covariance), poses


def _goal(
    cell: Cell,
    low: LowFidelity,
    surrogate: Surrogate,
    open_: OpenParameters | None,
    workspace: Target,
    simulated: SimulatedModes,
) -> Target:
    """What [goal] names: poses, and the modes that lie in a band there."""
    table = cell.config.goal
    poses, hertz = workspace.poses, simulated.frequency_hz[: len(workspace.poses)]
    if table.joints_deg is not None:
        q = cell.robot.joints.internal(table.joints_deg)
        poses, hertz = poses_at(cell, low, surrogate, open_, q)
    importance = np.tile(workspace.importance.sum(axis=0), (len(poses), 1))
    if table.band_hz is not None:
        with np.errstate(invalid="ignore"):
            inside = (hertz >= table.band_hz[0]) & (hertz <= table.band_hz[1])
        importance = importance * (inside if inside.any() else 1.0)
    return Target(poses, importance / importance.sum())


def poses_at(
    cell: Cell, low: LowFidelity, surrogate: Surrogate, open_: OpenParameters | None, q: np.ndarray
) -> tuple[Poses, np.ndarray]:
    """Poses q (n, dof) in rad as targets, and their simulated frequencies (n, k) in Hz."""
    said, x = low.simulate(q), cell.features(q)
    inputs = surrogate.frequency_inputs(said)
    poses = open_.poses(x, inputs, q, said, False) if open_ else Poses.plain(x, inputs)
    return poses, said.frequency_hz


def cost_of(cell: Cell) -> Cost:
    """What campaign.toml's [cost] makes of the robot's speeds."""
    table = cell.config.cost
    speed = cell.robot.velocity_rad_s * table.speed_share
    # A URDF may leave a speed out: a slow one is assumed, in rad/s or m/s.
    slow = np.where(cell.robot.joints.slides, 0.1, 0.5)
    speed = np.where(np.isfinite(speed) & (speed > 0), speed, slow)
    per_hit, per_sensor = table.minutes_per_hit, table.minutes_per_sensor
    return Cost(speed, table.minutes_per_pose, per_hit, table.hits_per_axis, per_sensor)
