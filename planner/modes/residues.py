"""Residues by least squares in the frequency domain (LSFD), with out-of-band terms.

Accelerance of one entry: s² [Σ R/(s−λ) + R*/(s−λ*)] + L + s² U, L and U standing for the
modes below and above the band (Heylen, Lammens, Sas, Modal Analysis Theory and Testing, 1997,
A.3); both may be complex, because the modes outside are damped. s = iω, or iω + rate where the
records carry an exponential window e^{−rate·t}: the transform of the windowed record is that of
the record itself at iω + rate, so poles and residues need no correction afterwards.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Residues:
    """Residues (outputs, inputs, m) in m/(N·s) and the out-of-band terms (outputs, inputs)."""

    residue: np.ndarray
    lower: np.ndarray  # m/s²/N
    upper: np.ndarray  # m/N


@dataclass(frozen=True, eq=False)
class Lines:
    """Where a model of poles is evaluated: factor · [R/(x−p) + R*/(x−p*)] + L + factor·U.

    Accelerance: x = s, factor = s². A sampled free decay: x = e^{s·step}, factor = x.
    """

    x: np.ndarray  # (F,) complex
    factor: np.ndarray  # (F,) complex

    @property
    def largest(self) -> float:
        return float(np.max(np.abs(self.factor)))


def laplace(frequency_hz: np.ndarray, rate_1_s: float = 0.0) -> Lines:
    """Accelerance lines (Hz) of records windowed by e^{−rate·t}: s = iω + rate."""
    s = 2j * np.pi * np.asarray(frequency_hz) + rate_1_s
    return Lines(s, s**2)


def basis(lines: Lines, poles: np.ndarray, residual_terms: bool = True) -> np.ndarray:
    """Response to unit real and imaginary parts of every coefficient, (columns, F) complex.

    poles (m,) in the plane of `lines`. Columns: Re R of each mode, Im R of each mode, then
    Re L, Im L, Re U, Im U (U scaled to be of the size of L).
    """
    up, down = 1 / (lines.x - poles[:, None]), 1 / (lines.x - poles.conj()[:, None])
    columns = [lines.factor * (up + down), 1j * lines.factor * (up - down)]
    if residual_terms:
        scaled = lines.factor / lines.largest
        one = np.ones_like(scaled)
        columns.append(np.stack([one, 1j * one, scaled, 1j * scaled]))
    return np.concatenate(columns)


def basis_slope(lines: Lines, poles: np.ndarray) -> np.ndarray:
    """Basis (2m, F) of the derivative by the poles, for unit Re R and Im R.

    ∂H/∂Re p = Re R·first + Im R·second and ∂H/∂Im p = Re R·second − Im R·first.
    """
    up, down = 1 / (lines.x - poles[:, None]) ** 2, 1 / (lines.x - poles.conj()[:, None]) ** 2
    return np.concatenate([lines.factor * (up + down), 1j * lines.factor * (up - down)])


def unpack(coefficients: np.ndarray, modes: int, largest: float) -> Residues:
    """Coefficients of `basis` (outputs, inputs, columns) as residues and out-of-band terms.

    `largest` is |factor|_max, by which the basis of U was scaled.
    """
    residue = coefficients[..., :modes] + 1j * coefficients[..., modes : 2 * modes]
    rest = coefficients[..., 2 * modes :]
    if rest.shape[-1] == 0:
        zero = np.zeros(residue.shape[:2], complex)
        return Residues(residue, zero, zero)
    lower = rest[..., 0] + 1j * rest[..., 1]
    upper = (rest[..., 2] + 1j * rest[..., 3]) / largest
    return Residues(residue, lower, upper)


def lsfd(
    frequency_hz: np.ndarray,
    accelerance: np.ndarray,
    poles: np.ndarray,
    weight: np.ndarray | None = None,
    residual_terms: bool = True,
    real_modes: bool = False,
    rate_1_s: float = 0.0,
) -> Residues:
    """Residues of given poles.

    frequency_hz (F,); accelerance (outputs, inputs, F) in m/s²/N; poles (m,) in rad/s; weight
    like accelerance, usually 1/variance. With `real_modes` the residues are purely imaginary,
    as those of a proportionally damped structure are.
    """
    lines = laplace(frequency_hz, rate_1_s)
    columns = basis(lines, np.asarray(poles), residual_terms)
    m = len(poles)
    free = np.arange(m, columns.shape[0]) if real_modes else np.arange(columns.shape[0])
    root = np.ones(accelerance.shape) if weight is None else np.sqrt(weight)
    coefficients = np.zeros((*accelerance.shape[:2], columns.shape[0]))
    for o, i in np.ndindex(*accelerance.shape[:2]):
        a = stack(columns[free] * root[o, i]).T
        norm = np.linalg.norm(a, axis=0)
        b = stack(accelerance[o, i] * root[o, i])
        coefficients[o, i, free] = np.linalg.lstsq(a / norm, b, rcond=None)[0] / norm
    return unpack(coefficients, m, lines.largest)


def stack(values: np.ndarray) -> np.ndarray:
    """Real and imaginary parts one behind the other along the last axis."""
    return np.concatenate([values.real, values.imag], axis=-1)


def synthesize(lines: Lines, poles: np.ndarray, residues: Residues) -> np.ndarray:
    """Response (outputs, inputs, F) of poles, residues and out-of-band terms."""
    up, down = 1 / (lines.x - poles[:, None]), 1 / (lines.x - poles.conj()[:, None])
    modal = residues.residue @ up + residues.residue.conj() @ down
    return lines.factor * (modal + residues.upper[..., None]) + residues.lower[..., None]


def rank_one(residue: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Shape φ (unit length, as real as possible), participation γ with R ≈ φγᵀ, and the share.

    residue (outputs, inputs) complex without NaN. The share in (0, 1] is the part of ‖R‖² that
    one mode can explain: 1 for a single mode, less where two are lumped together or noise rules.
    """
    left, singular, right = np.linalg.svd(residue, full_matrices=False)
    rotation = realign(left[:, 0])
    shape = left[:, 0] * rotation
    total = float(np.sum(singular**2))
    share = float(singular[0] ** 2 / total) if total > 0 else 1.0
    return shape, singular[0] * right[0] / rotation, share


def realign(shape: np.ndarray) -> complex:
    """Unit factor that turns a complex vector as close to real as possible, largest part > 0."""
    phase = np.angle(np.sum(shape**2)) / 2
    turned = shape * np.exp(-1j * phase)
    sign = np.sign(turned.real[np.argmax(np.abs(turned))]) or 1.0
    return complex(sign * np.exp(-1j * phase))


def collinearity(shape: np.ndarray) -> float:
    """Mode phase collinearity in [0, 1]: 1 for a shape all in phase (Pappa et al., 1993)."""
    centred = np.asarray(shape)
    xx, yy = np.sum(centred.real**2), np.sum(centred.imag**2)
    xy = np.sum(centred.real * centred.imag)
    if xx + yy == 0:
        return 0.0
    return float(((xx - yy) ** 2 + 4 * xy**2) / (xx + yy) ** 2)
