"""Is one cut at one pose stable, how sure is that, and on which mode does it hang?"""

import numpy as np
import pytest

from planner.campaign.decision import Decision
from planner.milling.lobes import depths_of, stability_limits
from planner.milling.machine import Machine
from planner.milling.path import decide, limits_along, limits_by_feed
from planner.milling.structure import Structure
from tests.support.milling_cases import cut, one_mode, two_each_way

RPM = 10000.0


def uncertain(sd: float) -> Structure:
    """The mode of the literature, of which the size alone is uncertain."""
    return Structure(one_mode(), np.array([0.0, 0.0, sd, 0.0]))


def limit() -> float:
    return stability_limits(Machine(one_mode(), cut(spindle_rpm=(RPM, RPM, 1))))[0].depth_m


def test_at_the_limit_it_is_even_and_surer_the_farther():
    structure, depth = uncertain(0.1), limit()
    at = [decide(structure, cut(), RPM, depth * share) for share in (0.7, 0.9, 1.0, 1.1, 1.4)]
    probability = [found.probability for found in at]
    assert probability == sorted(probability, reverse=True)
    assert probability[2] == pytest.approx(0.5, abs=0.02)
    # A size that errs by 10 % moves the limit by 10 %.
    assert probability[1] == pytest.approx(0.85, abs=0.06)
    assert probability[0] > 0.97
    assert probability[4] < 0.03


def test_slope_names_the_mode_on_which_it_hangs():
    """At 12 krpm the modes near 1450 Hz decide: those near 500 Hz hardly matter."""
    given = cut(milling="down", radial_immersion=0.5, kt_n_m2=1319.4e6, kr_n_m2=788.8e6)
    found = decide(Structure(two_each_way(), np.zeros(13)), given, 12000.0, 9.1e-4)
    high = found.frequency_hz > 1000
    assert np.max(np.abs(found.slope[high])) > 5 * np.max(np.abs(found.slope[~high]))


def test_a_decision_is_as_sure_as_its_least_sure_pose():
    structure, depth = uncertain(0.1), limit()
    poses = tuple(decide(structure, cut(), RPM, depth * share) for share in (0.6, 0.9))
    decision = Decision(np.zeros((2, 6)), poses)
    assert not decision.sure(0.95)
    assert decision.sure(0.75)
    assert decision.shrunk(np.full(2, 0.2), 0.95)
    assert not decision.shrunk(np.full(2, 0.9), 0.95)


def test_path_takes_the_tightest_pose_and_the_speed_that_suits_all():
    given = cut(spindle_rpm=(10000.0, 16000.0, 3), depth_m=(0.0, 0.01, 10))
    stiff = Structure(one_mode(), np.zeros(4))
    soft = Structure(one_mode((0.6, 0.8)), np.zeros(4))
    both = limits_along([("a", stiff), ("b", soft)], given, 20)
    alone = [depths_of(stability_limits(s.machine(given))) for s in (stiff, soft)]
    least = np.min(alone, axis=0)
    np.testing.assert_allclose(np.min(both.robust_m, axis=0), least)
    assert both.best_speed == int(np.argmax(least))


def test_feed_turned_into_a_mode_is_the_cut_turned():
    """A mode along x under a feed turned by 90° is one along −y under a feed along x."""
    given = cut(milling="down", radial_immersion=0.3, depth_m=(0.0, 0.02, 10))
    structure = Structure(one_mode(), np.zeros(4))
    turned = limits_by_feed([("a", structure)], given, RPM)
    across = cut(
        milling="down", radial_immersion=0.3, depth_m=(0.0, 0.02, 10), spindle_rpm=(RPM, RPM, 1)
    )
    wanted = stability_limits(Machine(one_mode((0.0, -1.0)), across))[0].depth_m
    assert turned[6] == pytest.approx(wanted, rel=1e-6)
    assert turned[12] == pytest.approx(turned[0], rel=1e-6)
