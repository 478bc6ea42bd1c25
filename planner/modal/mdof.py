"""MDOF fit of an FRF matrix whose modes have left and right eigenvectors of their own.

Seed 003, eqs. 15 to 17: H(ω) = Σ φ ψᵀ/(iω−λ) + (φ ψᵀ)*/(iω−λ*) (receptance), φ the right
eigenvector at the outputs and ψ the left one at the inputs, so that H_xy ≠ H_yx where the robot is
not reciprocal. Only the product φψᵀ is seen: ψ is divided, and φ multiplied, by ψ's element at a
reference input (the last one in seed 003), which becomes 1. A mode then has 2 + 2 (inputs − 1) +
2 outputs real parameters: 16 for two points with two directions each.

All poles and eigenvectors are fitted at once by Gauss–Newton to the accelerance, weighted by its
variance; the out-of-band terms of each entry enter linearly and are eliminated.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.errors import InputError, RefusedError
from planner.frf.quantities import convert, convert_variance
from planner.modal.descend import descend
from planner.modal.eigenvectors import Eigenvectors
from planner.modal.fit_data import Data
from planner.modal.mode_selection import excess
from planner.modal.pole_identification import Identification, identify, natural, natural_slope
from planner.modal.refine import products, slope_turn
from planner.modal.residues import Residues, basis, basis_slope, synthesize, unpack

MAX_ITERATIONS = 60
LEAST_LINES = 8


@dataclass(frozen=True, eq=False)
class MdofMode:
    """One mode: its pole and its eigenvectors, and how well they are known.

    `parameters` are those of seed 003, eq. 17: frequency (Hz), damping ratio, real and imaginary
    part of each element of `left` but the reference, then of each element of `right`.
    """

    frequency_hz: float
    damping_ratio: float
    left: np.ndarray  # (inputs,) complex, 1 at the reference
    right: np.ndarray  # (outputs,) complex, m/(N·s)
    reference: int
    covariance: np.ndarray  # (n, n) of `parameters`, of rank 2 + 2 inputs in a symmetric fit
    residue_sd: np.ndarray  # (outputs, inputs) of real and imaginary part each
    probability: float  # that it is a mode, from the fit with free residues

    @property
    def parameters(self) -> np.ndarray:
        """(n,) real, n = 2 + 2 (inputs − 1) + 2 outputs."""
        elements = np.append(np.delete(self.left, self.reference), self.right)
        pairs = np.stack([elements.real, elements.imag], axis=1).ravel()
        return np.concatenate([[self.frequency_hz, self.damping_ratio], pairs])

    @property
    def sd(self) -> np.ndarray:
        """(n,) standard deviations of `parameters`."""
        return np.sqrt(np.maximum(0.0, np.diag(self.covariance)))

    @property
    def residue(self) -> np.ndarray:
        """(outputs, inputs) φψᵀ in m/(N·s)."""
        return np.outer(self.right, self.left)


@dataclass(frozen=True, eq=False)
class MdofFit:
    """Modes in increasing frequency, χ² = Σ 2|H − fit|²/variance and what it is compared with."""

    modes: tuple[MdofMode, ...]
    chi2: float
    degrees: int  # degrees of freedom left
    fit_error: float  # ‖H − fit‖/‖H‖ of the accelerance
    fitted: np.ndarray  # (outputs, inputs, F) accelerance
    converged: bool
    free: Identification  # the fit with free residues from which this one started


@dataclass(frozen=True, eq=False)
class _Point:
    chi2: float
    gradient: np.ndarray  # (n,)
    hessian: np.ndarray  # (n, n)
    rest: np.ndarray  # (entries, columns) coefficients of the out-of-band terms


def fit_mdof(
    frequency_hz: np.ndarray,
    frf: np.ndarray,
    quantity: str = "accelerance",
    variance: np.ndarray | None = None,
    symmetric: bool = False,
    reference: int = -1,
    rate_1_s: float = 0.0,
    tail_s: float = np.inf,
) -> MdofFit:
    """Modes of an FRF matrix (outputs, inputs, F) of the kind `quantity`, in SI units.

    frequency_hz (F,) uniform, above 0; variance like frf, E|δH|² of each line, taken from the
    error of the fit where it is None. With `symmetric` outputs and inputs are the same points and
    directions, and ψ ∝ φ. `rate_1_s` and `tail_s` are those of the records (see `Frf`).
    Raises InputError for what cannot be fitted, RefusedError where no mode is found.
    """
    data = replace(_data(frequency_hz, frf, quantity, variance), rate_1_s=rate_1_s, tail_s=tail_s)
    outputs, inputs, _ = data.response.shape
    if symmetric and outputs != inputs:
        raise InputError(
            f"A symmetric fit needs as many outputs as inputs, not {outputs} and {inputs}: fit"
            " without symmetry or leave rows or columns out."
        )
    if not -inputs <= reference < inputs:
        raise InputError(f"There is no input {reference} of {inputs} to refer to; choose another.")
    free = identify(data)
    if free is None:
        raise RefusedError("No mode could be found in this FRF matrix: measure again, hit harder.")
    return _fit(data, free, symmetric, reference % inputs)


def _data(
    frequency_hz: np.ndarray, frf: np.ndarray, quantity: str, variance: np.ndarray | None
) -> Data:
    f, h = np.asarray(frequency_hz, float), np.asarray(frf, complex)
    if h.ndim != 3 or f.ndim != 1 or h.shape[2] != f.size or 0 in h.shape:
        raise InputError(
            f"An FRF matrix is outputs × inputs × lines, here {h.shape} at {f.size} lines: reshape."
        )
    if f.size < LEAST_LINES or f[0] <= 0 or not np.allclose(np.diff(f), f[1] - f[0], rtol=1e-3):
        raise InputError(f"At least {LEAST_LINES} evenly spaced lines above 0 Hz are needed.")
    if not np.all(np.isfinite(h)) or not np.any(h):
        raise InputError("The FRF matrix holds missing values or only zeros: leave those out.")
    if variance is not None:
        variance = np.asarray(variance, float)
        if variance.shape != h.shape or not np.all(np.isfinite(variance) & (variance > 0)):
            raise InputError("The variance must be like the FRF matrix and above 0 everywhere.")
        variance = convert_variance(f, variance, quantity, "accelerance")
    return Data(f, convert(f, h, quantity, "accelerance"), variance)


def _fit(data: Data, free: Identification, symmetric: bool, reference: int) -> MdofFit:
    variance = free.fit.variance
    start = np.stack([mode.residue for mode in free.modes])
    vectors, z = Eigenvectors.of(start, symmetric)
    poles = np.array([mode.pole for mode in free.modes])
    x, point, converged = descend(
        lambda x: _evaluate(data, variance, vectors, x),
        _join(poles, z),
        lambda x: data.allowed(_split(x, len(poles))[0]),
        MAX_ITERATIONS,
    )
    poles, z = _split(x, len(poles))
    fitted = _model(data, vectors, poles, z, point.rest)
    error = data.response - fitted
    degrees = 2 * error.size - x.size - point.rest.size
    above = excess(data, error, variance, degrees)
    scale = np.interp(np.abs(poles) / (2 * np.pi), data.frequency_hz, above)
    covariance = np.linalg.pinv(point.hessian, rcond=1e-14, hermitian=True)
    modes = []
    for k in range(len(poles)):
        own = np.arange(k, x.size, len(poles))
        block = scale[k] * covariance[np.ix_(own, own)]
        probability = free.modes[k].probability
        modes.append(_mode(vectors.part(k), poles[k], z[k], block, reference, probability))
    ordered = tuple(sorted(modes, key=lambda mode: mode.frequency_hz))
    relative = float(np.linalg.norm(error) / np.linalg.norm(data.response))
    return MdofFit(ordered, point.chi2, degrees, relative, fitted, converged, free)


def _join(poles: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Real parameters: Re λ and Im λ of all modes, Re of each free element, then Im of each."""
    return np.concatenate([poles.real, poles.imag, z.T.real.ravel(), z.T.imag.ravel()])


