"""Channels by themselves: dead or overloaded ones of one sensor among several; driving points."""

from dataclasses import replace

import numpy as np
import pytest

from planner.frf.estimator import estimate
from planner.frf.frf import unreciprocal
from planner.recording.channel_faults import by_good_sensors
from planner.recording.dof import Dof
from planner.recording.screening import driving_point, screen
from tests.support.simulated_hits import make_hit

BAND = (4.0, 60.0)
ELBOW = tuple(Dof("elbow", axis) for axis in "xyz")


def by_two_sensors(rng, spoil=lambda samples: samples):
    """A hit that the tool's sensor and one at the elbow heard; elbow y is spoilt."""
    hit = make_hit(rng)
    own = hit.acceleration_m_s2
    more = 0.4 * own[[1, 2, 0]]
    more[1] = spoil(more[1])
    return replace(
        hit, acceleration_m_s2=np.vstack([own, more]), responses=(*hit.responses, *ELBOW)
    )


def clipped(samples):
    most = 0.3 * np.max(np.abs(samples))
    return np.clip(samples, -most, most)


@pytest.mark.parametrize(
    ("kind", "spoil", "said"),
    [("dead", lambda samples: np.full_like(samples, 0.3), "elbow y is constant"),
     ("clipped", clipped, "elbow y is clipped")],
)  # fmt: skip
def test_a_bad_channel_costs_its_sensor_and_no_other(kind, spoil, said):
    hit = by_two_sensors(np.random.default_rng(0), spoil)
    assert kind in {fault.kind for fault in screen(hit, BAND)}
    left, told = by_good_sensors(hit)
    assert left.responses == hit.responses[:3]
    np.testing.assert_array_equal(left.acceleration_m_s2, hit.acceleration_m_s2[:3])
    assert [fault.kind for fault in told] == [kind]
    assert said in told[0].text
    assert not any(fault.refuse for fault in (*told, *screen(left, BAND)))


def test_good_sensors_stay_and_the_only_one_is_refused_as_before():
    rng = np.random.default_rng(2)
    whole = by_two_sensors(rng)
    assert by_good_sensors(whole) == (whole, ())
    alone = make_hit(rng)
    dead = alone.acceleration_m_s2 * np.array([[1.0], [0.0], [1.0]])
    alone = replace(alone, acceleration_m_s2=dead)
    assert by_good_sensors(alone) == (alone, ())
    assert {fault.kind for fault in screen(alone, BAND) if fault.refuse} == {"dead"}


def test_a_hit_whose_sign_is_turned_answers_against_itself():
    rng = np.random.default_rng(3)
    for axis in ("+x", "-x", "+y", "-y", "+z", "-z"):
        hit = make_hit(rng, axis, noise=0.05)
        assert driving_point(hit, BAND) == ()
        other = ("-" if axis[0] == "+" else "+") + axis[1]
        (fault,) = driving_point(replace(hit, axis=other), BAND)
        assert not fault.refuse
        assert f"hits along {other}" in fault.text
        assert driving_point(replace(hit, axis=other, hit_point="elbow"), BAND) == ()


def test_axes_that_do_not_fit_each_other_are_said():
    rng = np.random.default_rng(4)
    hits = tuple(make_hit(rng, axis) for axis in ("+x", "+y", "+z") * 2)
    assert unreciprocal(estimate(hits, BAND)) == ()
    turned = np.array([[1.0], [-1.0], [1.0]])
    wrong = tuple(replace(h, acceleration_m_s2=turned * h.acceleration_m_s2) for h in hits)
    told = unreciprocal(estimate(wrong, BAND))
    assert told
    assert all("along y" in text for text in told)
