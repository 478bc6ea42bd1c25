"""Inverse kinematics that says why a pose cannot be reached."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from planner.robot.collision import Collisions
from planner.robot.robot import Robot

TOLERANCE = 1e-6  # m and rad
DAMPING = 1e-3
ITERATIONS, STALLED = 60, 12  # of a descent; without progress, after which it is given up


@dataclass(frozen=True, eq=False)
class InverseResult:
    """Joint angles (dof,) in rad (slides: m), or None with the reason in words."""

    q: np.ndarray | None
    reason: str = ""


def solve(
    robot: Robot,
    rotation: np.ndarray,
    position_m: np.ndarray,
    start: np.ndarray | None = None,
    collisions: Collisions | None = None,
    restarts: int = 12,
    seed: int = 0,
) -> InverseResult:
    """Angles at which the tcp has the given rotation (3, 3) and position (3,).

    Damped least squares (Wampler 1986) from `start` or the middle of the range, then from random
    starts; the same call gives the same answer. Of what fails, the nearest miss is reported:
    contact before limit before reach.
    """
    beyond = float(np.linalg.norm(np.asarray(position_m) - robot.shoulder_m)) - robot.reach_m
    if beyond > TOLERANCE:
        return _unreached(beyond)
    target = pin.SE3(np.asarray(rotation, dtype=float), np.asarray(position_m, dtype=float))
    rng = np.random.default_rng(seed)
    at = robot.middle_rad if start is None else np.asarray(start, dtype=float)
    contact = limit = ""
    miss_m = np.inf
    for attempt in range(restarts + 1):
        if attempt:
            at = rng.uniform(robot.lower_rad, robot.upper_rad)
        q, error_m = _descend(robot, target, at, bounded=True)
        if q is None and not contact and (restarts or not limit):
            q, broken = _beyond_limits(robot, target, at)
            limit = limit or broken
            # A warm start alone is meant to stay on its branch: no turning around the limits.
            q = q if restarts else None
        if q is not None:
            contacts = collisions.contacts(q) if collisions else ()
            if not contacts:
                return InverseResult(q)
            contact = contact or contacts[0]
        miss_m = min(miss_m, error_m)
    return InverseResult(None, contact or limit) if contact or limit else _unreached(miss_m)


def singularity(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Distance (n,) from singular poses of q (n, dof) in rad; 0 at one.

    Least singular value of the tcp's Jacobian, its linear part, and what slides, in units of
    the arm's length.
    """
    arm = robot.arm_m or 1.0  # of a gantry whose joints all meet in one point
    scale = np.repeat([1 / arm, 1.0], 3)[:, None] * np.where(robot.joints.slides, arm, 1.0)
    return np.array([np.linalg.svd(scale * robot.jacobian(row), compute_uv=False)[-1] for row in q])


def _unreached(miss_m: float) -> InverseResult:
    return InverseResult(
        None, f"out of reach: the tool comes no closer than {miss_m:.3f} m in this orientation"
    )


def _beyond_limits(
    robot: Robot, target: pin.SE3, start: np.ndarray
) -> tuple[np.ndarray | None, str]:
    """A solution found without minding the limits, if whole turns bring it within them.

    Otherwise None and the first limit that it would break; "" if there is no solution at all.
    """
    q, _ = _descend(robot, target, start, bounded=False)
    if q is None:
        return None, ""
    whole = 2 * np.pi * np.round((q - robot.middle_rad) / (2 * np.pi))
    q = q - np.where(robot.linkage.comes_round(robot.tool_chain), whole, 0.0)
    broken = Collisions(robot).limits(q)
    return (None, broken[0]) if broken else (q, "")


def _descend(
    robot: Robot, target: pin.SE3, start: np.ndarray, bounded: bool
) -> tuple[np.ndarray | None, float]:
    """Solution or None, and the position error left (m)."""
    q, damping = start.copy(), DAMPING
    best, since, at = np.inf, 0, robot.placement(q)
    for _ in range(ITERATIONS):
        error = pin.log6(at.actInv(target)).vector
        size = float(np.linalg.norm(error))
        if size < TOLERANCE:
            return q, 0.0
        damping = max(damping * 0.3, 1e-6) if size < best else min(damping * 10, 1.0)
        since = 0 if size < 0.999 * best else since + 1
        best = min(best, size)
        if since == STALLED:
            break
        jacobian = robot.jacobian(q)
        step = _step(jacobian, error, damping)
        if bounded:
            # Joints pushed against a limit are taken out, and the step is found without them.
            free = ~(((q <= robot.lower_rad) & (step < 0)) | ((q >= robot.upper_rad) & (step > 0)))
            if not free.all():
                step = np.where(free, _step(jacobian * free, error, damping), 0.0)
        longest = float(np.max(np.abs(step)))
        q = q + step * min(1.0, 0.5 / max(longest, 1e-12))
        if bounded:
            q = np.clip(q, robot.lower_rad, robot.upper_rad)
        at = robot.placement(q)
    return None, float(np.linalg.norm(target.translation - at.translation))


def _step(jacobian: np.ndarray, error: np.ndarray, damping: float) -> np.ndarray:
    gram = jacobian @ jacobian.T
    gram[np.diag_indices(6)] += damping
    return jacobian.T @ np.linalg.solve(gram, error)
