"""Cutting forces by the teeth's angle, and when teeth are in the cut.

A tooth's angle φ is counted from the normal (the cut plane's second axis) towards the feed (its
first), as the spindle turns. Its chip is Δx sin φ + Δy cos φ thick beyond the static one, and its
force on the cutter is −K_t along the cut and −K_r inwards times that (Altintas and Budak, CIRP
Annals 44, 1995). The force jumps where a tooth
enters or leaves; between two such angles it is smooth: elements lie between them, so that
polynomials through the points of an element converge.
"""

from functools import cache
from itertools import pairwise

import numpy as np
from numpy.polynomial import legendre

from planner.milling.cut import Cut

IN_CUT = 1e-9  # rad: what an angle may miss the cut's ends by


def chip_direction(phi: np.ndarray) -> np.ndarray:
    """(..., 2): by how much the chip of a tooth at φ (...) grows per displacement (x, y)."""
    return np.stack([np.sin(phi), np.cos(phi)], axis=-1)


def force_direction(phi: np.ndarray, cut: Cut) -> np.ndarray:
    """(..., 2): force (x, y) on the cutter per area of the chip of a tooth at φ (...), N/m²."""
    s, c, kt, kr = np.sin(phi), np.cos(phi), cut.kt_n_m2, cut.kr_n_m2
    return np.stack([-kt * c - kr * s, kt * s - kr * c], axis=-1)


def mean_matrix(cut: Cut) -> np.ndarray:
    """(2, 2) in N/m²: force per displacement and depth, averaged over a turn of the spindle.

    Neither pitch nor helix changes it.
    """
    start, end = cut.immersion_rad
    return cut.teeth / (2 * np.pi) * (_integral(end, cut) - _integral(start, cut))


def _integral(phi: np.ndarray | float, cut: Cut) -> np.ndarray:
    """(..., 2, 2): ∫ force_direction · chip_directionᵀ dφ from 0 to φ."""
    phi, kt, kr = np.asarray(phi, dtype=float), cut.kt_n_m2, cut.kr_n_m2
    cs, ss = (1 - np.cos(2 * phi)) / 4, phi / 2 - np.sin(2 * phi) / 4
    cc = phi / 2 + np.sin(2 * phi) / 4
    top = np.stack([-kt * cs - kr * ss, -kt * cc - kr * cs], axis=-1)
    low = np.stack([kt * ss - kr * cs, kt * cs - kr * cc], axis=-1)
    return np.stack([top, low], axis=-2)


def tooth_matrix(cut: Cut, tip_rad: np.ndarray, depth_m: float) -> np.ndarray:
    """(..., 2, 2) in N/m²: of one tooth whose tip is at the angles (...), per metre of depth.

    With a helix it is the mean over the depth: its parts lag behind the tip.
    """
    start, end = cut.immersion_rad
    tip = np.asarray(tip_rad, dtype=float)
    lag = cut.lag_rad_m * depth_m
    if lag < IN_CUT:
        inside = (tip >= start - IN_CUT) & (tip <= end + IN_CUT)
        outer = force_direction(tip, cut)[..., :, None] * chip_direction(tip)[..., None, :]
        return np.where(inside[..., None, None], outer, 0.0)
    high, low = np.clip(tip, start, end), np.clip(tip - lag, start, end)
    return (_integral(high, cut) - _integral(low, cut)) / lag


APART = 1e-9  # rad: breakpoints closer than this are one


