"""Misses of hits, told by a fit of their averages."""

import numpy as np
import pytest

from planner.dataset.hit_columns import HitColumns
from planner.dynamics.gradient import moved
from planner.dynamics.simulation import Simulation
from planner.fit.hit_error_fit import VisitHits, fit_hit_errors
from planner.fit.identify import identify
from planner.frf.frf import Frf
from planner.measurement.nuisances import Tolerances, basis
from planner.modal.residues import Residues, laplace, residue_changes, synthesize
from planner.proof.arms import KR10
from planner.robot.robot import Robot

HZ, RATE = np.linspace(6.0, 60.0, 40), 2.0
NOISE = 1e-3  # of the largest response
Q, REPEATS = KR10.poses(4, 6), 2
T = Tolerances()


def test_misses_are_told(tmp_path):
    """Of a robot as stated, with a chain and hits within their tolerances."""
    simulation = Simulation(Robot.load(KR10.write(tmp_path)))
    rng = np.random.default_rng(2)
    s = np.tile(2j * np.pi * HZ + RATE, (len(Q), 1))
    matrices = simulation.elastic.with_slopes(Q)
    motion = moved(matrices, simulation.elasticity, s)
    h = motion.accelerance
    changes = basis(h, motion, s, T)
    chain = np.einsum("k,nkijf->nijf", 0.5 * rng.standard_normal(14), changes[:, 12:26])
    axis = np.repeat([0, 1, 2], REPEATS)
    visits, frfs, true = [], [], rng.standard_normal((len(Q), len(axis), 4))
    for i, q in enumerate(Q):
        by_axis = np.einsum("akiaf->akif", changes[i, :12].reshape(3, 4, 3, 3, -1))
        each = np.array([(h[i] + chain[i])[:, a] for a in axis])
        each = each + np.einsum("nk,nkif->nif", true[i], by_axis[axis])
        sd = NOISE * np.abs(each).max()
        parts = rng.standard_normal((2, *each.shape))
        each = each + sd * (parts[0] + 1j * parts[1]) / np.sqrt(2)
        share = np.full((len(axis), len(HZ)), 1 / REPEATS)
        variance = np.full(each.shape, sd**2)
        hits = np.arange(len(axis)), axis, np.ones(len(axis))
        visits.append(VisitHits(q, HitColumns(*hits, HZ, each, variance, share, RATE, np.inf)))
        mean = np.stack([each[axis == a].mean(axis=0) for a in range(3)], axis=1)
        ones = np.ones(mean.shape)
        frfs.append(
            Frf(HZ, mean, ones * sd**2 / REPEATS, ones, (2, 2, 2), (6.0, 60.0),
                exponential_rate_1_s=RATE)
        )  # fmt: skip
    learned = identify(frfs, Q, simulation, band_hz=(6.0, 60.0), tolerances=T)
    found = fit_hit_errors(learned.posterior, visits)
    scale = np.repeat([T.angle_rad, T.offset_m], 2)
    told = np.array([one.mean for one in found.visits]) / scale
    sd = np.array([np.sqrt(np.diagonal(v.covariance)).reshape(-1, 4) for v in found.visits]) / scale
    off = told - true
    assert np.sqrt(np.mean(off[..., :2] ** 2)) < 0.15
    assert np.sqrt(np.mean(off[..., 2:] ** 2)) < 0.5
    assert np.mean(np.abs(off) < 1.96 * sd) > 0.85
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
