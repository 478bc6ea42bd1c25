"""Natural frequencies of true robots as people count them: a mode that nobody sees is none."""

from itertools import combinations

import numpy as np

from planner.proof.model import Truth

VISIBLE = 0.1  # of all else in the nine FRFs, at a mode's own frequency: less is no peak to anybody
NOT_COUNTED = 2  # modes that nobody sees, at most, below the highest that is counted


def true_modes(
    truth: Truth, q: np.ndarray, most: int, hose: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """The lowest natural frequencies (most,) in Hz, and which can be seen in the FRFs.

    Unless the robot's `hose` was seen when modes were counted, nobody looks for its mode elsewhere.
    """
    poles, residues, _ = truth.poles(q)
    order = [k for k in np.argsort(np.abs(poles)) if poles[k].imag > 1e-6][:most]
    seen = []
    for k in order:
        parts = residues / (1j * np.abs(poles[k]) - poles)[:, None, None]
        rest = np.linalg.norm(parts.sum(axis=0) - parts[k])
        seen.append(bool(np.linalg.norm(parts[k]) >= VISIBLE * rest))
    if not hose:
        seen[own_of_hose(truth, q, most)] = False
    return np.abs(poles[order]) / (2 * np.pi), np.array(seen)


def own_of_hose(truth: Truth, q: np.ndarray, most: int) -> int:
    """Which of the lowest modes is mostly the motion of what hangs on the robot."""
    poles, shapes, *_ = truth.modal(q)
    order = [k for k in np.argsort(np.abs(poles)) if poles[k].imag > 1e-6][:most]
    mass, shapes = truth.matrices(q)[0], shapes[:, order]
    whole = np.einsum("ek,ef,fk->k", shapes.conj(), mass, shapes).real
    return int(np.argmax(np.abs(truth.own("resonator 0") @ shapes) ** 2 / whole))


def counted(true_hz: np.ndarray, seen: np.ndarray, predicted_hz: np.ndarray) -> np.ndarray:
    """The true modes (k,) that predicted ones (k,) are: the lowest, but for some that nobody sees.

    Of those that can be left out the ones are that the prediction leaves out.
    """
    k = len(predicted_hz)
    best, least = true_hz[:k], np.inf
    for choice in combinations(range(len(true_hz)), k):
        left = [i for i in range(choice[-1]) if i not in choice]
        error = float(np.sum(np.log(predicted_hz / true_hz[list(choice)]) ** 2))
        if not np.any(seen[left]) and error < least:
            best, least = true_hz[list(choice)], error
    return best
