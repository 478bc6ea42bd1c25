"""Nonlinear joints: laws against their theory, and hits in time against the frequency domain."""

import numpy as np
import pytest

from planner.diagnosis.laws.equivalent_stiffness import System, receptances
from planner.diagnosis.laws.one_joint_response import seen, spectra, strokes, torques
from planner.diagnosis.laws.torque_laws import LAWS
from planner.dynamics.simulation import Elasticity
from tests.support.struck import VISITS, struck_robot

STIFFENING, DAHL, DEAD_ZONE = LAWS
AMPLITUDES = np.array([1e-3, 0.1, 0.5, 2.0, 20.0])


def test_dead_zone_has_its_describing_function():
    found = DEAD_ZONE.slow(AMPLITUDES, 0.3)
    ratio = np.minimum(0.3 / AMPLITUDES, 1.0)
    expected = -2 / np.pi * (np.arcsin(ratio) + ratio * np.sqrt(1 - ratio**2))
    assert np.allclose(found, expected, atol=3e-3)


def test_friction_sticks_when_small_and_slides_when_large():
    found = DAHL.slow(AMPLITUDES, 0.3)
    assert found[0] == pytest.approx(1.0, abs=2e-2)
    assert found[-1].imag == pytest.approx(4 * 0.3 / (np.pi * AMPLITUDES[-1]), rel=2e-2)
    assert np.all(np.diff(found.real) < 0)
    assert np.all(found.imag > 0)


def test_stiffening_goes_from_nothing_to_all():
    found = STIFFENING.slow(AMPLITUDES, 0.3)
    assert np.allclose(found.imag, 0, atol=1e-12)
    assert np.all(np.diff(found.real) > 0)
    assert abs(found[0]) < 1e-4
    assert found[-1].real == pytest.approx(1.0, abs=0.02)


def test_what_hangs_leaves_its_flank_only_where_it_swings_far():
    """Bearing on one flank, 0.2 beyond the edge of a gap of ± 0.3: slack between −0.2 and −0.8."""
    now = np.array([1.0, 0.0, -0.2, -0.5, -0.8, -3.0])
    for way in (1.0, -1.0):
        rest, one = np.full(6, 0.5 * way), np.ones(6)
        torque, slope, after = DEAD_ZONE.step(np, one, 0.3 * one, rest, 0 * one, way * now)
        assert np.allclose(torque, way * np.array([0.0, 0.0, 0.0, 0.3, 0.6, 0.6]))
        assert slope[[0, 1, 3, 5]] == pytest.approx([0.0, 0.0, -1.0, 0.0])
        assert np.array_equal(after, rest)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.effect)
def test_slope_of_the_torque(law):
    now = np.linspace(-0.9, 0.9, 14)
    k, a, state, before = np.full(14, 2.0), np.full(14, 0.25), np.full(14, 0.05), np.zeros(14)
    slope = law.step(np, k, a, state, before, now)[1]
    up = law.step(np, k, a, state, before, now + 1e-6)[0]
    down = law.step(np, k, a, state, before, now - 1e-6)[0]
    assert np.allclose(slope, (up - down) / 2e-6, atol=1e-6)


def test_friction_never_gives_energy():
    rng = np.random.default_rng(0)
    angle = np.cumsum(0.1 * rng.standard_normal((400, 20)), axis=0)
    angle = np.concatenate([angle, angle[::-1]])
    state, work, before = np.zeros(20), np.zeros(20), angle[0]
    for now in angle:
        torque, _, after = DAHL.step(np, np.ones(20), np.full(20, 0.2), state, before, now)
        work += (torque + state) / 2 * (now - before)
        state, before = after, now
    assert np.all(work > 0)


@pytest.fixture(scope="module")
def struck(tmp_path_factory):
    """A system, and one hit along each axis at two poses."""
    system, columns = struck_robot(tmp_path_factory.mktemp("kr210"))
    return system, strokes(VISITS, columns), 2j * np.pi * np.linspace(6, 45, 9) + 4


def test_a_linear_torque_in_time_is_a_stiffer_spring_in_frequency(struck):
    system, hits, s = struck
    port, more = 2, 0.4 * system.elasticity.stiffness[2]
    view = seen(system, port, hits, 500.0)
    none = np.zeros(6)
    torque = torques([(STIFFENING, slice(0, 6))], none, none + 1, none + more, view)
    k = system.elasticity.stiffness.copy()
    k[port] += more
    springs = Elasticity(k, system.elasticity.damping, system.elasticity.loss_factor)
    stiffer = System(system.mass, system.geometric, system.hit, system.sensor, springs,
                     system.ports, system.blocks)  # fmt: skip
    ratio = spectra(torque, hits, s) / spectra(hits.force.T, hits, s)
    for c in range(6):
        expected = (
            more * receptances(stiffer, int(hits.visit[c]), s).port_hit[:, port, hits.axis[c]]
        )
        assert np.allclose(ratio[c], expected, atol=0.02 * np.abs(expected).max())


def test_weak_hits_on_a_stiffening_joint_are_linear_ones(struck):
    system, hits, _ = struck
    view = seen(system, 2, hits, 500.0)
    k = np.full(6, 0.5 * system.elasticity.stiffness[2])
    law = [(STIFFENING, slice(0, 6))]
    weak = torques(law, k, np.full(6, 1.0), np.zeros(6), view)
    strong = torques(law, k, np.full(6, 1e-9), np.zeros(6), view)
    plainly = torques(law, 0 * k, np.full(6, 1.0), k, view)
    assert np.abs(weak).max() < 1e-4 * np.abs(plainly).max()
    assert np.allclose(strong, plainly, atol=1e-3 * np.abs(plainly).max())
