"""Measured receptances as few common modes: what noise adds from line to line is taken out.

Rotations are small differences of measured motions, so noise is what limits them most. All FRFs of
one structure share their poles: vector fitting (Gustavsen and Semlyen, IEEE Trans. Power Delivery
14, 1999; relaxed, 21, 2006) finds where these are, maximum likelihood refines them, and there are
as many as the noise tells from nothing.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.milling.coupling import TipReceptance
from planner.modal.refine import Refined, refine
from planner.modal.residues import basis, basis_slope, laplace

PAIRS = (4, 6, 8, 10, 12, 15, 19, 24)  # of conjugate poles that are tried
PATIENCE = 2  # numbers of pairs in turn that may gain nothing
STEPS, STILL = 20, 1e-4  # of moving poles, and by how much of themselves they rest
FIRST_DAMPING = 0.01
# χ² per degree of freedom up to which a fit counts as one to the noise, and may be used.
FITS = 1.3
SWINGS = 0.3  # damping ratio from which a pole of the start stands for no mode
ABOVE = 1.5  # of the last line's frequency: where a mode above the lines is first looked for
NO_TRACE = 1e-8  # of scaled normal equations: eigenvalues below are rounding
LINES_PER_NUMBER = 3.0  # real values for each unknown number of an entry, at least
TERMS = 6  # of modes outside the lines, for each entry


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Receptances (F, n, n) of common poles (p,) in rad/s, their sd, χ² per degree of freedom."""

    poles: np.ndarray
    receptance: np.ndarray
    sd: np.ndarray
    chi2: float


def smoothed(tip: TipReceptance) -> TipReceptance:
    """The same from smoothed measured values, and a remark; as it is where no sd is stated.

    Also as it is, and said so, where no such fit comes near the noise.
    """
    if not np.all(tip.sd > 0):
        return tip
    found = fit(tip.frequency_hz, tip.measured, tip.sd)
    if found is None or found.chi2 > FITS:
        text = "The FRFs are used line by line: few common modes do not follow them to their noise."
        return replace(tip, remarks=(*tip.remarks, text))
    text = (
        f"The FRFs are those of {len(found.poles)} common modes fitted to them, "
        f"misfit {np.sqrt(found.chi2):.2f} of their noise."
    )
    remarks = (*tip.remarks, text)
    return replace(tip, measured=found.receptance, sd=found.sd, remarks=remarks)


def fit(frequency_hz: np.ndarray, values: np.ndarray, sd: np.ndarray) -> Smoothed | None:
    """The fit by the number of poles that the Bayesian information criterion likes best.

    values (F, n, n) at lines (F,) in Hz, sd of the same shape. None where there are too few lines.
    """
    count, square = len(values), (2 * np.pi * frequency_hz) ** 2
    accelerance = np.moveaxis(-values * square[:, None, None], 0, -1)
    variance = np.moveaxis(sd * square[:, None, None], 0, -1) ** 2
    scale = 2 * np.pi * frequency_hz[-1]
    # √(E|δ|²/2) is the sd of each real value.
    data, weight = values.reshape(count, -1).T, np.sqrt(2) / sd.reshape(count, -1).T
    best, least, worse = None, np.inf, 0
    for pairs in PAIRS:
        unknown = 2 * pairs + TERMS
        if 2 * count < LINES_PER_NUMBER * unknown or worse >= PATIENCE:
            break
        start = _relocated(2j * np.pi * frequency_hz / scale, data, weight, pairs) * scale
        penalty = 2 * (len(data) + 1) * np.log(2 * data.size)
        found = _refined(frequency_hz, accelerance, variance, start, penalty)
        unknown = 2 * len(found.poles) + TERMS
        criterion = found.chi2 + (unknown * len(data) + 2 * len(found.poles)) * np.log(
            2 * data.size
        )
        worse = 0 if criterion < least else worse + 1
        if criterion < least:
            best, least = found, criterion
    if best is None:
        return None
    fitted, spread = _values(frequency_hz, best, variance)
    shaped = (np.moveaxis(a, -1, 0) / square[:, None, None] for a in (-fitted, spread))
    return Smoothed(best.poles, *shaped, best.chi2 / max(best.degrees, 1))


def _refined(
    frequency_hz: np.ndarray, accelerance: np.ndarray, variance: np.ndarray, poles: np.ndarray,
    penalty: float,
) -> Refined:  # fmt: skip
    """The likeliest poles from a start, those left out whose χ² is not worth the penalty."""
    swing = poles[-poles.real < SWINGS * np.abs(poles)]
    # One stands for the nearest mode above the lines: the rest's few terms do not follow it.
    poles = np.append(swing, ABOVE * 2 * np.pi * frequency_hz[-1] * (-FIRST_DAMPING + 1j))
    while True:
        found = refine(laplace(frequency_hz), accelerance, variance, poles, _decaying)
        needed = found.significance > penalty
        if np.all(needed) or len(poles) == 1:
            return found
        # One after the other: of two that stand for the same mode neither seems needed.
        poles = np.delete(found.poles, np.argmin(found.significance))


def _decaying(poles: np.ndarray) -> bool:
    return bool(np.all(poles.real < 0) and np.all(poles.imag > 0))


