"""Play of a gear that bears weight: where it rests, and how much a law explains of levels."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planner.diagnosis.laws.law_at_joints import LawAtJoints, LawMisfit
from planner.diagnosis.laws.torque_laws import LAWS
from planner.diagnosis.screens.weighed_laws import LevelMisfit

STIFFNESS, DEAD_ZONE = 2e5, LAWS[-1]
NOISY = LevelMisfit(differing=5000.0, strongest=3000.0, values=1000.0, noise=800.0)


def held(share: float, gap_rad: float, borne: float, sag_rad: np.ndarray) -> LawAtJoints:
    """Backlash at one joint that lacks `share` of its stiffness within ± gap_rad."""
    nu = np.array([[np.log(share)], [0.0]])
    scale, middle = np.array([STIFFNESS]), np.log([gap_rad])
    return LawAtJoints(
        DEAD_ZONE, 1, np.array([0]), scale, middle, np.zeros(1), nu, (), sag_rad[:, None], borne
    )


@given(
    share=st.floats(0.05, 0.98),
    gap_rad=st.floats(1e-7, 1e-3),
    borne=st.floats(0.01, 1.0),
    sag_rad=st.floats(-1e-3, 1e-3),
)
def test_the_spring_bears_its_share_of_the_weight_where_it_rests(share, gap_rad, borne, sag_rad):
    law = held(share, gap_rad, borne, np.array([0.0, sag_rad]))
    middle, rest = law.rest_at(np.array([0, 1]))[:, 0]
    assert middle == 0.0
    lacking = share * STIFFNESS * np.clip(rest, -gap_rad, gap_rad)
    torque = STIFFNESS * rest - lacking
    assert torque == pytest.approx(borne * sag_rad * STIFFNESS, rel=1e-9, abs=1e-12)


def test_without_weight_it_rests_in_the_middle():
    law = replace(held(0.9, 1e-4, 0.0, np.ones(3)), sag=None)
    assert np.array_equal(law.rest_at(np.array([0, 2, 2])), np.zeros((3, 1)))


@pytest.mark.parametrize(
    ("differing", "strongest", "explained"),
    [
        (1000.0, 3000.0, 1.0),  # to the noise
        (900.0, 500.0, 1.0),
        (3000.0, 3000.0, 0.5),
        (3000.0, 900.0, 0.5),  # what else the simulation lacks does not count
        (1000.0, 5000.0, 0.5),  # but that the strongest hits were given up for it
        (np.inf, np.inf, -np.inf),
    ],
)
def test_share_of_what_levels_differ_by_that_a_law_explains(differing, strongest, explained):
    law = held(0.9, 1e-4, 0.2, np.ones(1))
    found = LawMisfit(law, chi2=differing + strongest, differing=differing)
    assert NOISY.explained(found) == pytest.approx(explained)
