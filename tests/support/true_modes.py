"""True modes of robots (engine: MuJoCo) as people count them: without those that nobody sees."""

from itertools import combinations

import numpy as np

from planner.proof.hits import Hammer, simulate_hit
from planner.proof.model import Truth
from planner.recording.records import Hit
from planner.studies.hits import as_read

VISIBLE = 0.1  # of all else in the nine FRFs, at a mode's own frequency: less is no peak to anybody
NOT_COUNTED = 2  # modes that nobody sees, at most, below the highest that is counted
AXES = ("+x", "+x", "+x", "+x", "+y", "+y", "+y", "+y", "+z", "+z", "+z", "+z")


def hits_at(
    truth: Truth, q: np.ndarray, hammer: Hammer, rng: np.random.Generator
) -> tuple[Hit, ...]:
    """Twelve hits as the program would read them from files."""
    return as_read([simulate_hit(truth, q, axis, hammer, rng) for axis in AXES], hammer)


def true_modes(truth: Truth, q: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """The lowest natural frequencies (most,) in Hz, and which can be seen in the FRFs."""
    poles, residues, _ = truth.poles(q)
    order = [k for k in np.argsort(np.abs(poles)) if poles[k].imag > 1e-6][:most]
    seen = []
    for k in order:
        parts = residues / (1j * np.abs(poles[k]) - poles)[:, None, None]
        rest = np.linalg.norm(parts.sum(axis=0) - parts[k])
        seen.append(bool(np.linalg.norm(parts[k]) >= VISIBLE * rest))
    return np.abs(poles[order]) / (2 * np.pi), np.array(seen)


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
