"""Residues by least squares in the frequency domain (LSFD), with out-of-band terms.

Accelerance of one entry: Σ s²[R/(s−λ) + R*/(s−λ*)] + L + s V + s² U, L and U standing for the
modes below and above the band (Heylen, Lammens, Sas, Modal Analysis Theory and Testing, 1997,
A.3), with a term 1/s² more where modes lie close below; all may be complex, because the modes
outside are damped. s = iω, or iω + rate where the records carry an exponential window e^{−rate·t}:
the transform of the windowed record is that of the record itself at iω + rate, so poles and
residues need no correction afterwards.

A record that ends before its decay lacks the tail that starts at its end. With the end a time τ
after the pulse, s² becomes s² − λ² e^{(λ−s)τ}: exact for an impulse, and it is not leakage that
a window would have to hide, for the tail has the same poles.
"""

from dataclasses import dataclass

import numpy as np

from planner.frf.frf import Frf


@dataclass(frozen=True, eq=False)
class Lines:
    """Where a model of poles is evaluated: factor · [R/(x−p) + R*/(x−p*)] + rest.

    Accelerance: x = s, factor = s², rest 1, s, s². A sampled free decay: x = e^{s·step},
    factor = x, rest 1, x. `tail_s` is the time from pulse to end of record (accelerance only).
    """

    x: np.ndarray  # (F,) complex
    factor: np.ndarray  # (F,) complex
    rest: np.ndarray  # (terms, F) complex
    tail_s: float = np.inf

    def part(self, chosen: slice | np.ndarray) -> "Lines":
        """Some of the lines."""
        return Lines(self.x[chosen], self.factor[chosen], self.rest[:, chosen], self.tail_s)


def laplace(
    frequency_hz: np.ndarray, rate_1_s: float = 0.0, tail_s: float = np.inf, near: bool = False
) -> Lines:
    """Accelerance lines (Hz) of records windowed by e^{−rate·t}: s = iω + rate.

    `near`: modes lie close below, as those of the suspension do. Their accelerance is
    R·(1 − ω₀²/ω² + …) there, so that a term 1/s² is added (none at s = 0).
    """
    s = 2j * np.pi * np.asarray(frequency_hz) + rate_1_s
    rest = [np.ones_like(s), s, s**2]
    if near:
        rest.insert(1, np.divide(1, s**2, out=np.zeros_like(s), where=s != 0))
    return Lines(s, s**2, np.stack(rest), tail_s)


def unit(lines: Lines, poles: np.ndarray) -> np.ndarray:
    """Response (…, m, F) to a unit residue of each pole (…, m), its conjugate's left out."""
    apart = lines.x - poles[..., None]
    if not np.isfinite(lines.tail_s):
        return lines.factor / apart
    # A pole that grows would blow the tail up; only those that decay as recorded come this far.
    tail = poles[..., None] ** 2 * np.exp(-apart * lines.tail_s)
    return (lines.factor - tail) / apart


def response(lines: Lines, poles: np.ndarray, residue: np.ndarray) -> np.ndarray:
    """(e, F) of poles (m,) with residues (e, m)."""
    return residue @ unit(lines, poles) + residue.conj() @ unit(lines, poles.conj())


def unit_slope(lines: Lines, poles: np.ndarray) -> np.ndarray:
    """Derivative of `unit` by the poles (complex-analytic)."""
    apart = lines.x - poles[..., None]
    if not np.isfinite(lines.tail_s):
        return lines.factor / apart**2
    p = poles[..., None]
    end = np.exp(-apart * lines.tail_s)
    change = (2 * p + p**2 * lines.tail_s) * end
    return (lines.factor - p**2 * end) / apart**2 - change / apart


def basis(lines: Lines, poles: np.ndarray, residual_terms: bool = True) -> np.ndarray:
    """Response to unit real and imaginary parts of every coefficient, (…, columns, F) complex.

    poles (…, m) in the plane of `lines`. Columns: Re R of each mode, Im R of each mode, then
    the real parts of the out-of-band coefficients, then the imaginary ones.
    """
    up, down = unit(lines, poles), unit(lines, poles.conj())
    columns = [up + down, 1j * (up - down)]
    if residual_terms:
        rest = np.broadcast_to(lines.rest, (*up.shape[:-2], *lines.rest.shape))
        columns += [rest, 1j * rest]
    return np.concatenate(columns, axis=-2)


