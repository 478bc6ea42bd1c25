"""The feed in the base frame, seen at poses of a robot."""

import numpy as np
import pytest

from planner.errors import InputError
from planner.milling.cut import cuts_at, no_pose
from tests.support.milling_cases import cut

NAMES = ("a", "b", "c")
AXIS = (0.0, 0.0, -1.0)


def turned(angles_deg):
    c, s, one = *(f(np.deg2rad(angles_deg)) for f in (np.cos, np.sin)), np.ones(len(angles_deg))
    return np.moveaxis(np.array([[c, -s, 0 * c], [s, c, 0 * c], [0 * c, 0 * c, one]]), -1, 0)


def test_a_feed_in_the_base_frame_turns_against_the_tcp():
    """The tcp turned by 90° about z sees a feed along x along its own −y."""
    given = cut(feed=(1.0, 0.0, 0.3), feed_in="base", axis=AXIS)
    found = cuts_at(given, turned([0, 90, 180]), np.zeros((3, 3)), NAMES)
    wanted = [(1, 0, 0), (0, -1, 0), (-1, 0, 0)]
    assert np.array([one.feed for one in found]) == pytest.approx(np.array(wanted), abs=1e-12)
    assert {one.feed_in for one in found} == {"frf"}
    for one, turn in zip(found, turned([0, 90, 180]), strict=True):
        assert turn @ one.plane[0] == pytest.approx([1, 0, 0], abs=1e-12)


def test_a_feed_along_the_path():
    position = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0]])
    given = cut(feed_in="path", axis=AXIS)
    found = cuts_at(given, turned([0, 0, 0]), position, NAMES)
    half = np.sqrt(0.5)
    wanted = np.array([(1, 0, 0), (half, half, 0), (0, 1, 0)])
    assert np.array([one.feed for one in found]) == pytest.approx(wanted)


def test_what_has_no_direction_is_refused():
    plunge = cut(feed=(0.0, 0.0, 1.0), feed_in="base", axis=AXIS)
    with pytest.raises(InputError, match="along the tool's axis"):
        cuts_at(plunge, turned([0]), np.zeros((1, 3)), ("a",))
    along = cut(feed_in="path", axis=AXIS)
    with pytest.raises(InputError, match="one pose"):
        cuts_at(along, turned([0]), np.zeros((1, 3)), ("a",))
    with pytest.raises(InputError, match="along the tool's axis, or there is none"):
        cuts_at(along, turned([0, 0, 0]), np.zeros((3, 3)), NAMES)
    with pytest.raises(InputError, match="how the robot stands"):
        no_pose(along, "frfs.npz")