def _split(x: np.ndarray, m: int) -> tuple[np.ndarray, np.ndarray]:
    """Poles (m,) and free elements (m, q) of the real parameters."""
    real, imag = np.split(x[2 * m :], 2)
    return x[:m] + 1j * x[m : 2 * m], (real + 1j * imag).reshape(-1, m).T


def _evaluate(data: Data, variance: np.ndarray, vectors: Eigenvectors, x: np.ndarray) -> _Point:
    m = vectors.pivot.size
    poles, z = _split(x, m)
    columns = np.concatenate([basis(data.lines, poles), basis_slope(data.lines, poles)])
    p = columns.shape[0] - 2 * m
    norm = np.sqrt(np.mean(np.abs(columns) ** 2, axis=1))
    count = data.frequency_hz.size
    gram, cross, square = products(
        columns / norm[:, None], data.response.reshape(-1, count), 2 / variance.reshape(-1, count)
    )
    residue = np.moveaxis(vectors.residue(z), 0, -1).reshape(-1, m)
    values = np.concatenate([residue.real, residue.imag], axis=1)
    modal, rest = slice(0, 2 * m), slice(2 * m, p)
    # What the modes leave, then what the out-of-band terms leave of that.
    scaled = values * norm[modal]
    square = square - 2 * np.einsum("ek,ek->e", scaled, cross[:, modal])
    square = square + np.einsum("ek,ekl,el->e", scaled, gram[:, modal, modal], scaled)
    cross = cross - np.einsum("ekl,el->ek", gram[..., modal], scaled)
    inverse = np.linalg.pinv(gram[:, rest, rest], rcond=1e-13, hermitian=True)
    absorbed = inverse @ gram[:, rest]
    outside = np.einsum("ekl,el->ek", inverse, cross[:, rest])
    chi2 = float(np.sum(square) - np.einsum("ek,ek->", outside, cross[:, rest]))
    cross = cross - np.einsum("erk,er->ek", absorbed, cross[:, rest])
    gram = gram - gram[..., rest] @ absorbed
    turn = _turn(vectors, z, values, p) * norm[:, None]
    gradient = np.einsum("eka,ek->a", turn, cross)
    hessian = np.sum(turn.transpose(0, 2, 1) @ gram @ turn, axis=0)
    return _Point(max(chi2, 0.0), gradient, hessian, outside / norm[rest])


