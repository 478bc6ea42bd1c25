"""Matching measured modes to labels when either may be absent.

Everything here works on `gain` (labels, modes): what a match is better than a missing label and
an unexpected mode, in units of −2 log likelihood. Ordered matchings keep the order of labels and
modes; free ones may exchange them.
"""

import numpy as np

from planner.inference.assignment import least_cost

# Matchings are summed over subsets of the measured modes; beyond this many, the dearest are out.
MOST = 12
HOPELESS = -40.0  # gain below which a match is left out of the sum (odds of 2e-9)


def best(gain: np.ndarray, ordered: bool = False) -> np.ndarray:
    """For each label the measured mode that it is, −1 for none; largest total gain.

    Matches that lose are not made.
    """
    if ordered:
        return _best_ordered(gain)
    chosen = np.full(gain.shape[0], -1)
    rows, columns = least_cost(-np.maximum(gain, 0.0))
    for row, column in zip(rows, columns, strict=True):
        if gain[row, column] > 0:
            chosen[row] = column
    return chosen


def chances(gain: np.ndarray, ordered: bool = False) -> np.ndarray:
    """(labels, modes + 1): probability of each label being each mode, or none (last column).

    Sums exp(gain/2) over all matchings, not only the best.
    """
    labels, modes = gain.shape
    out = np.zeros((labels, modes + 1))
    out[:, :modes] = _chances_ordered(gain) if ordered else _chances_free(gain)
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


def _chances_ordered(gain: np.ndarray) -> np.ndarray:
    odds = np.exp(np.clip(gain, -400.0, 80.0) / 2)
    ahead = _sums_ordered(odds)
    behind = _sums_ordered(odds[::-1, ::-1])[::-1, ::-1]
    return ahead[:-1, :-1] * odds * behind[1:, 1:] / ahead[-1, -1]


def _sums_ordered(odds: np.ndarray) -> np.ndarray:
    """Summed odds of all ordered matchings of leading parts; sets of matches counted once."""
    total = [[1.0] * (odds.shape[1] + 1)]
    for row in odds.tolist():
        above, here = total[-1], [1.0]
        for j, value in enumerate(row):
            here.append(above[j + 1] + here[j] - above[j] + above[j] * value)
        total.append(here)
    return np.array(total)


def _chances_free(gain: np.ndarray) -> np.ndarray:
    """Forward and backward through the labels, an entry per subset of modes that are taken."""
    labels, modes = gain.shape
    out = np.zeros((labels, modes))
    largest = np.max(gain, axis=0, initial=-np.inf)
    columns = np.sort(np.argsort(-largest)[:MOST])
    columns = columns[largest[columns] > HOPELESS]
    odds = np.exp(np.clip(gain[:, columns], -400.0, 80.0) / 2)
    n = len(columns)
    taken = (np.arange(2**n)[:, None] >> np.arange(n)) & 1 == 1  # (subsets, modes)
    ahead = [np.zeros(2**n)]
    ahead[0][0] = 1.0
    behind = [np.ones(2**n)]
    for k in range(labels):
        ahead.append(_spread(ahead[-1], odds[k], taken))
        behind.append(_gather(behind[-1], odds[labels - 1 - k], taken))
    behind.reverse()
    total = behind[0][0]
    for k in range(labels):
        for j in range(n):
            free = np.flatnonzero(~taken[:, j])
            after = behind[k + 1][free | 1 << j]
            out[k, columns[j]] = np.sum(ahead[k][free] * after) * odds[k, j] / total
    return out


def _spread(weight: np.ndarray, odds: np.ndarray, taken: np.ndarray) -> np.ndarray:
    """Weight of every set of taken modes after one more label has chosen."""
    out = weight.copy()
    for j, o in enumerate(odds):
        free = np.flatnonzero(~taken[:, j])
        out[free | 1 << j] += weight[free] * o
    return out


def _gather(weight: np.ndarray, odds: np.ndarray, taken: np.ndarray) -> np.ndarray:
    """Weight of what can follow every set of taken modes if one more label still chooses."""
    out = weight.copy()
    for j, o in enumerate(odds):
        free = np.flatnonzero(~taken[:, j])
        out[free] += weight[free | 1 << j] * o
    return out