def basis_slope(lines: Lines, poles: np.ndarray) -> np.ndarray:
    """Basis (…, 2m, F) of the derivative by the poles (…, m), for unit Re R and Im R.

    ∂H/∂Re p = Re R·first + Im R·second and ∂H/∂Im p = Re R·second − Im R·first.
    """
    up, down = unit_slope(lines, poles), unit_slope(lines, poles.conj())
    return np.concatenate([up + down, 1j * (up - down)], axis=-2)


def unpack(coefficients: np.ndarray, modes: int) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of `basis` (…, columns) as residues (…, m) and those of `Lines.rest` (…, t)."""
    own, rest = np.split(coefficients, [2 * modes], axis=-1)
    return complex_of(own), complex_of(rest)


def complex_of(parts: np.ndarray) -> np.ndarray:
    """(…, m) of real, then imaginary parts (…, 2m)."""
    real, imag = np.split(parts, 2, axis=-1)
    return real + 1j * imag


def lsfd(
    frequency_hz: np.ndarray,
    accelerance: np.ndarray,
    poles: np.ndarray,
    weight: np.ndarray | None = None,
    rate_1_s: float = 0.0,
    tail_s: float = np.inf,
) -> np.ndarray:
    """Residues (…, outputs, inputs, m) in m/(N·s) of given poles.

    frequency_hz (F,); accelerance (…, outputs, inputs, F) in m/s²/N; poles (m,) in rad/s; weight
    (outputs, inputs, F), usually 1/variance.
    """
    columns = basis(laplace(frequency_hz, rate_1_s, tail_s), np.asarray(poles))
    shape = accelerance.shape[:-1]
    values = accelerance.reshape(-1, *accelerance.shape[-3:])
    root = np.ones(values.shape[1:]) if weight is None else np.sqrt(weight)
    coefficients = np.zeros((*values.shape[:3], columns.shape[0]))
    for o, i in np.ndindex(*root.shape[:2]):
        a, b = stack(columns * root[o, i]).T, stack(values[:, o, i] * root[o, i]).T
        norm = np.linalg.norm(a, axis=0)
        coefficients[:, o, i] = (np.linalg.lstsq(a / norm, b, rcond=None)[0] / norm[:, None]).T
    return unpack(coefficients.reshape(*shape, -1), len(poles))[0]


def stack(values: np.ndarray) -> np.ndarray:
    """Real and imaginary parts one behind the other along the last axis."""
    return np.concatenate([values.real, values.imag], axis=-1)


def rank_one(residue: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shape φ (unit length, as real as possible) and participation γ with R ≈ φγᵀ.

    residue (outputs, inputs) complex without NaN.
    """
    left, singular, right = np.linalg.svd(residue, full_matrices=False)
    rotation = realign(left[:, 0])
    return left[:, 0] * rotation, singular[0] * right[0] / rotation


def realign(shape: np.ndarray) -> complex:
    """Unit factor that turns a complex vector as close to real as possible, largest part > 0."""
    phase = np.angle(np.sum(shape**2)) / 2
    turned = shape * np.exp(-1j * phase)
    sign = np.sign(turned.real[np.argmax(np.abs(turned))]) or 1.0
    return complex(sign * np.exp(-1j * phase))


def residue_changes(
    frf: Frf,
    poles: np.ndarray,
    outside: np.ndarray,
    band_hz: tuple[float, float],
    changes: np.ndarray,
) -> np.ndarray:
    """Residues (c, m, 3, 3) in m/(N·s) that changes of an FRF add to those of its poles.

    Least squares with the weights of the FRF's own fit, out-of-band terms free.

    Args:
        frf: The FRF that the residues are of.
        poles: (m,) in rad/s.
        outside: Poles (k,) beside the band by which it may change too.
        band_hz: In which it is compared.
        changes: (c, 3, 3, F) in m/s²/N at its lines; columns that were never hit do not count.
    """
    f, m = frf.frequency_hz, len(poles)
    chosen = (f >= band_hz[0]) & (f <= min(band_hz[1], frf.usable_band_hz[1]))
    hit = np.flatnonzero(frf.measured)
    variance = frf.variance[:, hit][..., chosen]
    known = np.all(np.isfinite(variance) & (variance > 0), axis=-1, keepdims=True)
    weight = 1 / np.where(known, variance, 1.0)
    every = np.concatenate([poles, outside])
    values = changes[:, :, hit][..., chosen]
    found = lsfd(f[chosen], values, every, weight, frf.exponential_rate_1_s, frf.tail_s)
    out = np.zeros((len(changes), m, 3, 3), dtype=complex)
    out[..., hit] = np.moveaxis(found[..., :m], -1, 1)
    return out
