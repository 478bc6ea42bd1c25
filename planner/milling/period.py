"""One period of milling as matrices: what chips, then forces, do to the structure.

The structure's state z is carried over exactly; only the force is interpolated, by polynomials
through the points of each element. So both the vibration now and that of the tooth before enter
at these points, and not between: a full discretisation (Ding et al., Int. J. Machine Tools &
Manufacture 50, 2010) whose steps may be of any degree.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.milling.cut import Cut
from planner.milling.cutter_modes import CutterModes
from planner.milling.directional import (
    Engagement,
    directions,
    each_tooth,
    lagrange,
    lobatto,
)


@dataclass(frozen=True, eq=False)
class Period:
    """Matrices of one period over states z (s,), n chips y, v of this and the last one, m forces.

    y = S z₀ + b L (N y − B v) and z₁ = E z₀ + b W (N y − B v), where E is `free`, S `seen`, L
    `reply`, W `push`, N `now`, B `before`; b is the depth. States are real
    parts of the modes', then imaginary ones. `time_s`, `weight_s` and `force` (m, 2) are of the
    points at which forces act.
    """

    duration_s: float
    free: np.ndarray
    seen: np.ndarray
    reply: np.ndarray
    push: np.ndarray
    now: np.ndarray
    before: np.ndarray
    time_s: np.ndarray
    weight_s: np.ndarray
    force: np.ndarray

    def monodromy(self, depths: np.ndarray) -> np.ndarray:
        """(B, s + n, s + n): (z, v) one period later, at depths (B,) in m."""
        b = np.asarray(depths, dtype=float)[:, None, None]
        states, chips = len(self.free), len(self.seen)
        start = np.broadcast_to(self.seen, (len(b), *self.seen.shape))
        solved = np.linalg.solve(
            np.eye(chips) - b * (self.reply @ self.now),
            np.concatenate([start, -b * (self.reply @ self.before)], axis=2),
        )
        found = np.empty((len(b), states + chips, states + chips))
        found[:, states:] = solved
        found[:, :states] = b * (self.push @ self.now @ solved)
        found[:, :states, :states] += self.free
        found[:, :states, states:] -= b * (self.push @ self.before)
        return found

    def forces(self, vector: np.ndarray, multiplier: complex, depth: float) -> np.ndarray:
        """(m,): forces of the vibration that an eigenvector (z, v) of the monodromy stands for."""
        v = vector[len(self.free) :]
        return depth * (self.now @ (multiplier * v) - self.before @ v)


class _Points:
    """Points of all elements, one after another: (p,) angle, time, element and place in it.

    `shared` (p,) numbers them, the same where elements meet without a jump; `rows` (p, 2) are of
    their chips, `columns` (p, 2) of their forces.
    """

    def __init__(
        self, found: Engagement, cut: Cut, speed: float, degree: int, depth_m: float
    ) -> None:
        nodes, *_ = lobatto(degree)
        parts: list[tuple[np.ndarray, ...]] = []
        number = -1
        for e, teeth in enumerate(found.teeth):
            angle = found.start[e] + nodes * (found.end[e] - found.start[e])
            rows, columns = directions(cut, teeth, angle + found.offset, depth_m)
            if not cut.even:
                rows = columns = np.broadcast_to(np.eye(2), (len(nodes), 2, 2))
            rank = rows.shape[1]
            joined = e > 0 and found.segment[e] == found.segment[e - 1]
            first = number + 1 - rank if joined else number + 1
            count = rank * len(nodes)
            number = first + count - 1
            parts.append((
                np.repeat(angle, rank), np.full(count, e), np.repeat(np.arange(len(nodes)), rank),
                first + np.arange(count), rows.reshape(-1, 2),
                columns.transpose(0, 2, 1).reshape(-1, 2),
            ))  # fmt: skip
        self.angle, self.element, self.place, self.shared, self.rows, self.columns = map(
            np.concatenate, zip(*parts, strict=True)
        )
        self.time = self.angle / speed


def period(
    modes: CutterModes, cut: Cut, rpm: float, degree: int, element_rad: float, depth_m: float
) -> Period:
    """Of modes in the cut's plane at a speed, by polynomials of a degree on elements.

    `element_rad` is the longest element; `depth_m` counts where the cutter has a helix.
    """
    speed = rpm * 2 * np.pi / 60
    found = Engagement(cut, depth_m, element_rad)
    points = _Points(found, cut, speed, degree, depth_m)
    built = _build(modes, found, points, speed, degree)
    return built if cut.even else _uneven(built, found, points, cut, degree, depth_m)


def _build(
    modes: CutterModes, found: Engagement, points: _Points, speed: float, degree: int
) -> Period:
    duration = found.period / speed
    length, end = (found.end - found.start) / speed, found.end / speed
    seen = 2 * modes.shapes @ points.rows.T  # (k, p); a pole stands for a pair
    drive = modes.drives @ points.columns.T
    part = _integrals(modes.poles, length, degree)  # (k, e, i, j)
    whole = part[:, points.element, -1, points.place] * drive  # (k, p): at the element's end
    later = points.element[:, None] > points.element[None, :]
    since = np.where(later, points.time[:, None] - end[points.element][None, :], 0.0)
    reply = np.einsum("ki,kij,kj->ij", seen, np.exp(modes.poles[:, None, None] * since), whole).real
    reply *= later
    own = points.element[:, None] == points.element[None, :]
    i, j = np.nonzero(own)
    inner = part[:, points.element[i], points.place[i], points.place[j]]
    reply[i, j] = np.einsum("kp,kp,kp->p", seen[:, i], inner, drive[:, j]).real
    at_once = own & (points.place[:, None] == points.place[None, :])
    reply += at_once * (points.rows @ modes.residual @ points.columns.T)
    to_end = np.exp(modes.poles[:, None] * (duration - end[points.element])) * whole
    over = seen * np.exp(modes.poles[:, None] * points.time)
    first, together = _joined(points.shared)
    whole_rule = lobatto(degree)[2][-1].sum(axis=0)
    e = np.exp(modes.poles * duration)  # of states as real and imaginary parts
    return Period(
        duration_s=float(duration),
        free=np.block([[np.diag(e.real), -np.diag(e.imag)], [np.diag(e.imag), np.diag(e.real)]]),
        seen=np.concatenate([over.real, -over.imag]).T[first],
        reply=reply[first] @ together,
        push=np.concatenate([to_end.real, to_end.imag]) @ together,
        now=np.eye(len(first)),
        before=np.eye(len(first)),
        time_s=points.time[first],
        weight_s=(whole_rule[points.place] * length[points.element]) @ together,
        force=points.columns[first],
    )


def _integrals(poles: np.ndarray, length_s: np.ndarray, degree: int) -> np.ndarray:
    """(k, e, i, j): state at point i of an element from the polynomial of point j."""
    nodes, points, values = lobatto(degree)
    span = nodes * length_s[:, None]  # (e, i)
    decay = np.exp(poles[:, None, None, None] * span[..., None] * (1 - points))
    return np.einsum("keiq,iqj->keij", decay, values) * span[None, ..., None]


def _joined(shared: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Index (n,) of each point's first appearance, and (p, n) that adds those of a shared one."""
    numbers, first, which = np.unique(shared, return_index=True, return_inverse=True)
    together = np.zeros((len(shared), len(numbers)))
    together[np.arange(len(shared)), which] = 1.0
    return first, together


