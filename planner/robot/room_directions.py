"""Which way the axes of the tool point in the room, for whoever stands there with a hammer."""

import numpy as np

from planner.robot.robot import Robot

# Share of an axis from which a direction is named: within 60° of it, so that what lies between two
# is named by both.
NAMED = 0.5


def axes_in_the_room(robot: Robot, q: np.ndarray) -> tuple[str, str, str]:
    """Of +x, +y and +z of the tcp frame, in words, at q (dof,) in rad (m).

    "away from the base" and "towards the base" are level, left and right as seen from the base.
    """
    rotation, place = robot.forward(q)
    turning = zip(robot.joint_places(q), robot.joints.slides, strict=True)
    base = next((foot for (foot, _), slides in turning if not slides), np.zeros(3))
    up = -np.asarray(robot.config.gravity, dtype=float)
    up = up / np.linalg.norm(up) if np.any(up) else np.array([0.0, 0.0, 1.0])
    level = place - base - ((place - base) @ up) * up
    if np.linalg.norm(level) < 1e-3:  # straight above the base nothing is away from it
        level = np.array([1.0, 0.0, 0.0]) - up[0] * up
    away = level / max(np.linalg.norm(level), 1e-9)
    named = (
        (up, "up", "down"),
        (away, "away from the base", "towards the base"),
        (np.cross(up, away), "left", "right"),
    )

    def words(axis: np.ndarray) -> str:
        parts = [(float(axis @ way), *ends) for way, *ends in named]
        said = [more if part > 0 else less for part, more, less in parts if abs(part) > NAMED]
        return " and ".join(said)

    x, y, z = (words(rotation[:, k]) for k in range(3))
    return x, y, z
