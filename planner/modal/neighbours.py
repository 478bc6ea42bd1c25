"""How points should move in a mode, from how those around them do.

Where only references that a mode leaves at rest felt a point, FRFs do not say how it moves: that
of its neighbours, whose motions are known, is then the best guess.
"""

from collections.abc import Sequence

import numpy as np

from planner.modal.motion_fields import NUGGET, motion_fields
from planner.recording.dof import Dof
from planner.recording.geometry import Geometry

KNOWN = 0.1  # a point is known whose sd is less than this share of the mode's usual motion
LEAST_KNOWN = 8  # degrees of freedom, that foretell others
LEAST_AROUND = 0.05  # of the mean square, that points are taken to move by around any point


def expected(
    dofs: Sequence[Dof], shapes: np.ndarray, sds: np.ndarray, geometry: Geometry | None
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance (n, m) of complex motions of all points, each from the others.

    Shapes (n, m), sds (n, m) of real and imaginary part each. Without neighbours points move about
    as far as those of the well determined half, either way.
    """
    certain = np.abs(shapes) / np.maximum(sds, 1e-300)
    half = certain >= np.median(certain, axis=0)
    square = np.where(half, np.abs(shapes) ** 2, 0.0)
    power = np.sum(square, axis=0) / np.sum(half, axis=0)
    mean, variance = np.zeros(shapes.shape, complex), np.tile(power, (len(shapes), 1))
    if geometry is None:
        return mean, variance
    index = np.array([k for k, dof in enumerate(dofs) if geometry.at(dof.node) is not None], int)
    if index.size <= LEAST_KNOWN:
        return mean, variance
    fields = motion_fields([dofs[k] for k in index], geometry)
    for k in range(shapes.shape[1]):
        size = np.sqrt(power[k])
        motion, sd = shapes[index, k] / size, sds[index, k] / size
        found = _from_neighbours(fields, motion, sd)
        if found is not None:
            unknown = ~_known(motion, sd) & (found[1] < 1)
            mean[index[unknown], k] = found[0][unknown] * size
            variance[index[unknown], k] = found[1][unknown] * power[k]
    return mean, variance


def _from_neighbours(
    fields: Sequence[np.ndarray], motion: np.ndarray, sd: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Mean and variance (n,; ∞: nothing is known) of every point from the known others.

    By the likeliest field. Known points, each left out in turn, tell how far off that is: in
    proportion to how far the points around move, for a mode may move a part of the structure only.
    """
    known = _known(motion, sd)
    if np.count_nonzero(known) < LEAST_KNOWN:
        return None
    best, found = np.inf, None
    square = np.abs(motion[known]) ** 2
    for field in fields:
        noise = NUGGET**2 + 2 * sd[known] ** 2
        precision = np.linalg.inv(field[np.ix_(known, known)] + np.diag(noise))
        cross = field[:, known] @ precision
        mean, single = cross @ motion[known], 1 / np.diag(precision)
        variance = np.diag(field) - np.sum(cross * field[:, known], axis=1) + NUGGET**2
        off = precision @ motion[known] * single
        mean[known], variance[known] = motion[known] - off, single
        near = field[:, known] ** 2
        near[known, np.arange(single.size)] = 0.0
        weight, usual = np.sum(near, axis=1), np.full(len(near), np.mean(square))
        around = np.divide(near @ square, weight, out=usual.copy(), where=weight > 0)
        variance *= around + LEAST_AROUND * usual
        scale = float(np.mean(np.abs(off) ** 2 / variance[known]))
        unlikely = np.sum(np.log(variance[known])) + single.size * np.log(max(scale, 1e-300))
        if unlikely < best:
            # Whom no known point is related to, nothing is foretold of.
            best, found = float(unlikely), (mean, np.where(weight > 0, scale * variance, np.inf))
    if found is not None:
        # What was measured, as far as it was, may say that this point is not like the others.
        found = found[0], np.maximum(found[1], np.abs(motion - found[0]) ** 2 - 2 * sd**2)
    return found


def _known(motion: np.ndarray, sd: np.ndarray) -> np.ndarray:
    """(n,) bool: points whose motion, relative to the mode's usual one, is well measured."""
    return sd < KNOWN * np.maximum(np.abs(motion), 1.0)
