"""FRFs of simulated structures as a hammer test would give them, nuisances and all."""

from typing import Any

import numpy as np
import pytest

from planner.frf.matrix import FrfMatrix
from planner.frf.synthesis import accelerance
from planner.modal.mac import mac
from planner.recording.points import Dof
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


def agree(
    answer: dict[str, Any],
    structure: Structure,
    band_hz: tuple[float, float],
    hz: float = 1e-3,
    damping: float | None = None,
    least: float | None = 0.995,
    scale: float | None = 0.03,
) -> None:
    """Modes told of a band are the true ones: frequencies and damping (relative, and 4 sd), shapes.

    Shapes go by node, unless there is no `least` MAC; they are scaled, unless `scale` is None.
    """
    poles, shapes = unit_mass_shapes(structure)
    size, (low, high) = np.abs(poles) / (2 * np.pi), band_hz
    inside = np.flatnonzero((size > low) & (size < high))
    found = [mode for mode in answer["modes"] if low < mode["frequency_hz"] < high]
    assert len(found) == inside.size
    nodes = [str(node).lstrip("n") for node, _ in answer["dofs"]] if least else []
    rows = [structure.nodes.index(int(node)) for node in nodes]
    for mode, k in zip(found, inside, strict=True):
        assert mode["frequency_hz"] == pytest.approx(size[k], rel=hz)
        ratio = -poles[k].real / np.abs(poles[k])
        if damping is not None:
            assert abs(mode["frequency_hz"] - size[k]) < 4 * mode["frequency_sd_hz"]
            assert abs(mode["damping_ratio"] - ratio) < min(4 * mode["damping_sd"], damping * ratio)
        if least is None:
            continue
        shape, true = np.array([complex(*value) for value in mode["shape"]]), shapes[rows, k]
        assert mac(shape, true) > least
        assert mode["scaled"] == (scale is not None)
        if scale is not None:
            assert np.linalg.norm(shape) == pytest.approx(np.linalg.norm(true), rel=scale)
