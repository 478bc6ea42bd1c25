"""Least squares over poles in the frequency domain, by maximum likelihood.

The residues enter linearly and are eliminated (variable projection, Golub and Pereyra 1973, in
Kaufman's form), so that Gauss–Newton runs over the poles only. The noise of a line is circular
complex normal with the stated variance E|δH|²; at the solution the linearised equations give the
covariance of poles and residues (Pintelon and Schoukens, System Identification, 2012, ch. 9).

Entries whose variance is a level for each times one profile of lines share one matrix: they are a
set. Sets of few entries are computed together; a loop over them would spend most of its time
between the sums.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from planner.modal.residues import Lines, basis, basis_slope, complex_of, stack, unpack

MAX_ITERATIONS = 30
# Few lines around a resonance are fitted nearly quadratically: the damping may vanish at once.
# At first, by how much less after a step that gained and more after one that did not, at most.
DAMPING, LIGHTER, HEAVIER, MOST = 1e-3, 0.1, 10.0, 1e8


@dataclass(frozen=True, eq=False)
class WeightedSets:
    """Responses by set, weighted: `values` (k, e, 2F) real, then imaginary parts.

    Sets with fewer entries than others are filled up by entries of weight zero; `entries` (k, e)
    are the indices of what is measured, −1 elsewhere, `weight` (k, e) is 2/level, `root` (k, 1, F)
    that of the profile by which lines count.
    """

    lines: Lines
    entries: np.ndarray
    values: np.ndarray
    weight: np.ndarray
    root: np.ndarray

    @classmethod
    def of(
        cls,
        lines: Lines,
        response: np.ndarray,
        variance: np.ndarray,
        sets: tuple[np.ndarray, ...] | None = None,
    ) -> "WeightedSets":
        """From responses and variance (entries, F), in each set a level times a profile.

        Without `sets` all entries are one, or one each where their profiles differ.
        """
        if sets is None:
            every = np.arange(len(response))
            sets = (every,) if proportional(variance) else tuple(every[:, None])
        entries = np.full((len(sets), max(map(len, sets))), -1)
        for row, chosen in zip(entries, sets, strict=True):
            row[: len(chosen)] = chosen
        first = variance[entries[:, :1]]
        root = np.sqrt(first[..., :1] / first)
        there = entries >= 0
        values = stack(response[entries] * root) * there[..., None]
        weight = np.where(there, 2 / variance[entries, 0], 0.0)
        return cls(lines, entries, values, weight, root)


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


@dataclass(frozen=True, eq=False)
class PoleFit:
    """Poles and residues at the minimum of χ² = Σ 2|H − fit|²/variance, and their covariance.

    Poles and their covariance are in the plane of the lines, of `mode_selection.fit` in rad/s.
    `excess` (F,) ≥ 1 is χ² per degree of freedom (and of information) around a line, 1 where that
    was not asked for.
    """

    poles: np.ndarray  # (m,)
    chi2: float
    pole_covariance: np.ndarray  # (2m, 2m) of real parts (all modes), then imaginary parts
    residue_variance: np.ndarray  # (outputs, inputs, m) of real and imaginary part each
    significance: np.ndarray  # (m,) rise of χ² if the mode were left out, poles of others held
    coefficients: np.ndarray  # (entries, columns) of `residues.basis`
    inverse: np.ndarray  # (entries, columns, columns) of their normal matrix, poles held
    sensitivity: np.ndarray  # (entries, columns, 2m): change of coefficients with the poles
    variance: np.ndarray  # (outputs, inputs, F) that weighted the fit
    excess: np.ndarray

    @property
    def residue(self) -> np.ndarray:
        """(outputs, inputs, m)."""
        found = unpack(self.coefficients, self.poles.size)[0]
        return found.reshape(*self.variance.shape[:2], -1)


def refine(
    lines: Lines,
    response: np.ndarray,
    variance: np.ndarray,
    poles: np.ndarray,
    allowed: Callable[[np.ndarray], bool],
) -> PoleFit:
    """Minimise the weighted error over poles and residues, starting from `poles`.

    response and variance (outputs, inputs, F), finite, variance > 0, at `lines`; poles (m,),
    m ≥ 1, in the plane of `lines`; a step to poles that are not `allowed` is shortened.
    """
    count = response.shape[-1]
    data = WeightedSets.of(lines, response.reshape(-1, count), variance.reshape(-1, count))
    poles = np.asarray(poles, complex)
    point, damping = reduced_together(data, poles), DAMPING
    # Damped Gauss-Newton steps (Levenberg-Marquardt)
    for _ in range(MAX_ITERATIONS):
        # In units in which the diagonal is 1: the damping is relative to it.
        diagonal = np.diagonal(point.normal)
        unit = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
        damped = point.normal * np.outer(unit, unit) + damping * np.eye(len(unit))
        step = -unit * np.linalg.lstsq(damped, unit * point.gradient)[0]
        there = poles + complex_of(step)
        tried = reduced_together(data, there) if allowed(there) else None
        settled = tried is not None and damping < DAMPING and _still(point, tried, step)
        if tried is not None and tried.chi2 < point.chi2:
            poles, point, damping = there, tried, LIGHTER * damping
        else:
            damping *= HEAVIER
        if settled or damping > MOST:
            break
    return _finish(data, poles, point, variance)


def _still(before: ReducedFit, after: ReducedFit, step: np.ndarray) -> bool:
    """Whether a step changed nothing: far below a standard deviation, or by rounding alone.

    A short step tells nothing as long as damping keeps it short.
    """
    sds = np.abs(step) * np.sqrt(np.maximum(np.diag(before.normal), 0.0))
    return bool(np.max(sds) < 1e-3 or abs(before.chi2 - after.chi2) < 1e-9 * before.chi2)


def shared_error(lines: Lines, fit: PoleFit, errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Covariance of poles (2m, 2m) and variance of residues that errors common to lines add.

    errors (n, outputs, inputs, F): what each of n independent sources, at one standard deviation,
    adds to the response. The residues' variance (outputs, inputs, m) is that of real and imaginary
    part each.
    """
    m, count = fit.poles.size, fit.variance.shape[-1]
    shape = fit.variance.shape[:2]
    if not len(errors):
        return np.zeros((2 * m, 2 * m)), np.zeros((*shape, m))
    p = fit.coefficients.shape[1]
    poles = fit.poles
    columns = np.concatenate([basis(lines, poles), basis_slope(lines, poles)])
    both = np.concatenate([columns.real, columns.imag], axis=1)
    weighted = (errors * 2 / fit.variance).reshape(len(errors), -1, count)
    cross = np.concatenate([weighted.real, weighted.imag], axis=-1) @ both.T
    turn = slope_turn(fit.coefficients, m)
    gradient = np.einsum("eka,nek->na", turn, cross[..., p:])
    gradient += np.einsum("eka,nek->na", fit.sensitivity, cross[..., :p])
    change = gradient @ fit.pole_covariance
    moved = np.einsum("ekl,nel->nek", fit.inverse, cross[..., :p])
    moved += np.einsum("eka,na->nek", fit.sensitivity, change)
    residue = of_each(np.sum(moved**2, axis=0), m)
    return change.T @ change, residue.reshape(*shape, m)


