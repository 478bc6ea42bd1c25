"""What the hits of a pose show beside the simulation, column by column, and misses told from it."""

import numpy as np
import pytest

from planner.dataset.hit_columns import HitColumns
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.identification.hit_misses import Known, VisitHits, tell_misses
from planner.identification.measurement_model import CHAIN_NUMBERS, Tolerances
from planner.identification.parameters import Priors, parametrise
from planner.identification.simulated_visit import SimulatedPoses
from planner.modal.residues import Residues, laplace, residue_changes, synthesize
from planner.robot.robot import Robot
from tests.support.known_robots import KR10

LINES = laplace(np.linspace(6.0, 60.0, 30), 2.0)
T = Tolerances()
NOISE = 1e-3  # of the largest response


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    nominal = Simulation(Robot.load(KR10.write(tmp_path_factory.mktemp("kr10"))))
    p = parametrise(nominal, Priors(mass=0.05, inertia=0.05, com_m=0.01))
    return Known(nominal, p, np.concatenate([p.mean, np.zeros(len(p.nuisances))]))


def made(known, x, chain, t=T):
    poses = SimulatedPoses.of(known.simulation(x), known.parametrisation, KR10.poses(1, 5))
    return poses.visit(0, LINES, t, chain)


def test_joints_stand_beside_their_readback_as_far_as_is_stated(known):
    """`[readback]` of campaign.toml, joint by joint: 0.05° where nothing is stated."""
    chain = np.zeros(CHAIN_NUMBERS)
    per_rad = made(known, known.x, chain, Tolerances(joint_rad=1.0)).readback
    usual = made(known, known.x, chain).readback
    assert usual == pytest.approx(np.deg2rad(0.05) * per_rad, rel=1e-9)
    sds = tuple(1e-3 * np.arange(1.0, 7.0))
    stated = made(known, known.x, chain, Tolerances(joint_rad=sds)).readback
    assert stated == pytest.approx(np.array(sds)[:, None, None, None] * per_rad, rel=1e-9)


def test_columns_of_chain_and_parameters_are_slopes(known):
    chain = 0.7 * np.random.default_rng(1).standard_normal(CHAIN_NUMBERS)
    at = made(known, known.x, chain)
    size = np.abs(at.accelerance).max()
    for k in range(CHAIN_NUMBERS):
        step = 1e-4 * np.eye(CHAIN_NUMBERS)[k]
        pair = [made(known, known.x, chain + sign * step).accelerance for sign in (1, -1)]
        assert (pair[0] - pair[1]) / 2e-4 == pytest.approx(at.chain[k], abs=1e-6 * size)
    for k in (0, 1, 8, len(known.x) - 1):
        step = 1e-4 * np.eye(len(known.x))[k]
        pair = [made(known, known.x + sign * step, chain).accelerance for sign in (1, -1)]
        # The sag under the weight follows the springs too, which the slope leaves out.
        off = 0.02 * np.abs(at.slope[k]).max() + 1e-4 * size
        assert (pair[0] - pair[1]) / 2e-4 == pytest.approx(at.slope[k], abs=off)


def visits(known, rng, count=3, repeats=2):
    """Hits that miss at `count` poses, with a chain within its tolerance, and the misses."""
    chain, out, true = 0.5 * rng.standard_normal(CHAIN_NUMBERS), [], []
    axis = np.repeat([0, 1, 2], repeats)
    q = KR10.poses(count, 6)
    poses = SimulatedPoses.of(known.simulation(known.x), known.parametrisation, q)
    for i in range(count):
        at = poses.visit(i, LINES, T, chain)
        eta = rng.standard_normal((len(axis), 4))
        h = np.array([at.accelerance[:, a] for a in axis])
        h = h + np.einsum("nk,nkif->nif", eta, at.misses[axis])
        sd = NOISE * np.abs(h).max()
        parts = rng.standard_normal((2, *h.shape))
        h = h + sd * (parts[0] + 1j * parts[1]) / np.sqrt(2)
        columns = HitColumns(
            np.arange(len(axis)), axis, np.ones(len(axis)), np.linspace(6.0, 60.0, 30), h,
            np.full(h.shape, sd**2), np.full((len(axis), 30), 1 / repeats), 2.0, np.inf,
        )  # fmt: skip
        out.append(VisitHits(q[i], columns))
        true.append(eta)
    return out, np.array(true)


@pytest.mark.parametrize("tell_by", [3, 2])
def test_misses_are_told(known, tell_by):
    given, true = visits(known, np.random.default_rng(2))
    found = tell_misses(given, known, T, tell_by)
    scale = np.repeat([T.angle_rad, T.offset_m], 2)
    told = np.array([one.mean for one in found.visits]) / scale
    sd = np.array([np.sqrt(np.diagonal(v.covariance)).reshape(-1, 4) for v in found.visits]) / scale
    assert np.sqrt(np.mean((told - true)[..., :2] ** 2)) < 0.15
    assert np.sqrt(np.mean((told - true)[..., 2:] ** 2)) < 0.5
    assert np.mean(np.abs(told - true) < 1.96 * sd) > 0.85
    assert found.discrepancy < 0.01


def test_residues_follow_their_frf():
    rng = np.random.default_rng(3)
    poles = 2 * np.pi * np.array([8.0, 15.0]) * (1j - 0.03)
    beside = 2 * np.pi * np.array([64.0]) * (1j - 0.03)
    residue = 1e-4 * (rng.standard_normal((3, 3, 3)) + 1j * rng.standard_normal((3, 3, 3)))
    frequency = np.linspace(1.0, 80.0, 400)
    none, every = np.zeros((3, 3, 0), complex), np.concatenate([poles, beside])
    h = synthesize(laplace(frequency, 0.0, 2.0), every, Residues(residue, none))
    ones = np.ones(h.shape)
    frf = Frf(frequency, h, ones, ones, (1, 1, 0), (1.0, 80.0), tail_s=2.0)
    moved = residue_changes(frf, poles, beside, (4.0, 60.0), np.stack([h, -2 * h]))
    expected = np.moveaxis(residue[..., :2], 2, 0)
    expected[..., 2] = 0.0  # never hit
    assert moved[0] == pytest.approx(expected, abs=1e-10)
    assert moved[1] == pytest.approx(-2 * expected, abs=1e-10)
