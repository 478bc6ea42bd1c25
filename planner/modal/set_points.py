"""Residues and the slope of the error at given poles, for all sets of a matrix of FRFs at once.

The variance is a level for each entry times one profile of lines, so that the entries of a set
share one matrix. Sets of few entries are computed together; a loop over them would spend most of
its time between the sums.
"""

from dataclasses import dataclass

import numpy as np

from planner.modal.residues import (
    Lines,
    Residues,
    basis,
    basis_slope,
    stack,
    synthesize,
    unpack,
)


@dataclass(frozen=True, eq=False)
class SetData:
    """Responses by set, weighted: `values` (k, e, 2F) real, then imaginary parts.

    Sets with fewer entries than others are filled up by entries of weight zero; `entries` (k, e)
    are the indices of what is measured, −1 elsewhere, `weight` (k, e) is 2/level, `root` (F,) that
    of the profile by which lines count.
    """

    lines: Lines
    entries: np.ndarray
    values: np.ndarray
    weight: np.ndarray
    root: np.ndarray

    @classmethod
    def of(
        cls, lines: Lines, response: np.ndarray, variance: np.ndarray, sets: tuple[np.ndarray, ...]
    ) -> "SetData":
        """From responses and variance (entries, F), the variance a level times a profile."""
        entries = np.full((len(sets), max(map(len, sets))), -1)
        for row, chosen in zip(entries, sets, strict=True):
            row[: len(chosen)] = chosen
        root = np.sqrt(variance[0, 0] / variance[0])
        weighted = response[entries] * root
        there = entries >= 0
        values = np.concatenate([weighted.real, weighted.imag], axis=-1) * there[..., None]
        weight = np.where(there, 2 / variance[entries, 0], 0.0)
        return cls(lines, entries, values, weight, root)


@dataclass(frozen=True, eq=False)
class SetPoints:
    """At poles of each set: residues at their best, and how χ²/2 of the set goes on.

    `coefficients` (k, e, columns); `gradient` (k, 2m) and `normal` (k, 2m, 2m) by real, then
    imaginary parts of the poles; `inverse` (k, columns, columns) of the linear normal matrix for
    weight one; `turned` (k, columns, 2m): change of coefficients by the slope basis.
    """

    coefficients: np.ndarray
    gradient: np.ndarray
    normal: np.ndarray
    inverse: np.ndarray
    turned: np.ndarray


def set_points(data: SetData, poles: np.ndarray) -> SetPoints:
    """Evaluate sets at their poles (k, m)."""
    k, m = poles.shape
    # At once: values of one column for all poles and sets of a block, to stay in the cache
    block = max(1, 30_000 // max(1, m * data.lines.x.size))
    parts = [_block(data, poles[i : i + block], slice(i, i + block)) for i in range(0, k, block)]
    return SetPoints(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _block(data: SetData, poles: np.ndarray, which: slice) -> tuple[np.ndarray, ...]:
    m, values, weight = poles.shape[1], data.values[which], data.weight[which]
    both, p = _columns(data, poles)
    gram = both @ both.transpose(0, 2, 1)
    norm = np.sqrt(np.maximum(np.einsum("kcc->kc", gram), 1e-300))
    gram /= norm[:, :, None] * norm[:, None, :]
    cross = values @ both.transpose(0, 2, 1) / norm[:, None]
    # Ridge of the residues' normal matrix: keeps poles that coincide apart from rounding
    inverse = np.linalg.inv(gram[:, :p, :p] + 1e-13 * p * np.eye(p))
    found = cross[..., :p] @ inverse
    turned = -inverse @ gram[:, :p, p:]
    curve = gram[:, p:, p:] + gram[:, p:, :p] @ turned
    curve *= norm[:, p:, None] * norm[:, None, p:]
    off = (found @ gram[:, :p, p:] - cross[..., p:]) * norm[:, None, p:] * weight[..., None]
    coefficients = found / norm[:, None, :p]
    real, imag = coefficients[..., :m], coefficients[..., m : 2 * m]
    first, second = off[..., :m], off[..., m:]
    by_real = np.sum(real * first + imag * second, axis=1)
    by_imag = np.sum(real * second - imag * first, axis=1)
    return (
        coefficients,
        np.concatenate([by_real, by_imag], axis=-1),
        _normal(real, imag, weight, curve),
        inverse / norm[:, :p, None] / norm[:, None, :p],
        turned * norm[:, None, p:] / norm[:, :p, None],
    )


def _columns(data: SetData, poles: np.ndarray) -> tuple[np.ndarray, int]:
    """(k, columns, 2F) `basis`, then `basis_slope`, weighted; how many of them are the first."""
    linear = basis(data.lines, poles)
    both = np.concatenate([linear, basis_slope(data.lines, poles)], axis=-2)
    return stack(both * data.root), linear.shape[-2]


def _normal(
    real: np.ndarray, imag: np.ndarray, weight: np.ndarray, curve: np.ndarray
) -> np.ndarray:
    """Σ_e w TᵀPT (k, 2m, 2m) for T = [[Re R, −Im R], [Im R, Re R]] of each entry's residues."""
    m = real.shape[-1]
    aa, ab = curve[:, :m, :m], curve[:, :m, m:]
    ba, bb = curve[:, m:, :m], curve[:, m:, m:]

    def sums(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        return (weight[..., None] * one).transpose(0, 2, 1) @ other

    rr, ri, ii = sums(real, real), sums(real, imag), sums(imag, imag)
    ir = ri.transpose(0, 2, 1)
    top = rr * aa + ri * ab + ir * ba + ii * bb
    side = rr * ab - ri * aa + ir * bb - ii * ba
    low = ii * aa - ir * ab - ri * ba + rr * bb
    return np.block([[top, side], [side.transpose(0, 2, 1), low]])


def significances(point: SetPoints, weight: np.ndarray, m: int) -> np.ndarray:
    """(m,) Wald statistic of each mode's residues, over all sets and entries."""
    pair = np.stack([np.arange(m), m + np.arange(m)], axis=1)
    value = point.coefficients[..., pair]
    block = np.linalg.pinv(point.inverse[:, pair[:, :, None], pair[:, None, :]], hermitian=True)
    return np.einsum("ke,kemi,kmij,kemj->m", weight, value, block, value)


def fitted(
    data: SetData, point: SetPoints, poles: np.ndarray, lines: Lines
) -> tuple[np.ndarray, np.ndarray]:
    """Residues (entries, m) and the responses (entries, F) that they make at `lines`."""
    m, entries = poles.shape[1], int(np.max(data.entries)) + 1
    residue, response = np.zeros((entries, m), complex), np.zeros((entries, lines.x.size), complex)
    for k, own in enumerate(poles):
        there = data.entries[k] >= 0
        found = unpack(point.coefficients[k, there], m)
        residue[data.entries[k, there]] = found.residue
        made = Residues(found.residue[:, None], found.rest[:, None])
        response[data.entries[k, there]] = synthesize(lines, own, made)[:, 0]
    return residue, response
