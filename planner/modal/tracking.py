"""Following each mode through the workspace: one label per mode over all measured poses.

Modes are first put in the order of frequency, then named from pose to pose (`names`). What a
label should look like at a pose comes from a guide (the simulation's frequency and shape there)
and from the poses labelled so far: the log ratio of measured to guided frequency is
smooth over the workspace (kriging, leaving the pose itself out), shapes resemble those of the
neighbours (carried over by the rotation that the guide's shapes undergo), damping that of all
poses. A mode may be missing at a pose, unexpected, or change places with another; the
probabilities sum over all matchings.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from planner.inference import triangular
from planner.inference.assignment import least_cost
from planner.modal.mac import mac_matrix
from planner.modal.mode_matching import best, chances, mixture, name_chances
from planner.modal.modes import Mode

# Log frequency: how far an unfitted guide may be off, by how much its error varies over the
# workspace, and what is left between neighbours; the distance over which it varies (per √d).
OFFSET_SD, VARIATION_SD, LOCAL_SD, LENGTH = 0.25, 0.08, 0.01, 0.4
# Odds, in units of −2 log likelihood, of an expected mode that was not found and of a measured
# mode that nobody expects; and the weight of 1 − MAC beside squared standard deviations.
MISSING_COST, UNEXPECTED_COST, SHAPE_WEIGHT = 9.0, 9.0, 8.0


@dataclass(frozen=True, eq=False)
class Guide:
    """What is expected: frequency_hz (n, k) and shape (n, k, 3) of k labels at n poses.

    NaN where a label does not exist. Columns are labels, in any order of frequency; a label
    may cross others from pose to pose. At pose `reference` labels are named after the columns.
    """

    frequency_hz: np.ndarray
    shape: np.ndarray
    reference: int = 0

    @classmethod
    def by_example(cls, poses: Sequence[Sequence[Mode]], labels: int | None = None) -> "Guide":
        """Without a simulation the pose with the most modes says what there is everywhere."""
        reference = max(range(len(poses)), key=lambda i: len(poses[i]))
        example = poses[reference][:labels]
        count = len(example) if labels is None else labels
        frequency, shape = np.full(count, np.nan), np.full((count, 3), np.nan + 0j)
        frequency[: len(example)] = [mode.frequency_hz for mode in example]
        shape[: len(example)] = [mode.shape for mode in example]
        n = len(poses)
        return cls(np.tile(frequency, (n, 1)), np.tile(shape, (n, 1, 1)), reference)


@dataclass(frozen=True, eq=False)
class Tracks:
    """Labelled modes of n poses.

    `modes[i][k]` is the mode that carries label k at pose i, None where it was not found;
    `probability` (n, k) that this is right; `unexpected[i]` are modes without a label.
    """

    modes: tuple[tuple[Mode | None, ...], ...]
    probability: np.ndarray
    unexpected: tuple[tuple[Mode, ...], ...]

    @property
    def frequency_hz(self) -> np.ndarray:
        """(n, k), NaN where a label was not found."""
        rows = [[np.nan if m is None else m.frequency_hz for m in row] for row in self.modes]
        return np.array(rows, dtype=float).reshape(self.probability.shape)


def track(
    poses: Sequence[Sequence[Mode]], guide: Guide, x: np.ndarray, ordered: bool = False
) -> Tracks:
    """Label the modes of n poses at x (n, d), in coordinates scaled to the workspace.

    With `ordered`, labels are places in the order of frequency, which is continuous over the
    workspace even where modes cross, and keep that order; the guide's columns must do so too.
    """
    if ordered or not len(poses):
        return _matched(poses, guide, x, ordered)
    # Places in the order of frequency first, then which label each place carries
    order = np.argsort(guide.frequency_hz, axis=1, kind="stable")  # NaN comes last
    rows, labels = np.arange(len(poses))[:, None], np.arange(order.shape[1])
    ranked = replace(
        guide, frequency_hz=guide.frequency_hz[rows, order], shape=guide.shape[rows, order]
    )
    placed = _matched(poses, ranked, x, ordered=True)
    chance = name_chances(placed.modes, np.argsort(order, axis=1), x, guide.reference)
    place = np.array([least_cost(-c)[1] for c in chance])
    sure = placed.probability[rows, place]
    modes = [tuple(row[b] for b in p) for row, p in zip(placed.modes, place, strict=True)]
    rest = list(placed.unexpected)
    # Where a mode is missing below one that was found, its place is doubtful: there the guide's
    # families decide.
    gaps = [
        i for i, row in enumerate(placed.modes)
        if any(now is None and later is not None for now, later in pairwise(row))
    ]  # fmt: skip
    if gaps:
        free = _matched(poses, guide, x, ordered=False)
        sure[gaps] = free.probability[gaps]
        for i in gaps:
            modes[i], rest[i] = free.modes[i], free.unexpected[i]
    return Tracks(tuple(modes), sure * chance[rows, labels, place], tuple(rest))


def _matched(poses: Sequence[Sequence[Mode]], guide: Guide, x: np.ndarray, ordered: bool) -> Tracks:
    expected = np.log(guide.frequency_hz)
    each = zip(poses, guide.frequency_hz, guide.shape, strict=True)
    chosen = [_first(*one) for one in each]
    seen: list[list[np.ndarray]] = [chosen]
    certain = np.ones(expected.shape)
    for _ in range(8):  # rounds at most
        gains = _gains(poses, chosen, certain, guide, x)
        chosen = [best(gain, ordered) for gain in gains]
        chance = [chances(gain, ordered) for gain in gains]
        # Of no mode (−1) the last column tells.
        both = zip(chance, chosen, strict=True)
        certain = np.array([c[np.arange(len(row)), row] for c, row in both])
        if any(all(map(np.array_equal, chosen, before)) for before in seen):
            break
        seen.append(chosen)
    both = list(zip(poses, chosen, strict=True))
    labelled = (tuple(None if j < 0 else modes[j] for j in row) for modes, row in both)
    rest = (tuple(m for j, m in enumerate(modes) if j not in row) for modes, row in both)
    return Tracks(tuple(labelled), certain.reshape(expected.shape), tuple(rest))


def _first(modes: Sequence[Mode], expected_hz: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Labels in the guide's order of frequency at this pose: it holds nearly everywhere."""
    order = np.argsort(expected_hz)[: np.count_nonzero(np.isfinite(expected_hz))]
    chosen = np.full(len(expected_hz), -1)
    if not len(modes) or not len(order):
        return chosen
    ranked = np.argsort([mode.frequency_hz for mode in modes], kind="stable")
    log_hz, own = _log_hz([modes[j] for j in ranked])
    cost = (log_hz - np.log(expected_hz[order, None])) ** 2 / (OFFSET_SD**2 + own**2)
    measured = np.array([modes[j].shape for j in ranked])
    cost += SHAPE_WEIGHT * (1 - mac_matrix(shape[order], measured))
    gain = MISSING_COST + _unexpected_cost([modes[j] for j in ranked]) - cost
    found = best(gain, ordered=True)
    chosen[order[found >= 0]] = ranked[found[found >= 0]]
    return chosen


