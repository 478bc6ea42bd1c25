"""Identification of a robot so soft that gravity is stronger than some of the springs tried."""

from pathlib import Path

import numpy as np
import pytest

from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Priors, parametrise
from planner.errors import InputError
from planner.frf.estimator import estimate
from planner.frf.frf import Frf
from planner.identification.effort import QUICK
from planner.identification.identify import identify
from planner.identification.objective import Objective, stands
from planner.identification.staged_problem import StagedProblem
from planner.measurement.agreement import fit_similarity
from planner.measurement.measured_frfs import stack
from planner.recording.records import Hit
from planner.robot.robot import Robot
from planner.truth.deviation import Deviation
from planner.truth.hits import Hammer, simulate_hit
from planner.truth.load import load_truth
from planner.truth.model import Truth
from tests.support.plain_arm import make_plain_arm

# Stretched upwards, where gravity softens most.
Q = np.deg2rad([(0, -85, 5, 0), (30, -70, -10, 40), (-20, -80, 30, -60)])
BAND_HZ = (1.0, 30.0)
SOFTER = 250.0  # of the plain arm: carries its weight with little to spare


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return make_plain_arm(tmp_path_factory.mktemp("soft"), softer=SOFTER)


@pytest.fixture(scope="module")
def frfs(arm):
    truth = load_truth(arm, Deviation(seed=2, stiffness=0.1))
    return [struck(truth, q) for q in Q]


def struck(truth: Truth, q: np.ndarray) -> Frf:
    """From hits whose records end before the decay, which a simulation has to complete."""
    rate, rng = 256.0, np.random.default_rng(0)
    hammer = Hammer(
        duration_s=0.02, sampling_rate_hz=rate, record_s=4.0, pretrigger_s=0.1, noise=0.005
    )
    made = [simulate_hit(truth, q, axis, hammer, rng) for axis in ("+x", "+y", "+z") * 2]
    hits = [
        Hit(Path(str(i)), h.axis, rate, h.force_n, h.acceleration_m_s2) for i, h in enumerate(made)
    ]
    return estimate(tuple(hits), BAND_HZ)


def test_random_starts_that_buckle_are_made_to_stand(arm, frfs):
    simulation = Simulation(Robot.load(arm))
    p = parametrise(simulation, Priors())
    matrices = simulation.elastic.matrices(Q)
    assert all(np.isfinite(frf.tail_s) for frf in frfs)
    soft = p.mean - np.log(8) * np.array([x.kind == "stiffness" for x in p.parameters])
    starts = np.exp([p.mean, soft, soft + 0.3, soft - 0.3])
    assert [stands(matrices, p.elasticity(np.log(s)).stiffness) for s in starts] == [1, 0, 0, 0]
    measured, inertias = (
        stack(frfs, BAND_HZ, 40, 0.0),
        p.inertias(simulation.elastic.body_jacobians(Q)),
    )
    objective = Objective(measured, matrices, inertias, p, logarithmic=False, free_inertia=False)
    assert [objective(np.log(s)).value < np.inf for s in starts] == [1, 0, 0, 0]
    found = identify(frfs, Q, simulation, band_hz=BAND_HZ, starts=starts)
    alone = identify(frfs, Q, simulation, band_hz=BAND_HZ, starts=starts[1:2])
    drawn = identify(frfs, Q, simulation, band_hz=BAND_HZ, starts=6, seed=3)
    for each in (found, alone, drawn):
        assert fit_similarity(each.simulation, frfs, Q, BAND_HZ).frac > 0.99
        assert stands(matrices, each.simulation.elasticity.stiffness)


def test_springs_that_could_never_carry_the_robot_are_said(tmp_path, frfs):
    simulation = Simulation(Robot.load(make_plain_arm(tmp_path, softer=1e7)))
    with pytest.raises(InputError, match="far too soft to carry the robot's weight"):
        identify(frfs, Q, simulation, band_hz=BAND_HZ, starts=1)


def test_what_buckles_just_beyond_the_prior_is_made_to_stand(arm, frfs):
    """Where the prior's edge stands and a start a little beyond it does not."""
    simulation = Simulation(Robot.load(arm))
    matrices = simulation.elastic.matrices(Q)
    softness = np.linspace(0.0, 5.0, 500)
    buckling = next(
        s for s in softness if not stands(matrices, np.exp(-s) * simulation.elasticity.stiffness)
    )
    p = parametrise(simulation, Priors(stiffness_factor=float(np.exp(buckling / 6.75))))
    problem = StagedProblem(
        tuple(frfs), Q, simulation.elastic, BAND_HZ, matrices,
        p.inertias(simulation.elastic.body_jacobians(Q)), p, None, QUICK, None, None,
    )  # fmt: skip
    springs = np.array([x.kind == "stiffness" for x in p.parameters])
    soft = p.mean - 7.5 * p.log_sd * springs
    assert not stands(matrices, p.elasticity(soft).stiffness)
    assert stands(matrices, p.elasticity(p.near(soft)).stiffness)
    assert stands(matrices, p.elasticity(problem.standing(soft)).stiffness)
