"""Modes fitted to all FRFs with one shape and one drive each, and how sure the fit is.

The residues of a mode are the products of how it shows and how it is driven (Lei et al. 2023,
eq. 15), 2n numbers instead of n²: a rotation that acts by a moment, a second difference of measured
motions, is then the product of two first differences.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.modal.refine import Refined
from planner.modal.residues import Lines, basis, basis_slope, laplace, unpack

REPLICATES = 40  # noises for which the fit is done again: its sd is known to 11 %
ROUNDS, STILL = 60, 1e-6  # of shapes and drives in turn, and the relative change that ends them
CLOSE = 0.5  # of the damping: distance of poles whose modes are not told apart
NO_TRACE = 1e-8  # of scaled normal equations: eigenvalues below are rounding
SEED = 7  # of the noises: the same answer for the same FRFs


@dataclass(frozen=True, eq=False)
class FrfEquations:
    """One FRF's real, weighted equations: residues' columns, out-of-band terms taken out, data.

    `free` (2F, 2m) are the residues' columns orthogonal to `rest` (2F, t); `data` (2F,).
    """

    rest: np.ndarray
    free: np.ndarray
    data: np.ndarray

    @cached_property
    def normal(self) -> np.ndarray:
        return self.free.T @ self.free

    @cached_property
    def root(self) -> np.ndarray:
        """(2m, 2m): times independent unit normals, the noise of what the data say of residues."""
        values, vectors = np.linalg.eigh(self.normal)
        return vectors * np.sqrt(np.maximum(values, 0.0))


def rank_one(
    frequency_hz: np.ndarray, accelerance: np.ndarray, variance: np.ndarray, found: Refined,
    products: bool = True,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Accelerance (n, n, F) of modes of rank one at the poles of a fit, and its errors.

    Errors (D, n, n, F) are independent of each other, of one sd each. Without `products` residues
    are any.
    """
    n, count = accelerance.shape[0], accelerance.shape[-1]
    lines = laplace(frequency_hz)
    inside = products & _alone(found.poles, 2 * np.pi * frequency_hz[-1])
    m, poles = int(np.count_nonzero(inside)), len(found.poles)
    weight = np.sqrt(2 / variance)
    entries = [
        [_entry(lines, accelerance[i, j], weight[i, j], found, inside) for j in range(n)]
        for i in range(n)
    ]
    told = np.array([[e.free.T @ e.data for e in row] for row in entries])  # (n, n, 2m)
    normal = np.array([[e.normal for e in row] for row in entries])
    start = found.residues.residue[..., inside]
    residue = _products(normal, told, start)
    rng = np.random.default_rng(SEED)
    errors = np.empty((REPLICATES + 2 * poles, n, n, 2 * count))
    for k in range(REPLICATES):
        noise = np.array([[e.root @ rng.standard_normal(2 * m) for e in row] for row in entries])
        off = _products(normal, told + noise, residue) - residue
        for i, j in np.ndindex(n, n):
            e = entries[i][j]
            own = e.rest @ rng.standard_normal(e.rest.shape[1])
            errors[k, i, j] = (e.free @ _parts(off[i, j]) + own) / np.sqrt(REPLICATES)
    errors[REPLICATES:] = _by_poles(lines, weight, found, entries)
    fitted = np.empty((n, n, 2 * count))
    for i, j in np.ndindex(n, n):
        e = entries[i][j]
        fitted[i, j] = e.free @ _parts(residue[i, j]) + e.rest @ (e.rest.T @ e.data)
    return _complex(fitted) / weight, _complex(errors) / weight


def _alone(poles: np.ndarray, highest: float) -> np.ndarray:
    """(m,) which poles are of one mode each.

    One outside the lines stands for all modes there; two nearer to each other than their damping
    share what is between them.
    """
    apart = np.abs(poles[:, None] - poles) + np.diag(np.full(len(poles), np.inf))
    wide = np.maximum(np.abs(poles.real)[:, None], np.abs(poles.real))
    return (np.abs(poles) < highest) & np.all(apart > CLOSE * wide, axis=1)


