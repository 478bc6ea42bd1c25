"""What recordings tell of an effect: against noise drawn, against formulas, and in order."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from planner.truth.deviation import AttachedMass, Deviation, ScaledJoint, Scatter, StiffnessRipple
from planner.truth.handling import EVERYDAY, LABORATORY, Handling
from planner.truth.hits import Hammer, noise_power, noisy
from planner.truth.laws import Backlash
from planner.truth.load import load_truth
from planner.truth.nats import Conditions, Lacking, Nats, lacking, nats
from planner.truth.nonlinear import Port
from planner.truth.secret import Secret, quiet_hits
from planner.truth.visits import Visits
from tests.support.known_robots import KR210

SCATTER = Scatter(stiffness=0.15, damping=0.15, inertia=0.08, com_m=0.01)
HAMMER = Hammer(noise=0.02, record_s=1.28, oversampling=8)
BAND = (4.0, 60.0)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return replace(KR210, damping_s=9.5e-4).write(tmp_path_factory.mktemp("kr210"))


def told(path, deviation: Deviation, handling: Handling = LABORATORY, **hammer: float) -> Nats:
    """Of all that a deviation has."""
    tool, own = replace(HAMMER, **hammer), np.random.default_rng(5)
    rng = np.random.default_rng(4)
    plain = replace(Secret(Deviation()), chain=handling.chain(own))
    visits = Visits.planned(KR210.poses(3), tool, handling, rng, own).visits
    truths = [load_truth(path, d) for d in (deviation, Deviation())]
    secrets = [replace(plain, deviation=deviation), plain]
    quiet, without = (
        quiet_hits(truth, secret, visits, tool, copy.deepcopy(rng))
        for truth, secret in zip(truths, secrets, strict=True)
    )
    conditions = Conditions(visits, BAND, SCATTER, handling, tool)
    return nats(conditions, truths[0], secrets[0], quiet, Lacking(truths[1], plain, without))


def test_with_all_else_known_it_is_the_difference_over_the_noise(path):
    """The noise of many recordings has the power that is said, and gives this log-likelihood."""
    rng = np.random.default_rng(0)
    tool = replace(HAMMER, rumble_m_s2=0.05)
    visits = Visits.planned(KR210.poses(1), tool, LABORATORY, rng, rng).visits
    hit = quiet_hits(load_truth(path), Secret(Deviation()), visits, tool, rng)[0][1]
    draws = [noisy(hit, tool, rng).acceleration_m_s2 - hit.acceleration_m_s2 for _ in range(400)]
    spectra = np.fft.rfft(draws)[..., 1:-1]
    ratio = np.mean(np.abs(spectra) ** 2, axis=(0, 1)) / noise_power(hit, tool)[1:-1]
    assert np.mean(ratio) == pytest.approx(1, abs=0.02)
    assert np.max(np.abs(ratio - 1)) < 0.15
    assert np.std(np.array(draws)) > 0.05  # the rumble is there


def test_it_grows_with_the_square_of_a_small_effect_and_of_the_noise(path):
    def lump(kg: float) -> Deviation:
        return Deviation(added=(AttachedMass("link_3", (0.2, 0.1, 0.1), kg),))

    one, two = told(path, lump(0.5)), told(path, lump(1.0))
    for name in ("nats", "nats_known", "nats_open"):
        assert getattr(two, name) == pytest.approx(4 * getattr(one, name), rel=0.05)
    assert two.change == pytest.approx(2 * one.change, rel=0.05)
    quieter = told(path, lump(0.5), noise=0.01)
    assert quieter.nats_known == pytest.approx(4 * one.nats_known, rel=1e-6)
    # A robot may have other inertias and springs anyway: that takes nearly all of it.
    assert 0 < one.nats < 0.1 * one.nats_known
    assert 0 < one.left < 0.5 * one.change
    assert two.left == pytest.approx(2 * one.left, rel=0.05)


def test_what_scatters_anyway_tells_hardly_more_than_its_prior(path):
    """A spring 0.3 % off costs a robot whose springs scatter by 15 % next to nothing."""
    scaled = (ScaledJoint("joint_2", float(np.exp(0.003))),)
    spring = told(path, Deviation(scaled=scaled), record_s=2.56)
    assert spring.nats_known > 300
    assert spring.nats < 1e-4 * spring.nats_known  # half a record's end that is cut off remains
    assert spring.left < 0.02 * spring.change


def test_open_hits_and_chain_leave_less(path):
    ripple = Deviation(harmonics=(StiffnessRipple("joint_2", 2, 0.02, 0.0),))
    clean, real = told(path, ripple), told(path, ripple, EVERYDAY)
    assert clean.nats_open == pytest.approx(clean.nats, rel=1e-6)
    assert 0 < real.nats_open < real.nats <= real.nats_known
    assert 0 < real.left <= real.change


def test_one_effect_of_several_can_be_left_out():
    first = replace(Secret(Deviation(3)), deviation=Deviation(3, scaled=(ScaledJoint("j", 2.0),)))
    law = Port(Backlash(1.0, 1.0), joint="j")
    both = replace(first, ports=(law,))
    whole = replace(both, loss_factor=0.1)
    left = lacking(whole, Secret(Deviation(3)), first)
    assert (left.deviation, left.ports, left.loss_factor) == (Deviation(3), (law,), 0.1)
    left = lacking(whole, first, both)
    assert (left.deviation, left.ports, left.loss_factor) == (first.deviation, (), 0.1)
    assert lacking(whole, both, whole).loss_factor is None
