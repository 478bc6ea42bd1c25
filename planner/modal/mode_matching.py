"""Matching measured modes to labels when either may be absent.

Everything here works on `gain` (labels, modes): what a match is better than a missing label and
an unexpected mode, in units of −2 log likelihood. Ordered matchings keep the order of labels and
modes; free ones may exchange them.
"""

from collections.abc import Sequence

import numpy as np

from planner.inference.assignment import least_cost
from planner.modal.mac import mac
from planner.modal.modes import Mode


def best(gain: np.ndarray, ordered: bool = False) -> np.ndarray:
    """For each label the measured mode that it is, −1 for none; largest total gain.

    Matches that lose are not made.
    """
    if ordered:
        return _best_ordered(gain)
    chosen = np.full(gain.shape[0], -1)
    rows, columns = least_cost(-np.maximum(gain, 0.0))
    chosen[rows] = np.where(gain[rows, columns] > 0, columns, -1)
    return chosen


def chances(gain: np.ndarray, ordered: bool = False) -> np.ndarray:
    """(labels, modes + 1): probability of each label being each mode, or none (last column).

    Sums exp(gain/2) over all matchings, not only the best: forward and backward through the labels,
    with a state for what is taken, the last mode in order or else a subset of the modes.
    """
    labels, modes = gain.shape
    out = np.zeros((labels, modes + 1))
    columns = np.arange(modes)
    if not ordered:  # over subsets of the likeliest modes, none that are hopeless (odds of 2e-9)
        largest = np.max(gain, axis=0, initial=-np.inf)
        columns = np.sort(np.argsort(-largest)[:12])
        columns = columns[largest[columns] > -40.0]
    odds = np.exp(np.clip(gain[:, columns], -400.0, 80.0) / 2)
    n = len(columns)
    if ordered:
        before, mode = np.nonzero(np.arange(n + 1)[:, None] <= np.arange(n))
        after, states = mode + 1, n + 1
    else:
        before, mode = np.nonzero((np.arange(2**n)[:, None] >> np.arange(n)) & 1 == 0)
        after, states = before | 1 << mode, 2**n
    behind = [np.ones(states)]
    for row in odds[::-1]:
        taken = np.bincount(before, behind[-1][after] * row[mode], states)
        behind.append(behind[-1] + taken)
    ahead = np.zeros(states)
    ahead[0] = 1.0
    for k, row in enumerate(odds):
        taken = ahead[before] * row[mode]
        each = np.bincount(mode, taken * behind[labels - 1 - k][after], n)
        out[k, columns] = each / behind[-1][0]
        ahead = ahead + np.bincount(after, taken, states)
    out[:, modes] = 1 - out[:, :modes].sum(axis=1)
    return np.clip(out, 0.0, 1.0)


def _best_ordered(gain: np.ndarray) -> np.ndarray:
    # Lists: of few numbers their elements are at hand several times as fast as an array's.
    k, n = gain.shape
    total = [[0.0] * (n + 1)]
    for row in gain.tolist():
        above, here = total[-1], [0.0]
        for j, value in enumerate(row):
            here.append(max(above[j] + value, above[j + 1], here[j]))
        total.append(here)
    choice = np.full(k, -1)
    i, j = k, n
    while i > 0 and j > 0:
        if total[i][j] == total[i - 1][j]:
            i -= 1
        elif total[i][j] == total[i][j - 1]:
            j -= 1
        else:
            i, j = i - 1, j - 1
            choice[i] = j
    return choice


# Log odds that neighbours' modes crossed: without any sign of it, with shapes that changed
# places completely (swapped − kept MAC = 1), and with a guide that crosses at the same place.
# Fitted to ways of a KR10 of graded symmetry, truth seeds 100 to 139.
ODDS_NONE, ODDS_SWAPPED, ODDS_GUIDE = -9.0, 9.0, 2.0


Row = Sequence[Mode | None]


def _tree(x: np.ndarray, root: int) -> tuple[np.ndarray, np.ndarray]:
    """Order (n,) of poses at x (n, d) along their shortest tree; parents (n,), −1 of the root."""
    from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree  # 0.2 s

    apart = np.linalg.norm(x[:, None] - x[None], axis=2) + 1e-9  # 0 would be no edge
    order, parent = breadth_first_order(minimum_spanning_tree(apart), root, directed=False)
    return order, np.where(parent < 0, -1, parent)


def name_chances(
    found: Sequence[Row], guided: np.ndarray, x: np.ndarray, reference: int
) -> np.ndarray:
    """(n, k, k): chance that name a is at place b of the order of frequency.

    Along a way between two poses modes keep their places and exchange their shapes where they come
    near each other (they veer: von Neumann and Wigner 1929), unless nothing couples them: then they
    cross, keep their shapes and exchange their places. Each exchange of shapes has a chance of
    having been a crossing; chances go down a tree of neighbours.

    `found[i][b]` is the mode at place b of pose i, None if it was not found; guided (n, k) the
    place that the guide gives to every name; x (n, d), scaled. At the `reference` the names are
    where the guide has them.
    """
    n, k = guided.shape
    order, parent = _tree(x, reference)
    unit = max(1, x.shape[1]) ** 0.5
    crossed = _guide_crossings(guided, order, parent, x)
    known = np.array([[m is not None for m in row] for row in found]).reshape(n, k)
    chance = np.zeros((n, k, k))
    chance[reference] = np.eye(k)[guided[reference]]
    for i in order[1:]:
        chance[i] = chance[parent[i]]
        for b in range(k - 1):
            pair = known[:, b] & known[:, b + 1]
            above = parent[i]
            while above >= 0 and not pair[above]:
                above = parent[above]
            if not pair[i] or above < 0:
                continue
            middle = (x[i] + x[above]) / 2
            apart = np.linalg.norm(crossed[b] - middle, axis=1) / unit
            # Displaced: how far from the truth's a guide's crossing may be, in x per √d
            near = np.max(np.exp(-((apart / 0.4) ** 2) / 2), initial=0.0)
            odds = ODDS_NONE + ODDS_SWAPPED * _swapped(found[above], found[i], b)
            cross = 1 / (1 + np.exp(-odds - ODDS_GUIDE * near))
            chance[i][:, b : b + 2] @= np.array([[1 - cross, cross], [cross, 1 - cross]])
    return chance