def _values(
    frequency_hz: np.ndarray, found: Refined, variance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Accelerance (n, n, F) of a fit, and the root of E|error|² that the noise leaves in it.

    Residues are each entry's own; the poles, which all entries share, err as all of them let them.
    """
    lines, m = laplace(frequency_hz), len(found.poles)
    columns, slope = basis(lines, found.poles).T, basis_slope(lines, found.poles).T
    weight = np.sqrt(2 / variance.reshape(-1, variance.shape[-1]))
    fitted, both, slopes = [], [], []
    for heavy, c in zip(weight, found.point.coefficients, strict=True):
        a = _real(heavy[:, None] * columns)
        q, _ = np.linalg.qr(a / np.linalg.norm(a, axis=0))
        real, imag = slope[:, :m], slope[:, m:]
        # ∂H/∂Re p = Re R·first + Im R·second, ∂H/∂Im p = Re R·second − Im R·first
        turned = [c[:m] * real + c[m : 2 * m] * imag, c[:m] * imag - c[m : 2 * m] * real]
        moved = _real(heavy[:, None] * np.concatenate(turned, axis=1))
        slopes.append(moved - q @ (q.T @ moved))
        both.append(np.sum(q**2, axis=1))
        fitted.append(columns @ c)
    normal = np.sum([m.T @ m for m in slopes], axis=0)
    size = np.sqrt(np.maximum(np.diagonal(normal), 1e-300))
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    # A direction in which poles move without a trace is one of poles that nothing needs.
    root = vectors / np.sqrt(np.maximum(values, NO_TRACE)) / size[:, None]
    whole = np.array(
        [b + np.sum((d @ root) ** 2, axis=1) for b, d in zip(both, slopes, strict=True)]
    )
    count = len(frequency_hz)
    spread = np.sqrt(whole[:, :count] + whole[:, count:]) / weight
    return np.reshape(fitted, variance.shape), spread.reshape(variance.shape)


def _first(s: np.ndarray, pairs: int) -> np.ndarray:
    """Poles spread evenly, on a logarithmic scale, over the lines."""
    omega = np.geomspace(s[0].imag * 1.05, s[-1].imag * 0.98, pairs)
    return omega * (-FIRST_DAMPING + 1j)


def _basis(s: np.ndarray, poles: np.ndarray) -> np.ndarray:
    """(F, 2p) of unit real and imaginary parts of residues of poles with positive frequency."""
    up, down = 1 / (s[:, None] - poles), 1 / (s[:, None] - poles.conj())
    return np.concatenate([up + down, 1j * (up - down)], axis=1)


def _rest(s: np.ndarray) -> np.ndarray:
    """(F, 6): modes below and above the lines, with complex sizes as they are damped."""
    terms = np.stack([s[0] ** 2 / s**2, np.ones_like(s), s**2], axis=1)
    return np.concatenate([terms, 1j * terms], axis=1)


def _real(values: np.ndarray) -> np.ndarray:
    return np.concatenate([values.real, values.imag], axis=0)


def _relocated(s: np.ndarray, data: np.ndarray, weight: np.ndarray, pairs: int) -> np.ndarray:
    """Poles (pairs,) after steps of vector fitting to data (k, F), until they rest."""
    poles = _first(s, pairs)
    for _ in range(STEPS):
        moved = _step(s, data, weight, poles)
        change = np.abs(np.sort_complex(moved) - np.sort_complex(poles)) / np.abs(poles)
        poles = moved
        if np.max(change) < STILL:
            break
    return poles


def _step(s: np.ndarray, data: np.ndarray, weight: np.ndarray, poles: np.ndarray) -> np.ndarray:
    common = _basis(s, poles)
    own = np.concatenate([common, _rest(s)], axis=1)
    sigma = np.concatenate([common, np.ones((len(s), 1))], axis=1)
    blocks = []
    for values, heavy in zip(data, weight, strict=True):
        a = _real(heavy[:, None] * np.concatenate([own, -values[:, None] * sigma], axis=1))
        r = np.asarray(np.linalg.qr(a, mode="r"))
        blocks.append(r[own.shape[1] :, own.shape[1] :])
    # Relaxed: the sum of the real part of σ over the lines is not zero.
    total = np.sum(sigma.real, axis=0)
    size = np.sqrt(np.mean([np.sum(b**2) for b in blocks])) / np.linalg.norm(total)
    a = np.concatenate([*blocks, size * total[None]])
    b = np.append(np.zeros(len(a) - 1), size * len(s))
    norm = np.linalg.norm(a, axis=0)
    solved = np.linalg.lstsq(a / norm, b, rcond=None)[0] / norm
    level = solved[-1] if abs(solved[-1]) > 1e-8 else 1e-8
    return _zeros(poles, solved[:-1] / level)


def _zeros(poles: np.ndarray, residues: np.ndarray) -> np.ndarray:
    """Zeros of σ = 1 + Σ residues · basis, turned to decay; they are the next poles."""
    p = len(poles)
    a = np.block([[np.diag(poles.real), np.diag(poles.imag)],
                  [np.diag(-poles.imag), np.diag(poles.real)]])  # fmt: skip
    b = np.concatenate([2 * np.ones(p), np.zeros(p)])
    found = np.linalg.eigvals(a - np.outer(b, residues))
    found = np.where(found.real > 0, -found.conj(), found)
    swinging = found[found.imag > 1e-9 * np.abs(found)]
    real = np.sort(found[np.abs(found.imag) <= 1e-9 * np.abs(found)].real)
    # Two real poles become a pair again, strongly damped: the number of pairs stays.
    pairs = [complex(-abs(x), abs(x) * 0.1) for x in np.sqrt(real[::2] * real[1::2])]
    return np.sort_complex(np.concatenate([swinging, pairs]))