def _turn(vectors: Eigenvectors, z: np.ndarray, values: np.ndarray, p: int) -> np.ndarray:
    """(entries, columns, n): change of the columns' coefficients with the parameters."""
    m, q = z.shape
    slope = vectors.slope(z).reshape(m, -1, q).transpose(1, 2, 0)  # (entries, q, m)
    entries = slope.shape[0]
    turn = np.zeros((entries, p + 2 * m, 2 * m * (1 + q)))
    turn[:, p:, : 2 * m] = slope_turn(values, m)
    real = 2 * m + np.arange(q)[:, None] * m + np.arange(m)
    imag = real + q * m
    k = np.arange(m)
    turn[:, k, real] = slope.real
    turn[:, k, imag] = -slope.imag
    turn[:, m + k, real] = slope.imag
    turn[:, m + k, imag] = slope.real
    return turn


def _model(
    data: Data, vectors: Eigenvectors, poles: np.ndarray, z: np.ndarray, rest: np.ndarray
) -> np.ndarray:
    outputs, inputs, _ = data.response.shape
    outside = unpack(rest.reshape(outputs, inputs, -1), 0).rest
    residue = np.moveaxis(vectors.residue(z), 0, -1)
    return synthesize(data.lines, poles, Residues(residue, outside))


def _mode(
    vectors: Eigenvectors,
    pole: complex,
    z: np.ndarray,
    covariance: np.ndarray,
    reference: int,
    probability: float,
) -> MdofMode:
    """From a pole, free elements (q,) and the covariance of (λ, z) to what is reported."""
    frequency, damping, _ = natural(pole, covariance[:2, :2])
    left, right, slope = vectors.referred(z, reference)
    turn = np.zeros((2 + 2 * len(slope), 2 + 2 * z.size))
    turn[:2, :2] = natural_slope(pole)
    turn[2::2, 2:] = np.concatenate([slope.real, -slope.imag], axis=1)
    turn[3::2, 2:] = np.concatenate([slope.imag, slope.real], axis=1)
    change = vectors.slope(z[None])[0]  # (outputs, inputs, q)
    parts = np.stack(
        [
            np.concatenate([change.real, -change.imag], axis=-1),
            np.concatenate([change.imag, change.real], axis=-1),
        ]
    )
    spread = np.einsum("poia,ab,poib->oi", parts, covariance[2:, 2:], parts) / 2
    return MdofMode(
        frequency,
        damping,
        left,
        right,
        reference,
        turn @ covariance @ turn.T,
        np.sqrt(np.maximum(0.0, spread)),
        probability,
    )