def _guide_crossings(
    guided: np.ndarray, order: np.ndarray, parent: np.ndarray, x: np.ndarray
) -> list[np.ndarray]:
    """For each two neighbouring places where in x (·, d) the guide has them exchange names."""
    k = guided.shape[1]
    out: list[list[np.ndarray]] = [[] for _ in range(k - 1)]
    for i in order[1:]:
        above = parent[i]
        before, after = np.argsort(guided[above]), np.argsort(guided[i])
        for b in range(k - 1):
            if set(before[: b + 1]) != set(after[: b + 1]):
                out[b].append((x[above] + x[i]) / 2)
    return [np.array(places).reshape(len(places), x.shape[1]) for places in out]


def _swapped(before: Row, after: Row, b: int) -> float:
    """How far the shapes at places b and b+1 have changed places: −1 not, 1 completely.

    Mean MAC with the other's place less that with its own, as a share of what it can be.
    """
    low, high, low_now, high_now = before[b], before[b + 1], after[b], after[b + 1]
    if low is None or high is None or low_now is None or high_now is None:
        return -1.0
    swap = mac(low.shape, high_now.shape) + mac(high.shape, low_now.shape)
    kept = mac(low.shape, low_now.shape) + mac(high.shape, high_now.shape)
    alike = mac(low.shape, high.shape) + mac(low_now.shape, high_now.shape)
    # Least apart: 2 − MAC − MAC of two modes that can be told apart by their shapes
    return float(np.clip((swap - kept) / max(2 - alike, 0.5), -1.0, 1.0))


NEIGHBOURS, GUIDE_WEIGHT = 6, 0.5  # shapes that are compared; the guide's weight among them


def mixture(
    shape: np.ndarray, certain: np.ndarray, guide: np.ndarray, x: np.ndarray, length: float
) -> np.ndarray:
    """Expected shapes (n, k, 3, 3): the guide's and those of the nearest poses, as Σ w s sᴴ.

    Args:
        shape: Unit shapes (n, k, 3) of the modes that carry a label; NaN where none does.
        certain: Probability (n, k) that they carry it rightly.
        guide: The guide's shapes (n, k, 3).
        x: Poses (n, d), in coordinates scaled to the workspace.
        length: Distance, per √d, over which shapes stay alike.
    """
    n = len(certain)
    size = np.linalg.norm(x[:, None] - x[None], axis=2) / max(1, x.shape[1]) ** 0.5
    np.fill_diagonal(size, np.inf)
    near = np.argsort(size, axis=1, kind="stable")[:, : min(NEIGHBOURS, n - 1)]  # (n, neighbours)
    nearness = np.exp(-((np.take_along_axis(size, near, axis=1) / length) ** 2) / 2)
    filled = np.nan_to_num(guide)
    turn = _rotations(np.broadcast_to(filled[:, None], filled[near].shape), filled[near])
    known = np.isfinite(shape[near][..., 0])
    theirs = np.where(known, certain[near] * nearness[..., None], 0.0)
    turned = np.nan_to_num(shape[near]) @ np.swapaxes(turn, -1, -2)
    own = GUIDE_WEIGHT * np.isfinite(guide[..., 0])
    out = own[..., None, None] * _projector(filled)
    out = out + np.sum(theirs[..., None, None] * _projector(turned), axis=1)
    return out / np.maximum(own + np.sum(theirs, axis=1), 1e-12)[..., None, None]


def _projector(shape: np.ndarray) -> np.ndarray:
    """s sᴴ (…, 3, 3) of unit shapes (…, 3)."""
    size = np.linalg.norm(shape, axis=-1, keepdims=True)
    unit = np.divide(shape, size, out=np.zeros_like(shape), where=size > 0)
    return unit[..., :, None] * unit[..., None, :].conj()


def _rotations(here: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Orthogonal (…, 3, 3) that best carry the guide's shapes there (…, k, 3) to those here.

    Signs of shapes are arbitrary, so they are made to agree first (Schönemann 1966).
    """
    phase = np.sum(here.conj() * there, axis=-1)
    phase = np.where(np.abs(phase) > 1e-12, phase / np.maximum(np.abs(phase), 1e-12), 1.0)
    product = np.swapaxes(here * phase[..., None], -1, -2) @ there.conj()
    # A little of the identity decides directions in which no guided mode moves.
    left, _, right = np.linalg.svd(product.real + 1e-3 * np.eye(3))
    return left @ right
