"""The direction of feed at poses of a robot, where cut.toml states it in the base frame."""

from collections.abc import Sequence

import msgspec
import numpy as np

from planner.errors import InputError
from planner.milling.cut import Cut

LEAST_ACROSS = 0.2  # of a feed's length across the tool's axis: with less it is a plunge


def cuts_at(
    cut: Cut, rotation: np.ndarray, position_m: np.ndarray, names: Sequence[str]
) -> list[Cut]:
    """The cut at each of p poses, its feed in the axes of the FRFs there.

    rotation (p, 3, 3) of the tcp in the base frame, position_m (p, 3) of the path in order, which
    gives the feed where `feed_in` is "path". InputError where a feed is along the tool's axis.
    """
    if cut.feed_in == "frf":
        return [cut] * len(rotation)
    feeds = np.tile(np.array(cut.feed, float), (len(rotation), 1))
    if cut.feed_in == "path":
        feeds = _tangents(position_m)
    return [
        turned_to(cut, turn, feed, name)
        for turn, feed, name in zip(rotation, feeds, names, strict=True)
    ]


def turned_to(cut: Cut, rotation: np.ndarray, feed: np.ndarray, name: str) -> Cut:
    """The cut with a feed (3,) in the base frame, at a rotation (3, 3) of the tcp there.

    What counts of the feed is its part across the tool's axis.
    """
    axis = np.array(cut.axis) / np.linalg.norm(cut.axis)
    own = rotation.T @ (feed / max(float(np.linalg.norm(feed)), 1e-300))
    across = own - axis * (axis @ own)
    size = float(np.linalg.norm(across))
    if not size > LEAST_ACROSS:
        raise InputError(
            f"{name}: the feed is along the tool's axis, or there is none; check feed, feed_in and "
            f"axis in the cut's file, and the path."
        )
    x, y, z = (float(v) for v in across / size)
    return msgspec.structs.replace(cut, feed=(x, y, z), feed_in="frf")


def no_pose(cut: Cut, source: object) -> None:
    """InputError where the cut's feed asks for a pose that a source does not know."""
    if cut.feed_in != "frf":
        raise InputError(
            f"{source} does not say how the robot stands, which feed_in = {cut.feed_in!r} in the "
            f"cut's file needs; name a campaign, or state the feed in the axes of the FRFs (frf)."
        )


def _tangents(position_m: np.ndarray) -> np.ndarray:
    """(p, 3) from each pose's neighbour to the next."""
    if len(position_m) < 2:
        raise InputError(
            'A path of one pose has no direction, which feed_in = "path" in the cut\'s file needs; '
            "give more poses, or state the feed."
        )
    return np.gradient(position_m, axis=0)
