"""Inverse kinematics that says why a pose cannot be reached."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from planner.robot.collision import Collisions
from planner.robot.robot import Robot

TOLERANCE = 1e-6  # m and rad
DAMPING = 1e-3


@dataclass(frozen=True, eq=False)
class InverseResult:
    """Joint angles (dof,) in rad, or None and the reason in words."""

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

    Damped least squares (Wampler 1986) from `start`, the middle of the range, then random
    starts; the same call gives the same answer. Of what fails, the nearest miss is reported:
    contact before limit before reach.
    """
    target = pin.SE3(np.asarray(rotation, dtype=float), np.asarray(position_m, dtype=float))
    rng = np.random.default_rng(seed)
    middle = (robot.lower_rad + robot.upper_rad) / 2
    starts = [middle if start is None else np.asarray(start, dtype=float)]
    contact = limit = ""
    miss_m = np.inf
    for attempt in range(restarts + 1):
        if attempt:
            starts.append(rng.uniform(robot.lower_rad, robot.upper_rad))
        q, error_m = _descend(robot, target, starts[-1], bounded=True)
        if q is not None:
            contacts = collisions.contacts(q) if collisions else ()
            if not contacts:
                return InverseResult(q)
            contact = contact or contacts[0]
            continue
        miss_m = min(miss_m, error_m)
        if not limit and not contact:
            limit = _beyond_limits(robot, target, starts[-1])
    if contact:
        return InverseResult(None, contact)
    if limit:
        return InverseResult(None, limit)
    return InverseResult(None, f"out of reach: the tool comes no closer than {miss_m:.3f} m")


def _beyond_limits(robot: Robot, target: pin.SE3, start: np.ndarray) -> str:
    """Which limit a solution without limits would break; empty if there is none."""
    q, _ = _descend(robot, target, start, bounded=False)
    if q is None:
        return ""
    q = (q + np.pi) % (2 * np.pi) - np.pi
    broken = Collisions(robot).limits(q)
    return broken[0] if broken else ""


def _descend(
    robot: Robot, target: pin.SE3, start: np.ndarray, bounded: bool, iterations: int = 60
) -> tuple[np.ndarray | None, float]:
    """Solution or None, and the position error left (m)."""
    model, data, frame = robot.model, robot._data, robot.tcp_id
    q, damping = start.copy(), DAMPING
    best = np.inf
    for _ in range(iterations):
        pin.framesForwardKinematics(model, data, q)
        error = pin.log6(data.oMf[frame].actInv(target)).vector
        size = float(np.linalg.norm(error))
        if size < TOLERANCE:
            return q, 0.0
        damping = max(damping * 0.3, 1e-6) if size < best else min(damping * 10, 1.0)
        best = min(best, size)
        jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL)
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
    left = float(np.linalg.norm(target.translation - data.oMf[frame].translation))
    return None, left


def _step(jacobian: np.ndarray, error: np.ndarray, damping: float) -> np.ndarray:
    gram = jacobian @ jacobian.T
    gram[np.diag_indices(6)] += damping
    return jacobian.T @ np.linalg.solve(gram, error)
