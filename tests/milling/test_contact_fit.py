"""The contact of a target, from its FRFs at one pose."""

import numpy as np
import pytest

from planner.errors import InputError
from planner.milling.coupling import fit_contact
from planner.milling.tip_files import smoothed, two_point_receptance
from planner.milling.tool import NUMBERS
from tests.milling.assembled import frf, machine
from tests.milling.test_coupling import (
    ACROSS,
    FREQUENCY,
    LOOSER,
    REFERENCE,
    RIGID_ENOUGH,
    TARGET,
    measured,
    ordered,
    tool,
)
from tests.milling.test_round_trip import BACK, SOFT


@pytest.fixture(scope="module")
def tip():
    seen = measured(frf(machine(), REFERENCE, FREQUENCY, RIGID_ENOUGH, points=(-1, 12)), 0.01, 5)
    return smoothed(two_point_receptance(seen, ACROSS, tool(REFERENCE, RIGID_ENOUGH), BACK))


def hit(held):
    """x and y of the target's tip with 1 % noise, z not measured."""
    truth = ordered(frf(machine(), TARGET, FREQUENCY, held))[:2, :2]
    a, b = np.random.default_rng(1).standard_normal((2, *truth.shape))
    seen = np.full((3, 3, len(FREQUENCY)), np.nan + 0j)
    seen[:2, :2] = truth * (1 + 0.01 * (a + 1j * b) / np.sqrt(2))
    return seen


def test_a_soft_contact_is_found_from_a_wrong_start(tip):
    start = tool(TARGET, (3e7, 1e5, 200.0, 1.0))
    found = fit_contact(tip, start, tool(REFERENCE, RIGID_ENOUGH), hit(SOFT))
    values = [getattr(found.contact, name) for name in NUMBERS]
    assert values[:2] == pytest.approx(SOFT[:2], rel=0.01)
    assert values[2:] == pytest.approx(SOFT[2:], rel=0.1)
    assert found.after < 0.02 < found.before
    assert np.all(np.abs(np.log(np.array(values) / SOFT)) < 4 * found.log_sd)


def test_what_the_frfs_do_not_determine_is_not_named(tip):
    """Far stiffer than the tool, a contact's rotation does not show in the band."""
    start = tool(TARGET, (4e7, 4e6, 200.0, 1.0))
    found = fit_contact(tip, start, tool(REFERENCE, RIGID_ENOUGH), hit(LOOSER)).to_json()
    assert found["stiffness_n_m"]["value"] == pytest.approx(LOOSER[0], rel=0.03)
    assert found["damping_nms_rad"]["sd_percent"] is None


def test_a_tool_held_rigidly_has_nothing_to_identify(tip):
    with pytest.raises(InputError, match="state one to begin with"):
        fit_contact(tip, tool(TARGET), None, hit(SOFT))
