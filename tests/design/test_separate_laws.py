"""The force of a hit that tells a joint's laws apart, against hits integrated in time."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import spearmanr

from planner.dataset.dataset import Dataset, Visit
from planner.dataset.level_columns import column
from planner.design.law_discrimination import accelerance, forces_n, law_separation
from planner.design.next_hit import next_hit
from planner.diagnosis.finding import Finding
from planner.diagnosis.laws.equivalent_stiffness import receptances, system_of
from planner.diagnosis.laws.law_at_joints import LawAtJoints, LawMisfit, Laws
from planner.diagnosis.laws.one_joint_response import seen, spectra, strokes, torques
from planner.diagnosis.laws.torque_laws import LAWS
from planner.diagnosis.linear.drift_fit import problem_of
from planner.diagnosis.screens.force_levels import base
from planner.dynamics.simulation import Simulation
from planner.recording.records import Hit
from planner.robot.robot import Robot
from tests.support.known_robots import KR210

RATE_HZ, SAMPLES, PORT = 400.0, 1024, 2
STIFFENING, DAHL, DEAD_ZONE = LAWS
SWING = 4e-5  # rad


def struck(axis, peak_n, rng):
    t = np.arange(SAMPLES) / RATE_HZ
    force = peak_n * np.sin(np.pi * np.clip((t - 0.06) / 0.01, 0, 1)) ** 2
    noise = 2e-3 * rng.standard_normal((3, SAMPLES))
    force = force + 1e-3 * rng.standard_normal(SAMPLES)
    return Hit(Path("hit"), "+" + "xyz"[axis], RATE_HZ, force, noise)


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    simulation = Simulation(Robot.load(KR210.write(tmp_path_factory.mktemp("kr210"))))
    rng = np.random.default_rng(3)
    hits = tuple(struck(axis, 300.0, rng) for axis in range(3))
    q = KR210.poses(2, 8)
    visits = tuple(Visit(f"P{i}", row, 0.5 * i, hits) for i, row in enumerate(q))
    recorded = Dataset.of_visits(visits, (5.0, 50.0))
    plain = base(recorded, simulation)
    plain = replace(plain, x=plain.misfit.mean)  # records of noise say nothing of springs
    return recorded, simulation, plain


def laws_of(cell, *numbers):
    recorded, simulation, plain = cell
    scale = float(system_of(plain).elasticity.stiffness[PORT])
    d = len(plain.x) + 2
    made = []
    for law, share, angle in numbers:
        nu = np.array([[share if law.signed else np.log(share)], [0.0]])
        own, middle = np.array([scale]), np.array([np.log(angle)])
        sign = 0 if law.signed else 1
        one = LawAtJoints(law, sign, np.array([PORT]), own, middle, plain.x, nu)
        made.append(LawMisfit(one).sloped(None, np.eye(d) * 400.0))
    even = (1 / len(made),) * len(made)
    problem = problem_of(recorded, simulation)
    return Laws(problem, plain, tuple(made), even, 1.0, recorded.columns[0][0])


def in_time(cell, law, force_n):
    """FRFs (3, 3, F) at the first pose with hits of one force, integrated in time; s (F,)."""
    _, _, plain = cell
    rng = np.random.default_rng(0)
    columns = [
        column((struck(axis, force_n, rng),), axis, 0, SAMPLES, (5.0, 50.0), 4.0, 0.0)
        for axis in range(3)
    ]
    hits, system = strokes([0, 0, 0], columns), system_of(plain)
    s = 2j * np.pi * np.linspace(6, 45, 40) + 4.0
    view = seen(system, PORT, hits, 500.0)
    one = np.ones(3)
    torque = torques([(law.kind, slice(0, 3))], law.k * one, law.a * one, 0 * one, view)
    ratio = spectra(torque, hits, s) / spectra(hits.force.T, hits, s)
    found = receptances(system, 0, s)
    linear = np.moveaxis(found.sensor_hit, 0, 2)
    through = np.moveaxis(found.sensor_port[:, :, PORT], 0, 1)
    return s**2 * (linear - through[:, None] * ratio), columns[0], s


@pytest.mark.parametrize(
    ("law", "share"), [(STIFFENING, 0.6), (STIFFENING, -0.4), (DAHL, 0.5), (DEAD_ZONE, 0.5)]
)
def test_what_a_law_does_follows_that_in_time(cell, law, share):
    laws = laws_of(cell, (law, share, SWING))
    candidate = laws.candidates[0].law
    system, sizes, errors = system_of(laws.plain), [], []
    for force in (30.0, 300.0, 3000.0):
        h, struck_column, s = in_time(cell, candidate, force)
        spectrum = np.interp(s.imag / (2 * np.pi), struck_column.frequency_hz, struck_column.force)
        found = receptances(system, 0, s)
        ours = accelerance(found, candidate, spectrum, np.ones(1))[0]
        linear = accelerance(found, replace(candidate, scale=np.zeros(1)), spectrum, np.ones(1))[0]
        sizes.append(np.linalg.norm(h - linear))
        errors.append(np.linalg.norm(ours - h))
    print(law.effect, share, "size", np.round(sizes, 3), "error", np.round(errors, 3))
    # Where a law does most it is told well, elsewhere its size is.
    assert min(e / size for e, size in zip(errors, sizes, strict=True)) < 0.2
    assert all(e < 0.8 * size for e, size in zip(errors, sizes, strict=True))


def test_swings_do_not_depend_on_how_wide_the_band_is(cell):
    """Of a hit that excites nothing above 50 Hz, told over twice and four times the band."""
    system, peak = system_of(cell[2]), 1.3e-4
    candidate = laws_of(cell, (STIFFENING, 0.6, peak)).candidates[0].law
    told = []
    for end in (50.0, 100.0, 200.0):
        s = 2j * np.pi * np.arange(5.0, end, 0.4) + 4.0
        force = np.where(s.imag < 2 * np.pi * 50.0, 2.0, 0.0).astype(complex)
        h = accelerance(receptances(system, 0, s), candidate, force, np.ones(1))
        told.append(h[..., : int((50.0 - 5.0) / 0.4)])
    for other in told[1:]:
        np.testing.assert_allclose(other, told[0], rtol=1e-6, atol=1e-9)


def test_forces_that_tell_laws_apart_in_time_are_those_proposed(cell):
    laws = laws_of(cell, (DAHL, 0.5, SWING), (DEAD_ZONE, 0.5, SWING))
    force = np.append(np.geomspace(1.0, 10000.0, 7), 3e5)
    gain = law_separation(laws, laws.problem.q[:1], force)[0]
    floor = np.median(laws.hit.variance[np.isfinite(laws.hit.variance)])
    every = [[in_time(cell, one.law, peak)[0] for one in laws.candidates] for peak in force]
    apart = np.empty(gain.shape)
    for level, (one, other) in enumerate(every[:-1]):
        change, rival = one - every[-1][0], other - every[-1][1]
        quiet = floor * (laws.hit.peak_n / force[level]) ** 2
        variance = quiet + (0.01 * np.abs(change)) ** 2 + (0.003 * np.abs(one)) ** 2
        apart[:, level] = np.sum(np.abs(change - rival) ** 2 / variance, axis=(0, 2))
    print(np.round(np.log10(gain), 1), np.round(np.log10(apart), 1), sep="\n")
    assert spearmanr(gain.ravel(), apart.ravel()).statistic > 0.8
    best = np.unravel_index(int(np.argmax(gain)), gain.shape)
    assert apart[best] > 0.3 * apart.max()


def test_a_hit_that_leaves_the_joint_still_tells_nothing(cell):
    candidate = laws_of(cell, (DAHL, 0.5, SWING)).candidates[0].law
    found = receptances(system_of(cell[2]), 0, 2j * np.pi * np.linspace(6, 45, 40))
    still = replace(found, port_hit=np.zeros_like(found.port_hit))
    h = accelerance(still, candidate, np.ones(40, complex), np.ones(1))[0]
    np.testing.assert_allclose(h, found.s**2 * np.moveaxis(found.sensor_hit, 0, 2))


def test_one_law_and_twice_the_same_need_no_hit(cell):
    force = forces_n(50.0, 400.0)
    assert force[-1] == pytest.approx(400.0)
    assert force[0] == pytest.approx(25.0)
    one = laws_of(cell, (DAHL, 0.5, SWING))
    assert not law_separation(one, one.problem.q, force).any()
    twice = laws_of(cell, (DAHL, 0.5, SWING), (DAHL, 0.5, SWING))
    np.testing.assert_allclose(law_separation(twice, twice.problem.q, force), 0.0, atol=1e-9)


def test_the_command_names_the_force(cell):
    laws = laws_of(cell, (DAHL, 0.5, SWING), (DEAD_ZONE, 0.5, SWING))
    finding = Finding("friction", "joint_3", 50.0, laws=laws)
    established = SimpleNamespace(established=((finding, 0.5),))
    explained = SimpleNamespace(whole=established, recorded=cell[0])
    q = KR210.poses(3, 9)
    offered = dict(zip("ABC", q, strict=True))
    told = next_hit(explained, offered)
    assert told is not None
    np.testing.assert_allclose(np.deg2rad(told.joints_deg), offered[told.pose], atol=1e-4)
    assert told.hit in "xyz"
    assert told.force_n[1] == pytest.approx(300.0, rel=0.1)  # all hits were of 300 N
    assert told.force_n[0] < told.force_n[1] <= 300.5
    assert told.between == ("friction at joint_3 (50 %)", "backlash at joint_3 (50 %)")
    assert " N along " in told.sentence
    assert next_hit(explained, {}) is None
