"""Identification of a robot from FRFs of several poses: what is stated, and what that lacks."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from planner.dynamics.simulation import Simulation
from planner.effects.parameters import CAD_INERTIAS, Priors
from planner.effects.table import EffectLibrary
from planner.errors import InputError
from planner.fit.fitted import FitRecord
from planner.fit.identified_robot import IdentifiedRobot
from planner.fit.misfit import FrfMisfit
from planner.fit.search import Search
from planner.fit.structure import RobotPrior
from planner.frf.frf import Frf
from planner.measurement.nuisances import Tolerances

EXACT = 1e-6  # relative sd of inertias that are taken for exact
TOO_SOFT = (
    "The springs of robot.toml are far too soft to carry the robot's weight where it was measured; "
    "correct their stiffness (N·m/rad), the masses or gravity."
)


def identify(
    frfs: Sequence[Frf],
    q: np.ndarray,
    simulation: Simulation,
    priors: Priors = CAD_INERTIAS,
    *,
    band_hz: tuple[float, float] | None = None,
    tolerances: Tolerances | None = None,
    extend: bool = True,
    warm: FitRecord | None = None,
    on_step: Callable[[str], None] = lambda _: None,
) -> IdentifiedRobot:
    """Springs and inertias that explain FRFs at poses q (n, dof) in rad, one row an FRF matrix.

    Where what robot.toml states does not explain them, and `extend`, the effects that do are looked
    for (`Search`); from those of a `warm` record, if that is given. `band_hz` is robot.toml's
    unless given, `tolerances` what it says of hits, chain and readback. Raises InputError where
    FRFs and poses do not fit together, or springs as stated do not carry the weight.
    """
    q, robot = np.atleast_2d(np.asarray(q, dtype=float)), simulation.robot
    dof = len(robot.joint_names)
    if not frfs or q.shape != (len(frfs), dof) or not np.all(np.isfinite(q)):
        raise InputError(
            f"{len(frfs)} FRF matrices and joint angles of shape {q.shape} do not fit together; "
            f"give {dof} finite angles for each of at least one."
        )
    tolerances = tolerances or Tolerances.of(robot.config, robot.joints.slides)
    prior, band = robot_prior(simulation, priors), band_hz or robot.config.band_hz
    search = Search(prior, tuple(frfs), q, band, tolerances, on_step, extend=extend)
    stated = prior.stated()
    if not FrfMisfit(stated, search.data(1), tolerances).possible(stated.mean):
        raise InputError(TOO_SOFT)
    return IdentifiedRobot.of(search.found(warm))


def robot_prior(simulation: Simulation, priors: Priors) -> RobotPrior:
    """What is known of a robot before, its inertias exactly where priors leave them alone."""
    if not priors.inertial:
        priors = replace(priors, mass=EXACT, inertia=EXACT, com_m=EXACT)
    return RobotPrior(EffectLibrary.of(simulation, priors))