def _gains(
    poses: Sequence[Sequence[Mode]], chosen: list[np.ndarray], certain: np.ndarray, guide: Guide,
    x: np.ndarray,
) -> list[np.ndarray]:  # fmt: skip
    """(k, modes) of each pose: what each match is better than leaving both unmatched.

    What is expected at a pose is from labels chosen at the others, how certain (n, k) they are.
    """
    expected = np.log(guide.frequency_hz)
    log_hz, own, damping = (np.full(expected.shape, np.nan) for _ in range(3))
    shape = np.full((*expected.shape, 3), np.nan + 0j)
    for i, (modes, row) in enumerate(zip(poses, chosen, strict=True)):
        for label in np.flatnonzero(row >= 0):
            mode = modes[row[label]]
            log_hz[i, label] = np.log(mode.frequency_hz)
            own[i, label] = mode.frequency_sd_hz / mode.frequency_hz
            damping[i, label] = np.log(max(mode.damping_ratio, 1e-6))
            shape[i, label] = mode.shape
    ratio, sd = _kriged(log_hz - expected, own, certain, x)
    both = zip(damping.T, np.isfinite(damping).T, strict=True)
    middle = np.array([np.median(c[f]) if f.any() else np.nan for c, f in both])
    shapes = mixture(shape, certain, guide.shape, x, LENGTH)
    each = zip(poses, expected + ratio, sd, shapes, strict=True)
    return [_gain(*there, middle) for there in each]