def _entry(
    lines: Lines, values: np.ndarray, weight: np.ndarray, found: Refined, inside: np.ndarray
) -> FrfEquations:
    columns = _real((basis(lines, found.poles) * weight).T)
    product = np.zeros(columns.shape[1], bool)
    product[: 2 * len(inside)] = np.tile(inside, 2)
    rest, free = columns[:, ~product], columns[:, product]
    q, _ = np.linalg.qr(rest / np.linalg.norm(rest, axis=0))
    return FrfEquations(q, free - q @ (q.T @ free), _real(values * weight))


def _products(normal: np.ndarray, told: np.ndarray, residue: np.ndarray) -> np.ndarray:
    """Residues (n, n, m) of rank one each that fit best, from a start.

    χ² is Rᵀ N R − 2 Rᵀ told over the real and imaginary parts R of each entry's residues.
    """
    if residue.shape[-1] == 0:
        return residue
    left, size, right = np.linalg.svd(np.moveaxis(residue, -1, 0))
    shape = (left[:, :, 0] * size[:, :1]).T  # (n, m)
    drive = right[:, 0].T
    last = residue
    for _ in range(ROUNDS):
        shape = _solved(normal, told, drive)
        drive = _solved(np.swapaxes(normal, 0, 1), np.swapaxes(told, 0, 1), shape)
        now = shape[:, None] * drive[None]
        if np.max(np.abs(now - last)) < STILL * np.max(np.abs(now)):
            return now
        last = now
    return last


def _solved(normal: np.ndarray, told: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(n, m) of one side, the other side's (n, m) held."""
    turn = np.array([_times(row) for row in other])  # (n, 2m, 2m)
    whole = np.einsum("jba,ijbc,jcd->iad", turn, normal, turn, optimize=True)
    wanted = np.einsum("jba,ijb->ia", turn, told)
    size = np.sqrt(np.diagonal(whole, axis1=1, axis2=2))
    scaled = whole / size[:, :, None] / size[:, None, :]
    found = np.linalg.solve(scaled, (wanted / size)[..., None])[..., 0] / size
    m = other.shape[1]
    return found[:, :m] + 1j * found[:, m:]


def _times(values: np.ndarray) -> np.ndarray:
    """(2m, 2m): multiplies real and imaginary parts of m numbers by complex values (m,)."""
    a, b = np.diag(values.real), np.diag(values.imag)
    return np.block([[a, -b], [b, a]])


def _by_poles(
    lines: Lines, weight: np.ndarray, found: Refined, entries: list[list[FrfEquations]]
) -> np.ndarray:
    """Errors (2m, n, n, 2F), weighted, that the noise of the poles leaves; all entries share it."""
    m, n = len(found.poles), len(weight)
    slope, slopes = basis_slope(lines, found.poles).T, {}
    for i, j in np.ndindex(n, n):
        r = unpack(found.point.coefficients[i * n + j], m).residue
        real, imag = slope[:, :m], slope[:, m:]
        # ∂H/∂Re p = Re R·first + Im R·second, ∂H/∂Im p = Re R·second − Im R·first
        turned = [r.real * real + r.imag * imag, r.real * imag - r.imag * real]
        moved = _real(weight[i, j][:, None] * np.concatenate(turned, axis=1))
        e = entries[i][j]
        q = np.linalg.qr(np.concatenate([e.rest, e.free / np.linalg.norm(e.free, axis=0)], 1))[0]
        slopes[i, j] = moved - q @ (q.T @ moved)
    normal = np.sum([s.T @ s for s in slopes.values()], axis=0)
    size = np.sqrt(np.maximum(np.diagonal(normal), 1e-300))
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    # A direction in which poles move without a trace is one of poles that nothing needs.
    root = vectors / np.sqrt(np.maximum(values, NO_TRACE)) / size[:, None]
    out = np.empty((2 * m, n, n, 2 * weight.shape[-1]))
    for (i, j), s in slopes.items():
        out[:, i, j] = (s @ root).T
    return out


def _real(values: np.ndarray) -> np.ndarray:
    return np.concatenate([values.real, values.imag], axis=0)


def _parts(values: np.ndarray) -> np.ndarray:
    return np.concatenate([values.real, values.imag])


def _complex(values: np.ndarray) -> np.ndarray:
    real, imag = np.split(values, 2, axis=-1)
    return real + 1j * imag
