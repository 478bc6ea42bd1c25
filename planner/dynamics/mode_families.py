"""Families: simulated modes followed from pose to pose by their shapes, not by their order.

Where two modes of different shape cross, their order of frequency swaps and their families do
not. Shapes are those of all elastic degrees of freedom, weighted by mass, so that they tell
modes apart that look alike at the tool.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from planner.dynamics.vibration import SimulatedModes, normal_modes, picked
from planner.inference.assignment import least_cost

# Between poses whose shapes are compared. Modes that exchange their shapes over less than this
# are taken to cross; over more, to veer and keep their order. In longer steps veering looks like
# crossing, and two robots that are nearly alike would be followed differently.
STEP_RAD = 0.02
LEAST_HZ = 1e-3  # stands for a mode that has no frequency: gravity is stronger than the springs
FREQUENCY_STEP = 0.3  # of log frequency in one step: as unlikely as a shape unlike the one before

Modes = tuple[np.ndarray, np.ndarray, np.ndarray]  # of `undamped_modes`
Undamped = Callable[[np.ndarray], Modes]


class Families:
    """Families of modes, numbered by their order of frequency at a reference pose.

    `undamped(q)` gives the mass-normalised undamped modes of poses q (n, dof), lowest first:
    frequencies (n, e) in Hz, shapes (n, e, e), one mode a column, and mass matrices (n, e, e).
    """

    def __init__(self, reference: np.ndarray, poses: np.ndarray, undamped: Undamped):
        """Follow the families from `reference` (dof,) over `poses` (n, dof), in rad.

        They are followed in steps of STEP_RAD along the minimum spanning tree of those poses
        that are at least as far apart.
        """
        from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree  # 0.2 s

        self._undamped = undamped
        self._hubs = _hubs(np.vstack([reference, poses]))
        distance = np.linalg.norm(self._hubs[:, None] - self._hubs[None], axis=2)
        order, parent = breadth_first_order(minimum_spanning_tree(distance), 0, directed=False)
        self._net = undamped(self._hubs)
        self._places = np.tile(np.arange(self._net[0].shape[1]), (len(self._hubs), 1))
        ends = self._hubs[order[1:]]
        for i, turn in zip(order[1:], self._turns(parent[order[1:]], ends), strict=True):
            self._places[i] = turn[self._places[parent[i]]]

    def places(self, q: np.ndarray) -> np.ndarray:
        """(n, e): place in the order of frequency that every family has at q (n, dof) in rad."""
        hub = np.argmin(np.linalg.norm(q[:, None] - self._hubs[None], axis=2), axis=1)
        turns = self._turns(hub, q)
        return np.array([turn[self._places[h]] for h, turn in zip(hub, turns, strict=True)])

    def _turns(self, hub: np.ndarray, ends: np.ndarray) -> list[np.ndarray]:
        """For each pose and each mode of its hub, the mode that this has become on the way."""
        if not len(ends):
            return []
        paths = [_path(self._hubs[h], end) for h, end in zip(hub, ends, strict=True)]
        stops = np.cumsum([0, *[len(path) for path in paths]])
        way = self._undamped(np.vstack(paths))
        turns = []
        for h, first, last in zip(hub, stops[:-1], stops[1:], strict=True):
            turn = _follow(self._net, h, way, first)
            for before, after in pairwise(range(first, last)):
                turn = _follow(way, before, way, after)[turn]
            turns.append(turn)
        return turns


def _hubs(poses: np.ndarray) -> np.ndarray:
    """The first pose, and of the others those at least STEP_RAD from all chosen before."""
    chosen = poses[:1]
    for pose in poses[1:]:
        if np.min(np.linalg.norm(chosen - pose, axis=1)) >= STEP_RAD:
            chosen = np.vstack([chosen, pose])
    return chosen


def _path(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Poses after `start` up to `end`."""
    count = max(1, round(float(np.linalg.norm(end - start)) / STEP_RAD))
    return start + (end - start) * np.arange(1, count + 1)[:, None] / count


def _follow(a: Modes, i: int, b: Modes, j: int) -> np.ndarray:
    """For each mode of pose i of `a` the one of pose j of `b` that is most like it."""
    (hertz, shape, _), (other_hertz, other_shape, mass) = a, b
    alike = (shape[i].T @ mass[j] @ other_shape[j]) ** 2
    apart = np.log(other_hertz[j] / hertz[i][:, None]) / FREQUENCY_STEP
    return least_cost(apart**2 - alike)[1]


def rearranged(
    modes: SimulatedModes, place: np.ndarray, undamped_hz: np.ndarray, count: int
) -> SimulatedModes:
    """Oscillatory modes (n, m), sorted by frequency, as the first `count` families.

    `place` (n, e) from `Families.places`, undamped_hz (n, e). The family of an overdamped
    mode, which does not oscillate, is NaN.
    """
    partner = np.full((len(place), count), -1)  # of each family, among the damped modes
    for i in range(len(place)):
        damped = np.flatnonzero(np.isfinite(modes.frequency_hz[i]))
        apart = np.log(undamped_hz[i, :, None] / modes.frequency_hz[i, damped])
        rows, columns = least_cost(np.abs(apart))  # the nearest in frequency, one to one
        nearest = np.full(undamped_hz.shape[1], -1)
        nearest[rows] = damped[columns]
        partner[i, : len(nearest)] = nearest[place[i, :count]]
    return picked(modes, partner)


def undamped_modes(mass: np.ndarray, stiffness: np.ndarray) -> Modes:
    """Of M and K (n, e, e): frequencies (n, e), mass-normalised shapes, and M again."""
    square, shapes = normal_modes(mass, stiffness)
    least = (2 * np.pi * LEAST_HZ) ** 2
    return np.sqrt(np.maximum(square, least)) / (2 * np.pi), shapes, mass
