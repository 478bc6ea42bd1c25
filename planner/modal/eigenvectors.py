"""Residues of rank one as left and right eigenvectors, and how they change with them."""

from dataclasses import dataclass

import numpy as np

from planner.modal.residues import rank_one


@dataclass(frozen=True, eq=False)
class Eigenvectors:
    """Which elements of the eigenvectors of m modes are free, as complex z (m, q).

    z holds φ (outputs) and then ψ (inputs) without its element at `pivot`, which is 1: the
    largest at the start, so that dividing by it is safe. Symmetric: z is φ, and ψ = φ.
    """

    outputs: int
    inputs: int
    symmetric: bool
    pivot: np.ndarray  # (m,)

    @staticmethod
    def of(residue: np.ndarray, symmetric: bool) -> tuple["Eigenvectors", np.ndarray]:
        """The nearest eigenvectors of residues (m, outputs, inputs), and their z."""
        m, outputs, inputs = residue.shape
        if symmetric:
            z = np.array([_nearest_square(r) for r in residue])
            return Eigenvectors(outputs, inputs, True, np.zeros(m, int)), z
        pivots, elements = [], []
        for r in residue:
            shape, participation, _ = rank_one(r)
            pivot = int(np.argmax(np.abs(participation)))
            left = np.delete(participation / participation[pivot], pivot)
            pivots.append(pivot)
            elements.append(np.append(shape * participation[pivot], left))
        return Eigenvectors(outputs, inputs, False, np.array(pivots)), np.array(elements)

    def part(self, k: int) -> "Eigenvectors":
        """Mode k alone."""
        return Eigenvectors(self.outputs, self.inputs, self.symmetric, self.pivot[k : k + 1])

    def both(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Right (m, outputs) and left (m, inputs)."""
        if self.symmetric:
            return z, z
        left = np.ones((len(z), self.inputs), complex)
        left[self._free] = z[:, self.outputs :].ravel()
        return z[:, : self.outputs], left

    def residue(self, z: np.ndarray) -> np.ndarray:
        """φψᵀ (m, outputs, inputs)."""
        right, left = self.both(z)
        return right[:, :, None] * left[:, None, :]

    def slope(self, z: np.ndarray) -> np.ndarray:
        """∂(φψᵀ)/∂z (m, outputs, inputs, q), complex-analytic."""
        (right, left), (by_right, by_left) = self.both(z), self._slopes(z)
        return (
            by_right[:, :, None, :] * left[:, None, :, None]
            + right[:, :, None, None] * by_left[:, None, :, :]
        )

    def referred(self, z: np.ndarray, reference: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """One mode's ψ (1 at `reference`), φ, and ∂(ψ without that element, φ)/∂z."""
        (right,), (left,) = self.both(z[None])
        (by_right,), (by_left,) = self._slopes(z[None])
        size, by_size = left[reference], by_left[reference]
        by_left = by_left / size - np.outer(left, by_size) / size**2
        by_right = by_right * size + np.outer(right, by_size)
        slope = np.concatenate([np.delete(by_left, reference, axis=0), by_right])
        left = left / size
        left[reference] = 1.0  # not up to rounding
        return left, right * size, slope

    @property
    def _free(self) -> np.ndarray:
        """(m, inputs) bool: elements of ψ that are not the pivot."""
        return np.arange(self.inputs) != self.pivot[:, None]

    def _slopes(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """∂φ/∂z (m, outputs, q) and ∂ψ/∂z (m, inputs, q)."""
        m, q = z.shape
        by_right = np.broadcast_to(np.eye(self.outputs, q), (m, self.outputs, q))
        if self.symmetric:
            return by_right, by_right
        by_left = np.zeros((m, self.inputs, q))
        mode, place = np.nonzero(self._free)
        by_left[mode, place, self.outputs + np.tile(np.arange(self.inputs - 1), m)] = 1.0
        return by_right, by_left


def _nearest_square(residue: np.ndarray) -> np.ndarray:
    """φ of the φφᵀ that is nearest to a residue (n, n)."""
    even = (residue + residue.T) / 2
    direction = np.linalg.svd(even)[0][:, 0]
    return direction * np.sqrt(direction.conj() @ even @ direction.conj())
