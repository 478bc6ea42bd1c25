"""FRFs of simulated structures as a hammer test would give them, nuisances and all."""

import numpy as np

from planner.frf.matrix import FrfMatrix
from planner.recording.dof import Dof
from tests.support.structures import Structure


def hit_frfs(
    structure: Structure,
    references: list[int],
    frequency_hz: np.ndarray,
    rng: np.random.Generator,
    noise: float = 0.01,
    wander: float = 0.0,
    gain: float = 0.0,
    tip_hz: float | None = None,
    responses: list[int] | None = None,
) -> FrfMatrix:
    """A matrix of FRFs of all points hit and felt at `references` (indices).

    `noise`: relative to the rms of each FRF; `wander`: sd by which each mode's frequency differs
    from row to row (loading, warmth, clamps), relative; `gain`: sd of each row's scale (hits that
    miss); `tip_hz`: where the hammer's tip has lost 20 dB, by which the noise grows.
    """
    rows = responses or list(range(len(structure.nodes)))
    poles, shapes = structure.poles()
    s = 2j * np.pi * frequency_hz
    h = np.zeros((len(rows), len(references), frequency_hz.size), complex)
    for k, row in enumerate(rows):
        own = poles * (1 + wander * rng.normal(size=poles.size))
        residues = shapes[row] * shapes[references]
        up, down = 1 / (s - own[:, None]), 1 / (s - own.conj()[:, None])
        h[k] = s**2 * (residues @ up + residues.conj() @ down) * (1 + gain * rng.normal())
    level = noise * np.sqrt(np.mean(np.abs(h) ** 2, axis=-1, keepdims=True))
    if tip_hz is not None:
        level = level * 10 ** (np.minimum(frequency_hz / tip_hz, 1.5)) / 3
    h = h + level * (rng.normal(size=h.shape) + 1j * rng.normal(size=h.shape)) / np.sqrt(2)
    return FrfMatrix(
        frequency_hz,
        tuple(dof_of(structure, i) for i in rows),
        tuple(dof_of(structure, i) for i in references),
        h,
        np.full(h.shape, np.nan),
        True,
    )


def dof_of(structure: Structure, index: int) -> Dof:
    """Name of a degree of freedom."""
    return Dof(str(structure.nodes[index]), structure.directions[index])


def unit_mass_shapes(structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    """Poles (m,) and shapes (n, m) with residue = φφᵀ/(2iω_d)."""
    poles, shapes = structure.poles()
    return poles, shapes * np.sqrt(2j * poles.imag)
