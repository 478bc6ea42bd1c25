"""Between which ports was measured, where what hits, chain and readback missed is known."""

import numpy as np

from planner.dynamics.motion import ActualPorts
from planner.measurement.nuisances import (
    ACROSS,
    OF_HAMMER,
    OF_HIT,
    OF_SENSOR,
    OpenNumbers,
    Tolerances,
)


def actual_ports(
    eta: np.ndarray, s: np.ndarray, t: Tolerances, shape: tuple[int, int]
) -> ActualPorts:
    """Where hits and sensors were, and the joints stood, whose numbers eta (n, l) are known.

    They are in sds, as `OpenNumbers` counts them, of FRFs of `shape` (r, c) at s (n, F).
    """
    n, (rows, columns) = len(eta), shape
    numbers = OpenNumbers(OF_HIT * columns, OF_SENSOR * (rows // 3) + OF_HAMMER)
    hit = np.concatenate([np.eye(columns), np.zeros((columns, columns))])
    hit = np.repeat(hit[None], n, axis=0)
    place = np.repeat(np.eye(rows, 2 * rows)[None], n, axis=0)
    matrix = np.repeat(np.eye(rows)[None], n, axis=0)
    missed = eta[:, : numbers.hits].reshape(n, columns, OF_HIT)
    for column in range(columns):
        at = column - column % 3
        first, second = (at + axis for axis in ACROSS[column % 3])
        hit[:, first, column] = t.angle_rad * missed[:, column, 0]
        hit[:, second, column] = t.angle_rad * missed[:, column, 1]
        hit[:, columns + second, column] = -t.offset_m * missed[:, column, 2]
        hit[:, columns + first, column] = t.offset_m * missed[:, column, 3]
    chain = eta[:, numbers.hits : numbers.known]
    for sensor, at in enumerate(range(0, rows, 3)):
        own = chain[:, OF_SENSOR * sensor : OF_SENSOR * (sensor + 1)]
        within = np.where(np.eye(3), t.gain, t.across) * own[:, :9].reshape(-1, 3, 3)
        matrix[:, at : at + 3, at : at + 3] += within
        for axis, (first, second) in enumerate(ACROSS):
            place[:, at + first, rows + at + second] = t.position_m * own[:, 9 + axis]
            place[:, at + second, rows + at + first] = -t.position_m * own[:, 9 + axis]
    scale = (1 + t.force_gain * chain[:, -2:-1]) * np.exp(-t.delay_s * chain[:, -1:] * s)
    angle = np.asarray(t.joint_rad) * eta[:, numbers.known :]
    return ActualPorts(hit, place, matrix, scale, angle)
