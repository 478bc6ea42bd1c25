"""FRFs of simulated structures as a hammer test would give them, nuisances and all."""

import numpy as np

from planner.frf.matrix import FrfMatrix
from planner.frf.synthesis import accelerance
from planner.recording.dof import Dof
from tests.support.modal_systems import noisy
from tests.support.structures import Structure

NOISE = 0.01  # of the rms of each FRF


def hit_frfs(
    structure: Structure,
    references: list[int],
    frequency_hz: np.ndarray,
    rng: np.random.Generator,
) -> FrfMatrix:
    """A matrix of FRFs of all points hit and felt at `references` (indices), with NOISE."""
    poles, shapes = structure.poles()
    residues = np.moveaxis(shapes[:, None] * shapes[references], -1, 0)
    h, _ = noisy(accelerance(frequency_hz, poles, residues), NOISE, rng)
    return matrix_of(structure, references, frequency_hz, h)


def matrix_of(
    structure: Structure, references: list[int], frequency_hz: np.ndarray, h: np.ndarray
) -> FrfMatrix:
    """FRFs h (points, references, F) with the names of their degrees of freedom."""
    felt = tuple(dof_of(structure, i) for i in range(len(structure.nodes)))
    hit = tuple(dof_of(structure, i) for i in references)
    return FrfMatrix(frequency_hz, felt, hit, h, True)


def dof_of(structure: Structure, index: int) -> Dof:
    """Name of a degree of freedom."""
    return Dof(str(structure.nodes[index]), structure.directions[index])


def unit_mass_shapes(structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    """Poles (m,) and shapes (n, m) with residue = φφᵀ/(2iω_d)."""
    poles, shapes = structure.poles()
    return poles, shapes * np.sqrt(2j * poles.imag)
