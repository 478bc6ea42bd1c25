"""True modes of robots (engine: MuJoCo): as people count them, and of each that hits show which.

A mode that nobody sees is not counted.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy.linalg
from scipy.optimize import linear_sum_assignment

from planner.dynamics.mode_families import Families, rearranged
from planner.dynamics.vibration import SimulatedModes
from planner.errors import RefusedError
from planner.frf.estimator import estimate
from planner.modal.estimate_modes import estimate_modes
from planner.modal.mac import mac_matrix
from planner.modal.modes import Mode
from planner.proof.hits import Hammer, simulate_hit
from planner.proof.model import Truth
from planner.recording.records import Hit
from planner.studies.hits import as_read

VISIBLE = 0.1  # of all else in the nine FRFs, at a mode's own frequency: less is no peak to anybody
NOT_COUNTED = 2  # modes that nobody sees, at most, below the highest that is counted
AXES = ("+x", "+x", "+x", "+x", "+y", "+y", "+y", "+y", "+z", "+z", "+z", "+z")


@dataclass(frozen=True, eq=False)
class Measured:
    """n poses: what was identified, and which of those modes each true family is (−1: none)."""

    modes: tuple[tuple[Mode, ...], ...]
    place: np.ndarray  # (n, k) true order of frequency of every family
    true_hz: np.ndarray  # (n, k)
    partner: np.ndarray  # (n, k)


def hits_at(
    truth: Truth, q: np.ndarray, hammer: Hammer, rng: np.random.Generator
) -> tuple[Hit, ...]:
    """Twelve hits as the program would read them from files."""
    return as_read([simulate_hit(truth, q, axis, hammer, rng) for axis in AXES], hammer)


def measure_all(
    truth: Truth,
    poses: np.ndarray,
    band_hz: tuple[float, float],
    count: int,
    reference: np.ndarray,
) -> Measured:
    """Hit every pose (n, dof), identify it, and say which mode is which true family."""
    place = Families(reference, poses, lambda q: undamped(truth, q)).places(poses)
    true_hz, partner = np.full((len(poses), count), np.nan), np.full((len(poses), count), -1)
    found = []
    for i, q in enumerate(poses):
        rng = np.random.default_rng([0, i])
        try:
            model = estimate_modes(estimate(hits_at(truth, q, Hammer(), rng), band_hz), band_hz)
            modes = model.modes
        except RefusedError:
            modes = ()
        found.append(modes)
        everything = SimulatedModes(*(a[None] for a in truth.modes(q, place.shape[1])))
        known = rearranged(
            everything, place[i : i + 1], undamped(truth, poses[i : i + 1])[0], count
        )
        true_hz[i] = known.frequency_hz[0]
        partner[i] = partners(modes, true_hz[i], known.residue[0])
    return Measured(tuple(found), place[:, :count], true_hz, partner)


def undamped(truth: Truth, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frequencies, shapes and mass matrices of the truth."""
    frequency, shapes, masses = [], [], []
    for q in poses:
        mass, _, stiffness, _, _ = truth.matrices(q)
        square, vectors = scipy.linalg.eigh(stiffness, mass)
        frequency.append(np.sqrt(square) / (2 * np.pi))
        shapes.append(vectors)
        masses.append(mass)
    return np.array(frequency), np.array(shapes), np.array(masses)


def partners(modes: Sequence[Mode], true_hz: np.ndarray, residues: np.ndarray) -> np.ndarray:
    """Which identified mode each true one is, by pole and shape; −1 where it was not found."""
    out = np.full(len(true_hz), -1)
    if not modes:
        return out
    shapes = np.array([np.linalg.svd(r)[0][:, 0] for r in residues])
    alike = mac_matrix(shapes, np.array([mode.shape for mode in modes]))
    apart = np.abs(np.log(np.array([m.frequency_hz for m in modes]) / true_hz[:, None])) / 0.02
    cost = apart + 2 * (1 - alike)
    for row, column in zip(*linear_sum_assignment(cost), strict=True):
        if apart[row, column] < 1.5 and cost[row, column] < 2:
            out[row] = column
    return out


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