def _gain(
    modes: Sequence[Mode], expected: np.ndarray, sd: np.ndarray, shapes: np.ndarray,
    log_damping: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """(k, modes) of one pose, from expected log frequencies (k,) and shapes (k, 3, 3) as s sᴴ."""
    if not len(modes):
        return np.zeros((len(expected), 0))
    log_hz, own = _log_hz(modes)
    spread = sd[:, None] ** 2 + own**2
    # The sharper the expectation, the less likely is a stranger to meet it.
    # Typical sd of log frequency, for which the cost of a missing mode was chosen
    cost = (log_hz - expected[:, None]) ** 2 / spread + np.log(spread / 0.1**2)
    zeta = np.log([max(mode.damping_ratio, 1e-6) for mode in modes])
    # Damping sd of log damping ratio around a label's median
    cost += np.nan_to_num((zeta - log_damping[:, None]) / 0.6) ** 2
    shape = np.array([mode.shape for mode in modes])
    known = np.isfinite(shape).all(axis=1)
    shape[~known] = 1.0
    shape = shape / np.linalg.norm(shape, axis=1, keepdims=True)
    alike = np.einsum("mi,kij,mj->km", shape.conj(), shapes, shape).real
    # Of a mode whose shape was not said: as directions without preference are on average.
    cost += SHAPE_WEIGHT * (1 - np.where(known, alike, 1 / 3))
    return np.where(np.isfinite(cost), MISSING_COST + _unexpected_cost(modes) - cost, -np.inf)


def _log_hz(modes: Sequence[Mode]) -> tuple[np.ndarray, np.ndarray]:
    """Log frequencies and their sds."""
    hz, sd = np.array([(mode.frequency_hz, mode.frequency_sd_hz) for mode in modes]).T
    return np.log(hz), np.nan_to_num(sd / hz)


def _unexpected_cost(modes: Sequence[Mode]) -> np.ndarray:
    """Of measured modes that nobody expects: the higher, the surer they are modes."""
    chance = np.clip([mode.probability for mode in modes], 1e-3, 1 - 1e-3)
    return UNEXPECTED_COST + 2 * np.log(chance / 0.9)


def _kriged(
    ratio: np.ndarray, own_sd: np.ndarray, certain: np.ndarray, x: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and sd (n, k) of the log ratio at every pose from all others (Dubrule 1983)."""
    n, k = ratio.shape
    distance = np.linalg.norm(x[:, None] - x[None], axis=2) / (LENGTH * max(1, x.shape[1]) ** 0.5)
    prior = OFFSET_SD**2 + VARIATION_SD**2 * np.exp(-(distance**2) / 2)
    mean, variance = np.zeros((n, k)), np.zeros((n, k))
    for label in range(k):
        measured = np.isfinite(ratio[:, label])
        known, unknown = np.flatnonzero(measured), np.flatnonzero(~measured)
        noise = LOCAL_SD**2 + np.nan_to_num(own_sd[known, label]) ** 2
        # A label that may be wrong counts less for the others.
        noise = noise / np.maximum(certain[known, label], 1e-3) ** 2
        white = triangular.inverse(np.linalg.cholesky(prior[np.ix_(known, known)] + np.diag(noise)))
        y, precision = ratio[known, label], np.sum(white**2, axis=0)
        weights = white.T @ (white @ y)
        mean[known, label] = y - weights / precision
        variance[known, label] = 1 / precision - noise
        cross = prior[np.ix_(unknown, known)]
        mean[unknown, label] = cross @ weights
        spared = np.sum((white @ cross.T) ** 2, axis=0)
        variance[unknown, label] = np.diagonal(prior)[unknown] - spared
    return mean, np.sqrt(np.maximum(variance, 0.0) + LOCAL_SD**2)
