"""Simulated plates whose modes, shapes and modal masses are known."""

from dataclasses import dataclass, field

import numpy as np
import scipy.linalg

from tests.support.direct_solution import direct_accelerance


@dataclass(frozen=True, eq=False)
class Structure:
    """M, C, K of n degrees of freedom at nodes (names), each along a direction ("x", "y", "z")."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    nodes: tuple[int, ...]
    directions: tuple[str, ...]
    position_m: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    lines: tuple[tuple[int, int], ...] = ()

    def poles(self) -> tuple[np.ndarray, np.ndarray]:
        """Poles (m,) with positive frequency, increasing, and shapes (n, m) with modal a = 1.

        Receptance = Σ φφᵀ/(s − λ) + conjugate.
        """
        n = len(self.nodes)
        zero = np.zeros((n, n))
        a = np.block([[self.damping, self.mass], [self.mass, zero]])
        b = np.block([[self.stiffness, zero], [zero, -self.mass]])
        values, vectors = scipy.linalg.eig(-b, a)
        kept = values.imag > 1e-6 * np.max(np.abs(values))
        values, vectors = values[kept], vectors[:, kept]
        order = np.argsort(np.abs(values))
        values, vectors = values[order], vectors[:, order]
        norm = np.einsum("im,ij,jm->m", vectors, a, vectors)
        return values, vectors[:n] / np.sqrt(norm)

    def accelerance(
        self, frequency_hz: np.ndarray, responses: list[int], references: list[int]
    ) -> np.ndarray:
        """Exact FRFs (outputs, inputs, F) in m/s²/N between degrees of freedom by their index."""
        # Solved line by line: poles that repeat, as a free plate's, have no shapes of their own.
        one = np.eye(len(self.mass))
        ends = one[references], one[responses]
        return direct_accelerance(self.mass, self.damping, self.stiffness, *ends, frequency_hz)


def damped(
    mass: np.ndarray, stiffness: np.ndarray, ratio: tuple[float, float], hz: tuple[float, float]
) -> np.ndarray:
    """Rayleigh damping with given ratios at two frequencies."""
    w = 2 * np.pi * np.array(hz)
    a, b = np.linalg.solve(np.stack([0.5 / w, 0.5 * w], axis=1), ratio)
    return a * mass + b * stiffness


def _bending_element(dx: float, dy: float, rigidity: float, poisson: float) -> np.ndarray:
    """Stiffness (12, 12) of a thin plate's rectangle, w, θx, θy per corner (Melosh 1963)."""
    corners = np.array([(0.0, 0.0), (dx, 0.0), (dx, dy), (0.0, dy)])

    def terms(x: float, y: float) -> np.ndarray:
        powers = [1, x, y, x * x, x * y, y * y, x**3, x * x * y, x * y * y, y**3]
        return np.array([*powers, x**3 * y, x * y**3])

    def slopes(x: float, y: float) -> np.ndarray:
        by_y = [0, 0, 1, 0, x, 2 * y, 0, x * x, 2 * x * y, 3 * y * y, x**3, 3 * x * y * y]
        by_x = [0, 1, 0, 2 * x, y, 0, 3 * x * x, 2 * x * y, y * y, 0, 3 * x * x * y, y**3]
        return np.array([by_y, [-v for v in by_x]])

    rows = [np.vstack([terms(x, y), slopes(x, y)]) for x, y in corners]
    turn = np.linalg.inv(np.vstack(rows))
    law = rigidity * np.array([[1, poisson, 0], [poisson, 1, 0], [0, 0, (1 - poisson) / 2]])
    points, weights = np.polynomial.legendre.leggauss(4)
    inner = np.zeros((12, 12))
    for px, wx in zip((points + 1) / 2 * dx, weights / 2 * dx, strict=True):
        for py, wy in zip((points + 1) / 2 * dy, weights / 2 * dy, strict=True):
            x, y = px, py
            curve = np.array(
                [
                    [0, 0, 0, 2, 0, 0, 6 * x, 2 * y, 0, 0, 6 * x * y, 0],
                    [0, 0, 0, 0, 0, 2, 0, 0, 2 * x, 6 * y, 0, 6 * x * y],
                    [0, 0, 0, 0, 2, 0, 0, 4 * x, 4 * y, 0, 6 * x * x, 6 * y * y],
                ]
            )
            inner += wx * wy * curve.T @ law @ curve
    return turn.T @ inner @ turn


def plate(
    columns: int = 10, rows: int = 5, size_m: tuple[float, float] = (0.6, 0.28),
    thickness_m: float = 0.004, ratio: tuple[float, float] = (0.004, 0.004),
) -> Structure:  # fmt: skip
    """A free plate of aluminium on soft springs: columns × rows transverse degrees of freedom.

    Rotations are condensed (they have no mass), so that the reduced structure is exact.
    """
    modulus, poisson, density = 70e9, 0.33, 2700.0
    dx, dy = size_m[0] / (columns - 1), size_m[1] / (rows - 1)
    rigidity = modulus * thickness_m**3 / 12 / (1 - poisson**2)
    element = _bending_element(dx, dy, rigidity, poisson)
    n = columns * rows
    k, m = np.zeros((3 * n, 3 * n)), np.zeros(n)
    for c in range(columns - 1):
        for r in range(rows - 1):
            corners = [
                r * columns + c, r * columns + c + 1, (r + 1) * columns + c + 1,
                (r + 1) * columns + c,
            ]  # fmt: skip
            at = np.ravel([[3 * i, 3 * i + 1, 3 * i + 2] for i in corners])
            k[np.ix_(at, at)] += element
            m[corners] += density * thickness_m * dx * dy / 4
    w = np.arange(n) * 3
    turns = np.setdiff1d(np.arange(3 * n), w)
    kww, kwt, ktt = k[np.ix_(w, w)], k[np.ix_(w, turns)], k[np.ix_(turns, turns)]
    stiffness = kww - kwt @ np.linalg.solve(ktt, kwt.T)
    stiffness = (stiffness + stiffness.T) / 2
    mass = np.diag(m)
    stiffness += (2 * np.pi * 2.0) ** 2 * mass  # hung at 2 Hz
    damping = damped(mass, stiffness, ratio, (100.0, 800.0))
    position = {i + 1: (dx * (i % columns), dy * (i // columns), 0.0) for i in range(n)}
    lines = [(i + 1, i + 2) for i in range(n) if (i + 1) % columns]
    lines += [(i + 1, i + 1 + columns) for i in range(n - columns)]
    return Structure(
        mass, damping, stiffness, tuple(range(1, n + 1)), ("z",) * n, position, tuple(lines)
    )
