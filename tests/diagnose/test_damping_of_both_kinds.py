"""Gears damp partly like dashpots, partly by a loss factor: that is nothing to be told."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from planner.diagnosis.effects.exponential_window import ExponentialWindow
from planner.diagnosis.laws.equivalent_stiffness import System
from planner.diagnosis.laws.one_joint_response import modal
from planner.diagnosis.linear_diagnosis import Diagnosis, diagnose
from planner.diagnosis.write_explained import explained_simulation
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.measurement.truncated_decay import cut_off
from planner.robot.config import LOSS_FACTOR_BELOW
from planner.robot.robot import Robot
from tests.support.known_robots import KR10

LINES, BAND_HZ, NOISE = np.linspace(5.0, 150.0, 180), (5.0, 150.0), 0.003
Q = KR10.poses(4, seed=3)


@pytest.fixture(scope="module")
def stated(tmp_path_factory) -> Simulation:
    return Simulation(Robot.load(KR10.write(tmp_path_factory.mktemp("robot"))))


def partly_lossy(stated: Simulation, shares) -> Simulation:
    """Of each joint's damping a share is a loss factor, worth as much at 30 Hz."""
    blocks = tuple(
        msgspec.structs.replace(
            b, damping=(1 - s) * b.damping, loss_factor=s * b.damping * 60 * np.pi / b.stiffness
        )
        for b, s in zip(stated.robot.config.compliance, shares, strict=True)
    )
    config = msgspec.structs.replace(stated.robot.config, compliance=blocks)
    return Simulation(replace(stated.robot, config=config))


def seen(truth: Simulation, rate_1_s: float = 0.0) -> list[Frf]:
    """With noise, and under a window of which nobody said anything."""
    rng, nothing = np.random.default_rng(0), np.full((3, 3, len(LINES)), np.nan)
    frfs = []
    for solved in (truth.poles(q[None]) for q in Q):
        s = 2j * np.pi * LINES + rate_1_s
        h = s**2 * np.einsum("pij,pf->ijf", solved.residues[0], 1 / (s - solved.poles[0][:, None]))
        sd = NOISE * np.abs(h)
        noise = rng.standard_normal((2, *h.shape)) / np.sqrt(2)
        frfs.append(
            Frf(LINES, h + sd * (noise[0] + 1j * noise[1]), sd**2, nothing, (3,) * 3, BAND_HZ)
        )
    return frfs


def told(stated: Simulation, truth: Simulation, rate_1_s: float = 0.0) -> Diagnosis:
    """Whether the window is seen."""
    effects = ExponentialWindow.everywhere(stated)
    return diagnose(seen(truth, rate_1_s), Q, stated, effects=effects)


def test_a_spring_that_all_but_only_damps_is_fitted_as_robot_toml_takes_it(stated):
    blocks = list(stated.robot.config.compliance)
    blocks[2] = msgspec.structs.replace(blocks[2], loss_factor=6.0)
    config = msgspec.structs.replace(stated.robot.config, compliance=tuple(blocks))
    truth = Simulation(replace(stated.robot, config=config))
    found = diagnose(seen(truth), Q, stated, effects=())
    none = next(c for c in found.candidates if c.fit is not None)
    written = explained_simulation(found, none)
    assert written.elasticity.loss_factor.max() < LOSS_FACTOR_BELOW
    assert written.elasticity.loss_factor.argmax() == 2
    assert written.elasticity.loss_factor[2] > 0.9 * LOSS_FACTOR_BELOW


def test_no_window_is_named_for_a_loss_factor(stated):
    found = told(stated, partly_lossy(stated, (0.5, 0.1, 0.3, 0.0, 0.4, 0.2)))
    assert found.verdict == "consistent"
    assert found.candidates[0].probability > 0.9


def test_a_window_is_named_beside_a_loss_factor(stated):
    found = told(stated, partly_lossy(stated, (0.5, 0.1, 0.3, 0.0, 0.4, 0.2)), rate_1_s=6.0)
    first = found.candidates[0]
    assert first.places == (("exponential_window", "sensor"),)
    assert first.fit is not None
    rate, sd, _ = first.fit.parameters(found.temper)["rate"]
    assert abs(rate - 6.0) < 3 * sd + 0.1


def test_the_poles_of_a_law_s_joint_know_loss_factors(stated):
    """To first order, against poles of the whole; modes' damping ratios within a few percent."""
    lossy = partly_lossy(stated, (0.5, 0.3, 0.5, 0.8, 0.4, 0.6))
    m = lossy.elastic.matrices(Q)
    ports = np.zeros(0, dtype=int)
    system = System(m.mass, m.geometric, m.hit, m.sensor, lossy.elasticity, (), ports)
    poles = modal(system, 0)[0]
    exact = lossy.poles(Q[:1]).poles[0]
    exact = exact[exact.imag > 0]
    order, other = np.argsort(np.abs(poles.imag)), np.argsort(exact.imag)
    np.testing.assert_allclose(poles[order].real, exact[other].real, rtol=0.05)


@pytest.mark.parametrize(("share", "tail_s", "within"), [(1e-3, 0.2, 0.02), (0.9, 1.0, 5.0)])
def test_what_a_record_cuts_off_is_that_of_decays_alone(stated, share, tail_s, within):
    """A little of the damping as a loss factor: nearly what dashpots leave; much: nothing grows."""
    plain, lossy = stated.poles(Q), partly_lossy(stated, (share,) * 6).poles(Q)
    s, tails = np.tile(2j * np.pi * LINES, (len(Q), 1)), np.full(len(Q), tail_s)
    expected, found = cut_off(plain, s, tails), cut_off(lossy, s, tails)
    assert np.abs(expected).max() > 0
    assert np.abs(found - expected).max() < within * np.abs(expected).max()