def of_each(square: np.ndarray, m: int) -> np.ndarray:
    """(…, m) variance of residues' real and imaginary part each, from all coefficients' (…, c)."""
    return (square[..., :m] + square[..., m : 2 * m]) / 2


def scaled_inverse(
    normal: np.ndarray, rcond: float = 1e-15, least: np.ndarray | float = 1e-300
) -> np.ndarray:
    """Pseudo-inverse of a matrix (n, n) of unknowns that differ in unit and size.

    Diagonal entries count as `least` (n,) at least: below, rounding rules.
    """
    unit = np.sqrt(np.maximum(np.diag(normal).real, least))
    inverse = np.linalg.pinv(normal / unit[:, None] / unit, rcond=rcond, hermitian=True)
    return inverse / unit[:, None] / unit


def _finish(
    data: WeightedSets, poles: np.ndarray, point: ReducedFit, variance: np.ndarray
) -> PoleFit:
    shape, count = variance.shape[:2], variance.shape[-1]
    m, p = poles.size, point.inverse.shape[-1]
    covariance = np.linalg.pinv(point.normal, hermitian=True)
    coefficients = point.coefficients.reshape(-1, p)
    inverse = (point.inverse[:, None] / data.weight[..., None, None]).reshape(-1, p, p)
    sensitivity = point.sensitivity.reshape(-1, p, 2 * m)
    spread = np.einsum("eka,ab,ekb->ek", sensitivity, covariance, sensitivity)
    # Of rounding, where lines without noise leave curvatures almost singular, variances below 0
    square = np.maximum(np.einsum("ekk->ek", inverse) + spread, 0.0)
    return PoleFit(
        poles,
        float(point.chi2),
        covariance,
        of_each(square, m).reshape(*shape, m),
        point.significance(data.weight),
        coefficients,
        inverse,
        sensitivity,
        variance,
        np.ones(count),
    )
