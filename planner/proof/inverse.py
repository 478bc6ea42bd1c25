"""Joint angles for a placement of the tool, on MuJoCo's kinematics."""

import numpy as np

from planner.proof.model import Truth

STEPS, TOLERANCE = 300, 1e-11
LONGEST_STEP_RAD = 0.2


def tool_rotation(tool_axis: np.ndarray, rotation_rad: float = 0.0) -> np.ndarray:
    """Rotation (3, 3) of a tcp whose z axis is `tool_axis` (world).

    At rotation 0 the tcp's x axis is the world's, projected onto the plane normal to the tool
    (the world's y where the tool points along x).
    """
    z = np.asarray(tool_axis, dtype=float) / np.linalg.norm(tool_axis)
    reference = np.eye(3)[1 if abs(z[0]) > 1 - 1e-9 else 0]
    x = reference - (reference @ z) * z
    x /= np.linalg.norm(x)
    x = np.cos(rotation_rad) * x + np.sin(rotation_rad) * np.cross(z, x)
    return np.column_stack([x, np.cross(z, x), z])


def joint_angles(
    truth: Truth,
    rotation: np.ndarray,
    position_m: np.ndarray,
    start: np.ndarray,
    upper_rad: np.ndarray | None = None,
) -> np.ndarray | None:
    """Angles (dof,) in rad that bring the tcp to `rotation` (3, 3), `position_m` (3,), or None.

    Damped least squares from `start`, kept between the joint limits, of which the upper ones can be
    narrowed to hold on to one branch of solutions.
    """
    lower = truth.lower_rad
    upper = truth.upper_rad if upper_rad is None else upper_rad
    q = np.clip(np.asarray(start, dtype=float), lower, upper)
    error = np.full(6, np.inf)
    for _ in range(STEPS):
        here, place, jacobian = truth.tcp(q)
        turn = rotation @ here.T
        sine = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        angle = np.arctan2(np.linalg.norm(sine), np.trace(turn) - 1)
        axis = sine / max(np.linalg.norm(sine), 1e-300)
        error = np.concatenate([position_m - place, axis * angle])
        if np.linalg.norm(error) < TOLERANCE:
            return q
        # Less damping near the solution: quadratic convergence there, calm far away.
        damping = 0.05 * min(1.0, np.linalg.norm(error)) ** 2
        step = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + damping * np.eye(6), error)
        step *= min(1.0, LONGEST_STEP_RAD / max(np.max(np.abs(step)), 1e-300))
        q = np.clip(q + step, lower, upper)
    return None
