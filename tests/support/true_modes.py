"""Modes of simulated hammer tests with the true identity of each (engine: MuJoCo)."""

from collections.abc import Sequence
from dataclasses import dataclass

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
