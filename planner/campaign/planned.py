"""Where a campaign was planned to be good: the one place by which predictions are marked."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from planner.campaign.cell import Cell
    from planner.robot.robot import Robot

BESIDE = 0.01  # rad or m beyond the workspace that a readback may be: still inside
# A pose of a workspace of positions is reached as planned if inverse kinematics from one of the
# planned poses nearest in place, NEIGHBOURS of them, leads to it within NEAR rad (m). Joints that
# are free besides differ among these poses as well: by so much, FARTHER times, they may. On the
# shipped plane and on a box with rotation, 300 of 300 further poses as planned were inside, and
# 160 of 160 with wrist or elbow turned over were not.
NEIGHBOURS, NEAR, FARTHER = 6, 0.05, 2.0
PLACED = 6  # joints that a place and a direction of the tool take
NAMED = 6  # poses in a sentence


def inside(cell: "Cell", q: np.ndarray) -> np.ndarray:
    """(n,) bool: whether poses q (n, dof) in rad (m) lie in what was planned.

    That is the box of campaign.toml, the tool's direction where it states positions, and there
    the way in which the planned poses are reached: elbow, wrist and free joints.
    """
    q = np.atleast_2d(q)
    found = cell.workspace.contains(cell.robot, q, BESIDE)
    if cell.workspace.tool_axis is not None:
        some = np.flatnonzero(found)
        for i, features in zip(some, cell.features(q[some]), strict=True):
            found[i] = _reached_as_planned(cell, q[i], features)
    return found


def outside_remark(names: Sequence[str]) -> str:
    """Sentence about the poses that lie outside; "" without any."""
    if not names:
        return ""
    lie = "lies" if len(names) == 1 else "lie"
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return (
        f"{', '.join(names[:NAMED])}{more} {lie} outside the workspace of campaign.toml: sds and "
        f"bands are not to be trusted there."
    )


def _reached_as_planned(cell: "Cell", q: np.ndarray, features: np.ndarray) -> bool:
    """Whether q (dof,) in rad, at features (d,), is on the branch of the poses planned there."""
    from planner.robot.inverse_kinematics import solve  # 0.1 s, which sentences do not need

    robot, spread = cell.robot, slice(cell.spread)
    away = np.linalg.norm(cell.candidates.features[spread] - features, axis=1)
    near = cell.candidates.q[np.argsort(away, kind="stable")[:NEIGHBOURS]]
    allowed = NEAR
    if len(q) > PLACED:
        allowed = max(NEAR, FARTHER * float(np.max(_apart(near, near[0], robot))))
    (rotation,), (position,) = robot.forward_batch(q[None])
    for start in near:
        led = solve(robot, rotation, position, start, restarts=0).q
        if led is not None and _apart(led[None], q, robot)[0] <= allowed:
            return True
    return False


def _apart(poses: np.ndarray, q: np.ndarray, robot: "Robot") -> np.ndarray:
    """(n,) by how much any joint differs from q (dof,) at poses (n, dof); whole turns are none."""
    off = poses - q
    turned = np.abs((off + np.pi) % (2 * np.pi) - np.pi)
    return np.max(np.where(robot.joints.slides, np.abs(off), turned), axis=1)
