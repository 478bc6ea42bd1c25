"""The linear part of a fit of poles: residues at their best, and how χ² goes on from there.

The residues enter linearly and are eliminated (variable projection, Golub and Pereyra 1973, in
Kaufman's form), so that Gauss–Newton runs over the poles only. The noise of a line is circular
complex normal with the stated variance E|δH|².

Entries whose variance is a level for each times one profile of lines share one matrix: they are a
set. Sets of few entries are computed together; a loop over them would spend most of its time
between the sums.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.modal.residues import Lines, basis, basis_slope, stack


class WeightedSets:
    """Responses by set, weighted: `values` (k, e, 2F) real, then imaginary parts.

    Sets with fewer entries than others are filled up by entries of weight zero; `entries` (k, e)
    are the indices of what is measured, −1 elsewhere, `weight` (k, e) is 2/level, `root` (k, 1, F)
    that of the profile by which lines count.
    """

    def __init__(
        self,
        lines: Lines,
        response: np.ndarray,
        variance: np.ndarray,
        sets: tuple[np.ndarray, ...] = (),
    ) -> None:
        """From responses and variance (entries, F), in each set a level times a profile.

        Without `sets` all entries are one, or one each where their profiles differ.
        """
        if not sets:
            every = np.arange(len(response))
            sets = (every,) if proportional(variance) else tuple(every[:, None])
        entries = np.full((len(sets), max(map(len, sets))), -1)
        for row, chosen in zip(entries, sets, strict=True):
            row[: len(chosen)] = chosen
        first, there = variance[entries[:, :1]], entries >= 0
        self.lines, self.entries, self.root = lines, entries, np.sqrt(first[..., :1] / first)
        self.values = stack(response[entries] * self.root) * there[..., None]
        self.weight = np.where(there, 2 / variance[entries, 0], 0.0)


@dataclass(frozen=True, eq=False)
class ReducedFit:
    """At poles of each set: residues at their best, and how χ² of the set goes on.

    `coefficients` (k, e, columns); `chi2` (k,), the `gradient` (k, 2m) of half of it and `normal`
    (k, 2m, 2m) by real, then imaginary parts of the poles; `inverse` (k, columns, columns) of the
    linear normal matrix for weight one; `turned` (k, columns, 2m): change of coefficients by the
    slope basis. Of all sets together k is left out where it can be summed.
    """

    coefficients: np.ndarray
    chi2: np.ndarray
    gradient: np.ndarray
    normal: np.ndarray
    inverse: np.ndarray
    turned: np.ndarray

    @property
    def sensitivity(self) -> np.ndarray:
        """(k, e, columns, 2m): change of the coefficients with the poles."""
        turn = slope_turn(self.coefficients, self.turned.shape[-1] // 2)
        return self.turned[:, None] @ turn

    def significance(self, weight: np.ndarray) -> np.ndarray:
        """(m,) Wald statistic of each mode's residues: 2 · entries degrees of freedom by chance."""
        m = self.turned.shape[-1] // 2
        pair = np.stack([np.arange(m), m + np.arange(m)], axis=1)
        value = self.coefficients[..., pair]
        block = np.linalg.pinv(self.inverse[:, pair[:, :, None], pair[:, None, :]], hermitian=True)
        return np.einsum("ke,kemi,kmij,kemj->m", weight, value, block, value)


def reduced(data: WeightedSets, poles: np.ndarray) -> ReducedFit:
    """Evaluate sets at their poles (k, m), or all at the same (1, m), in the plane of the lines."""
    k, m = len(data.entries), poles.shape[1]
    # At once: values of one column for all poles and sets of a block, to stay in the cache
    block = max(1, 30_000 // max(1, m * data.lines.x.size))
    some = [slice(i, i + block) for i in range(0, k, block)]
    parts = [_block(data, poles if len(poles) == 1 else poles[own], own) for own in some]
    return ReducedFit(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def reduced_together(data: WeightedSets, poles: np.ndarray) -> ReducedFit:
    """The same where all sets have the same poles (m,)."""
    found = reduced(data, poles[None])
    total = (np.sum(part, axis=0) for part in (found.chi2, found.gradient, found.normal))
    return replace(found, **dict(zip(("chi2", "gradient", "normal"), total, strict=True)))


def _block(data: WeightedSets, poles: np.ndarray, which: slice) -> tuple[np.ndarray, ...]:
    m, values, weight = poles.shape[1], data.values[which], data.weight[which]
    linear = basis(data.lines, poles)
    p = linear.shape[-2]
    both = np.concatenate([linear, basis_slope(data.lines, poles)], axis=-2)
    both = stack(both * data.root[which])
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
    chi2 = np.sum(weight * (np.sum(values**2, -1) - np.sum(found * cross[..., :p], -1)), axis=1)
    coefficients = found / norm[:, None, :p]
    k, e = weight.shape
    real, imag = coefficients[..., :m], coefficients[..., m : 2 * m]
    # How the slope basis (u) combines into slopes by Re λ and Im λ (p), as in `slope_turn`
    turn = np.stack([real, -imag, imag, real], axis=2)
    products = turn.reshape(k, e, 4 * m).transpose(0, 2, 1) * weight[:, None]
    products = (products @ turn.reshape(k, e, 4 * m)).reshape(k, 2, 2, m, 2, 2, m)
    normal = np.einsum("kupmvqn,kumvn->kpmqn", products, curve.reshape(k, 2, m, 2, m))
    gradient = np.einsum("keupm,keum->kpm", turn.reshape(k, e, 2, 2, m), off.reshape(k, e, 2, m))
    return (
        coefficients,
        np.maximum(chi2, 0.0),
        gradient.reshape(k, 2 * m),
        normal.reshape(k, 2 * m, 2 * m),
        inverse / norm[:, :p, None] / norm[:, None, :p],
        turned * norm[:, None, p:] / norm[:, :p, None],
    )


def proportional(weight: np.ndarray) -> bool:
    """Whether the weights (entries, F) are a level for each entry times one profile of lines."""
    product = weight[:, :1] * (weight[:1] / weight[0, 0])
    return bool(np.all(np.abs(weight - product) <= 1e-12 * product))


def slope_turn(coefficients: np.ndarray, m: int) -> np.ndarray:
    """(…, 2m, 2m) of (…, columns): how the slope basis combines into ∂H/∂Re λ and ∂H/∂Im λ."""
    real, imag = coefficients[..., :m], coefficients[..., m : 2 * m]
    turn = np.zeros((*real.shape[:-1], 2 * m, 2 * m))
    index = np.arange(m)
    turn[..., index, index] = turn[..., m + index, m + index] = real
    turn[..., m + index, index], turn[..., index, m + index] = imag, -imag
    return turn


def scaled_inverse(
    normal: np.ndarray, rcond: float = 1e-15, least: np.ndarray | float = 1e-300
) -> np.ndarray:
    """Pseudo-inverse of a matrix (n, n) of unknowns that differ in unit and size.

    Diagonal entries count as `least` (n,) at least: below, rounding rules.
    """
    unit = np.sqrt(np.maximum(np.diag(normal).real, least))
    inverse = np.linalg.pinv(normal / unit[:, None] / unit, rcond=rcond, hermitian=True)
    return inverse / unit[:, None] / unit