@cache
def lobatto(degree: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lobatto points (s+1,) of a polynomial of degree s ≥ 1 on [0, 1], and its integrals.

    By Gauss points (q,) of every [0, c_i], as shares of c_i, and the Lagrange polynomials there
    times the weights, (s+1, q, s+1).
    """
    inner = legendre.legroots(legendre.legder([0.0] * degree + [1.0])) if degree > 1 else []
    nodes = (np.concatenate([[-1.0], np.sort(np.real(inner)), [1.0]]) + 1) / 2
    x, w = legendre.leggauss(degree + 12)  # polynomial times an exponential over one element
    x, w = (x + 1) / 2, w / 2
    return nodes, x, lagrange(nodes, nodes[:, None] * x[None, :]) * w[None, :, None]


def lagrange(nodes: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(..., n): the Lagrange polynomials of nodes (n,) at points (...)."""
    at = np.asarray(at)[..., None]
    found = np.ones((*at.shape[:-1], len(nodes)))
    for j, node in enumerate(nodes):
        others = np.delete(nodes, j)
        found[..., j] = np.prod((at - others) / (node - others), axis=-1)
    return found


class Engagement:
    """Elements of one period in which teeth cut, as angles (rad) of the first tooth's tip.

    `start`, `end` (e,): of each element, within [0, `period`] after the first entry. `teeth`: which
    teeth cut in it. `segment` (e,): elements with the same number follow without a jump.
    """

    def __init__(self, cut: Cut, depth_m: float, longest_rad: float) -> None:
        """Elements no longer than `longest_rad`; with a helix they depend on the depth.

        One tooth's period if all teeth follow alike, else a turn of the spindle.
        """
        self.offset, end = cut.immersion_rad
        self.period = 2 * np.pi / cut.teeth if cut.even else 2 * np.pi
        lag = cut.lag_rad_m * depth_m
        ahead = tooth_angles(cut)
        edges = np.array([self.offset, self.offset + lag, end, end + lag])
        breaks = np.mod(edges[None, :] - ahead[:, None] - self.offset, self.period).ravel()
        breaks = np.sort(breaks[(breaks > APART) & (self.period - breaks > APART)])
        apart = breaks[np.diff(breaks, prepend=0.0) > APART]
        found: list[tuple[float, float, tuple[int, ...], int]] = []
        for k, (a, b) in enumerate(pairwise([0.0, *apart.tolist(), self.period])):
            tip = np.mod((a + b) / 2 + ahead, 2 * np.pi) + self.offset
            cutting = tuple(np.flatnonzero(tip < end + lag).tolist())
            if cutting:
                cuts = np.linspace(a, b, 1 + max(1, int(np.ceil((b - a) / longest_rad))))
                found += [(x, y, cutting, k) for x, y in pairwise(cuts)]
        first, last, self.teeth, segment = zip(*found, strict=True)
        self.start, self.end, self.segment = map(np.array, (first, last, segment))


def tooth_angles(cut: Cut) -> np.ndarray:
    """(teeth,): by how much each tooth is ahead of the first one."""
    return np.concatenate([[0.0], np.cumsum(cut.pitches_rad)[:-1]])


def directions(
    cut: Cut, teeth: tuple[int, ...], angle: np.ndarray, depth_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Chip rows (m, r, 2) and force columns (m, 2, r) at tip angles (m,) of the first tooth.

    Force per depth = columns · rows · displacement. r is 1 where one tooth without helix cuts.
    """
    ahead = tooth_angles(cut)
    if len(teeth) == 1 and cut.lag_rad_m == 0:
        phi = angle + ahead[teeth[0]]
        return chip_direction(phi)[:, None, :], force_direction(phi, cut)[:, :, None]
    matrix = sum(each_tooth(cut, j, angle, depth_m) for j in teeth)
    return np.broadcast_to(np.eye(2), (len(angle), 2, 2)), np.asarray(matrix)


def each_tooth(cut: Cut, tooth: int, angle: np.ndarray, depth_m: float) -> np.ndarray:
    """(m, 2, 2) of one tooth that is known to cut, at tip angles (m,) of the first tooth."""
    start, _ = cut.immersion_rad
    phi = np.mod(angle + tooth_angles(cut)[tooth] - start + APART, 2 * np.pi) + start - APART
    # The upper part of a long helix may still cut where the tip came round again.
    turns = 2 * np.pi * np.arange(2 + int(cut.lag_rad_m * depth_m // (2 * np.pi)))
    return tooth_matrix(cut, phi[:, None] + turns, depth_m).sum(axis=1)