def _uneven(
    built: Period, found: Engagement, points: _Points, cut: Cut, degree: int, depth_m: float
) -> Period:
    """The same where teeth follow at different angles: each has a delay of its own.

    What the tooth before left is interpolated in the element that it was left in.
    """
    first, _ = _joined(points.shared)
    now = np.zeros((len(first), len(first)))
    before = np.zeros_like(now)
    angle, element = points.angle[first], points.element[first]
    delay = cut.pitches_rad  # to the tooth ahead, which cut before
    nodes, *_ = lobatto(degree)
    for p in range(0, len(first), 2):
        for tooth in found.teeth[element[p]]:
            matrix = each_tooth(cut, tooth, angle[p : p + 1] + found.offset, depth_m)[0]
            now[p : p + 2, p : p + 2] += matrix
            at = angle[p] - delay[tooth]
            target, turn = (now, -1.0) if at >= -1e-9 else (before, 1.0)
            at = at if at >= -1e-9 else at + found.period
            inside = (found.start <= at + 1e-9) & (at <= found.end + 1e-9)
            e = int(np.argmax(inside))
            share = (at - found.start[e]) / (found.end[e] - found.start[e])
            values = lagrange(nodes, np.array(share))
            own = np.unique(points.shared[points.element == e])
            for n, value in enumerate(values):
                to = own[2 * n : 2 * n + 2]
                target[p : p + 2, to] += turn * value * matrix
    return replace(built, now=now, before=before)
