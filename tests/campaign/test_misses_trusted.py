"""A simulation that is too wrong tells no hit: what it lacks would be called the hand's."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from planner.campaign.hit_error_estimates import CampaignHitErrors
from planner.fit.hit_misses import VisitMisses
from planner.measurement.nuisances import Tolerances

HAND = Tolerances()


def campaign(times: float, discrepancy: float) -> CampaignHitErrors:
    """Nine hits that miss by so many times what hands do."""
    sd = np.repeat([HAND.angle_rad, HAND.offset_m], 2)
    mean = times * sd * np.random.default_rng(2).choice([-1.0, 1.0], (9, 4))
    told = SimpleNamespace(discrepancy=discrepancy, visits=(VisitMisses(mean, np.eye(36)),))
    return CampaignHitErrors((), cast(Any, told), HAND, (4.0, 60.0))


@pytest.mark.parametrize(
    ("times", "discrepancy", "trusted"),
    [(1.0, 1e-3, True), (2.5, 3e-2, True), (1.0, 0.3, False), (8.0, 1e-3, False)],
)
def test_hits_are_told_by_a_simulation_that_is_right_enough(times, discrepancy, trusted):
    assert campaign(times, discrepancy).trusted is trusted


def test_nothing_is_told_where_it_is_not():
    assert campaign(8.0, 0.3).poses == ()
