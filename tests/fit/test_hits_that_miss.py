"""Hits that miss, a chain within tolerance, a rough readback: identified, and told of each hit."""

from dataclasses import replace

import numpy as np
import pytest

from planner.dataset.hit_columns import HitColumns
from planner.dynamics.gradient import moved
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import CAD_INERTIAS
from planner.fit.hit_error_fit import VisitHits, fit_hit_errors
from planner.fit.identify import identify
from planner.frf.frf import Frf
from planner.measurement.nuisances import (
    EXACT_HITS,
    NuisanceCounts,
    Tolerances,
    actual_ports,
    basis,
)
from planner.modal.residues import laplace, residue_changes, unit
from planner.proof.arms import KR10
from planner.proof.deviation import Deviation
from planner.proof.load import load_truth
from planner.proof.measurement_errors import HitError, MeasurementErrors
from planner.robot.robot import Robot
from tests.support.measured_frfs import measured_frfs

LINES = np.linspace(6.0, 60.0, 48)
Q = KR10.poses(5, seed=2)
USUAL = MeasurementErrors(
    angle_deg=1.0, offset_m=0.003, readback_deg=0.05, gain=0.015, cross_axis=0.01,
    mounting_deg=1.0, position_m=0.004, force_gain=0.015, delay_s=3e-5,
)  # fmt: skip


class Handled:
    """A truth as it is measured: one hit along each axis, all as `errors` leaves them."""

    def __init__(self, truth, errors, seed):
        self.rng = np.random.default_rng(seed)
        self.handling, self.chain = errors, errors.chain(self.rng)
        self.truth = replace(truth, sensor_offset_m=self.chain.offset_m)

    def accelerance(self, q, hz):
        there = self.handling.beside(q, self.rng)
        aims = self.handling.aims([0, 1, 2], self.rng)
        h = np.stack(
            [struck(self.truth, there, a.wrench(k), hz) for k, a in enumerate(aims)], axis=1
        )
        late = np.exp(-2j * np.pi * hz * self.chain.delay_s)
        return np.einsum("ij,jkf->ikf", self.chain.matrix, h) * late / self.chain.force_gain


def struck(truth, q, wrench, hz):
    """Accelerance (3, F) to a unit wrench (6,), by the other engine."""
    poles, shapes, entry, hit, sensor = truth.modal(q)
    drive = np.vstack([hit, truth.turning(q)]).T @ wrench
    iw = 2j * np.pi * hz
    return iw**2 * ((sensor @ shapes) @ ((entry @ drive)[:, None] / (iw - poles[:, None])))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return KR10.write(tmp_path_factory.mktemp("kr10"))


def test_identification_reaches_the_noise_and_its_sds_hold(folder):
    truth = load_truth(folder, Deviation(stiffness=0.15, damping=0.2, inertia=0.05, seed=5))
    frfs = measured_frfs(Handled(truth, USUAL, 1), Q, LINES, 0.005)
    given = frfs, Q, Simulation(Robot.load(folder)), CAD_INERTIAS
    options = {"band_hz": (6.0, 60.0), "extend": False}
    exact = identify(*given, tolerances=EXACT_HITS, **options).identified
    found = identify(*given, tolerances=Tolerances(), **options).identified
    assert exact.misfit > 5
    assert found.misfit < 2
    springs = [e for e in found.estimates if e.kind == "stiffness" and e.identifiable]
    off = [np.log(e.value / truth.springs[e.blocks[0]].stiffness) / e.log_sd for e in springs]
    assert len(off) >= 5
    assert np.max(np.abs(off)) < 3.0


def test_hits_beside_their_points_under_a_chain_that_errs_are_those_of_the_truth(folder):
    truth, t = load_truth(folder), Tolerances()
    simulation = Simulation(Robot.load(folder))
    aim = HitError(np.array([0.03, -0.02, 0.0]), np.array([0.004, 0.003, 0.0]))
    place, mixing = (0.004, -0.006, 0.005), np.eye(3) + 0.02 * np.arange(9.0).reshape(3, 3) / 9
    moved_ = replace(truth, sensor_offset_m=place)
    s, matrices = (
        np.tile(2j * np.pi * LINES, (2, 1)),
        simulation.elastic.matrices(Q[:2], slopes=True),
    )
    h = moved(matrices, simulation.elasticity, s).accelerance
    numbers = NuisanceCounts.of(h)
    eta = np.zeros((2, numbers.known + 6))
    eta[:, 8:12] = [0.03 / t.angle_rad, -0.02 / t.angle_rad, 4 / 5, 3 / 5]
    within = (mixing - np.eye(3)) / np.where(np.eye(3), t.gain, t.across)
    eta[:, numbers.hits : numbers.hits + 9] = within.reshape(-1)
    eta[:, numbers.hits + 9 : numbers.hits + 12] = np.array(place) / t.position_m
    found = moved(
        matrices, simulation.elasticity, s, actual=actual_ports(eta, s, t, (3, 3))
    ).accelerance[:, :, 2]
    for q, one, plain in zip(Q[:2], found, h[:, :, 2], strict=True):
        expected = mixing @ struck(moved_, q, aim.wrench(2), LINES)
        off = (
            struck(truth, q, HitError().wrench(2), LINES) - plain
        )  # the two engines' own difference
        missed = expected - off - plain
        assert np.abs(one - plain - missed).max() < 0.01 * np.abs(missed).max()


HZ, RATE = np.linspace(6.0, 60.0, 40), 2.0
NOISE = 1e-3  # of the largest response
POSES, REPEATS = KR10.poses(4, 6), 2
T = Tolerances()


def test_misses_are_told(folder):
    """Of a robot as stated, with a chain and hits within their tolerances."""
    simulation = Simulation(Robot.load(folder))
    rng = np.random.default_rng(2)
    s = np.tile(2j * np.pi * HZ + RATE, (len(POSES), 1))
    matrices = simulation.elastic.matrices(POSES, slopes=True)
    motion = moved(matrices, simulation.elasticity, s)
    h = motion.accelerance
    changes = basis(h, motion, s, T)
    chain = np.einsum("k,nkijf->nijf", 0.5 * rng.standard_normal(14), changes[:, 12:26])
    axis = np.repeat([0, 1, 2], REPEATS)
    visits, frfs, true = [], [], rng.standard_normal((len(POSES), len(axis), 4))
    for i, q in enumerate(POSES):
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
    learned = identify(frfs, POSES, simulation, band_hz=(6.0, 60.0), tolerances=T)
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
    lines, every = laplace(frequency, 0.0, 2.0), np.concatenate([poles, beside])
    h = residue @ unit(lines, every) + residue.conj() @ unit(lines, every.conj())
    ones = np.ones(h.shape)
    frf = Frf(frequency, h, ones, ones, (1, 1, 0), (1.0, 80.0), tail_s=2.0)
    moved = residue_changes(frf, poles, beside, (4.0, 60.0), np.stack([h, -2 * h]))
    expected = np.moveaxis(residue[..., :2], 2, 0)
    expected[..., 2] = 0.0  # never hit
    assert moved[0] == pytest.approx(expected, abs=1e-10)
    assert moved[1] == pytest.approx(-2 * expected, abs=1e-10)
