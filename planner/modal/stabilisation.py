"""Stabilisation diagram over model orders and the poles that stay put in it."""

from dataclasses import dataclass

import numpy as np

from planner.modal.plscf import PoleSet

# One order to the next a physical pole moves less than this (share of its frequency, of its own
# bandwidth, and 1 − MAC of its participation).
FREQUENCY_STEP, BANDWIDTH_STEP, MAC_STEP = 0.01, 1.0, 0.3


@dataclass(frozen=True, eq=False)
class Line:
    """One vertical line of the diagram: the same pole in several orders."""

    orders: np.ndarray  # (k,) increasing
    poles: np.ndarray  # (k,)
    participation: np.ndarray  # (k, inputs)
    share: float  # orders present / orders tried since it first appeared

    @property
    def pole(self) -> complex:
        """Median over the upper half of the orders, where bias has died out."""
        late = self.poles[len(self.poles) // 2 :]
        return complex(np.median(late.real), np.median(late.imag))

    @property
    def frequency_hz(self) -> float:
        return float(np.abs(self.pole) / (2 * np.pi))

    @property
    def damping_ratio(self) -> float:
        return float(-self.pole.real / np.abs(self.pole))

    @property
    def scatter(self) -> float:
        """Spread of the pole over the upper half of the orders, relative to its bandwidth."""
        late = self.poles[len(self.poles) // 2 :]
        return float(np.sqrt(np.mean(np.abs(late - self.pole) ** 2)) / abs(self.pole.real))


@dataclass(frozen=True, eq=False)
class Diagram:
    """Poles of all orders and the lines that they form, increasing in frequency."""

    sets: tuple[PoleSet, ...]
    lines: tuple[Line, ...]


def diagram(sets: tuple[PoleSet, ...], band_hz: tuple[float, float]) -> Diagram:
    """Join the poles of increasing orders to lines.

    An order gives at most one pole to a line and each pole to at most one line (nearest pairs
    first), so close modes stay apart. Poles outside `band_hz` or damped more than 30 % are not
    followed.
    """
    growing: list[list[tuple[int, complex, np.ndarray]]] = []
    for index, entry in enumerate(sets):
        poles, participation = _plausible(entry, band_hz)
        # Orders that a pole may be missing before its line counts as ended.
        open_lines = [g for g in growing if index - g[-1][0] <= 3]
        pairs = _pair(open_lines, poles, participation)
        taken = {pole for _, pole in pairs}
        for line, pole in pairs:
            open_lines[line].append((index, poles[pole], participation[pole]))
        growing += [
            [(index, poles[k], participation[k])] for k in range(len(poles)) if k not in taken
        ]
    lines = [_line(g, sets) for g in growing]
    return Diagram(sets, tuple(sorted(lines, key=lambda line: line.frequency_hz)))


def stable(found: Diagram, least: int = 5, share: float = 0.4) -> tuple[Line, ...]:
    """Lines seen in at least `least` orders and in `share` of those since they first appeared."""
    need = min(least, max(2, len(found.sets) // 3))
    return tuple(x for x in found.lines if len(x.orders) >= need and x.share >= share)


def _plausible(entry: PoleSet, band_hz: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    size = np.abs(entry.poles)
    frequency = size / (2 * np.pi)
    keep = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    # Max damping.
    keep &= -entry.poles.real < 0.3 * size
    return entry.poles[keep], entry.participation[keep]


def _pair(lines: list, poles: np.ndarray, participation: np.ndarray) -> list[tuple[int, int]]:
    if not lines or not len(poles):
        return []
    last = np.array([line[-1][1] for line in lines])
    vectors = np.array([line[-1][2] for line in lines])
    distance = np.abs(last[:, None] - poles)
    width = np.maximum(np.abs(last.real)[:, None], np.abs(poles.real))
    mac = np.abs(vectors.conj() @ participation.T) ** 2
    limit = np.maximum(FREQUENCY_STEP * np.abs(last)[:, None], BANDWIDTH_STEP * width)
    close = np.abs(last.imag[:, None] - poles.imag) < FREQUENCY_STEP * np.abs(last)[:, None]
    close |= np.abs(last.imag[:, None] - poles.imag) < 0.3 * width
    ok = close & (distance < limit) & (1 - mac < MAC_STEP)
    cost = np.where(ok, distance / width + (1 - mac), np.inf)
    pairs = []
    while cost.size and np.isfinite(np.min(cost)):
        i, k = np.unravel_index(np.argmin(cost), cost.shape)
        pairs.append((int(i), int(k)))
        cost[i] = np.inf
        cost[:, k] = np.inf
    return pairs


def _line(members: list[tuple[int, complex, np.ndarray]], sets: tuple[PoleSet, ...]) -> Line:
    index = np.array([m[0] for m in members])
    return Line(
        np.array([sets[i].order for i in index]),
        np.array([m[1] for m in members]),
        np.array([m[2] for m in members]),
        len(members) / (len(sets) - int(index[0])),
    )
