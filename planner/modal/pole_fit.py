"""Least squares over poles, by maximum likelihood: common to all FRFs, or each set's own too.

At the solution the linearised equations give the covariance of poles and residues (Pintelon and
Schoukens, System Identification, 2012, ch. 9).

Between one set and the next a structure changes a little: a sensor that moves loads it elsewhere,
it warms up, a clamp settles, hits are harder. One pole for all then misfits, and two poles are
found where there is one mode. Here every set k has poles of its own, x_k = x + d_k, d_k normal
with a variance that the sets tell (DerSimonian and Laird 1986); x is what is common. Where sets
agree, the variance is zero and all share one pole.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.inference.student import widening_factor
from planner.modal.fit_data import Data
from planner.modal.least_squares import (
    ReducedFit,
    WeightedSets,
    reduced,
    reduced_together,
    scaled_inverse,
    slope_turn,
)
from planner.modal.residues import basis, basis_slope, complex_of, stack, unpack

ROUNDS = 4  # each a Gauss-Newton step of every set and of what is common
# Farther from the common pole no set's strays: share of its frequency; half bandwidths in damping.
FARTHEST, FARTHEST_DAMPING = 0.015, 2.0


class DivergedPolesError(ValueError):
    """Poles left the band, or their damping the possible: the data do not hold them.

    `astray` (m,) bool says which.
    """

    def __init__(self, astray: np.ndarray) -> None:
        super().__init__("poles strayed")
        self.astray = astray


@dataclass(frozen=True, eq=False)
class PoleFit:
    """Common poles (m,) in rad/s and those of every set (k, m), with coefficients of all entries.

    `covariance` (2m, 2m) of the common poles' real, then imaginary parts, for intervals of 95 %;
    `spread` (2m,) their variance from set to set. `coefficients` (e, c) as `residues.basis` has
    them, `residue_variance` (e, m) of residues' real and imaginary part each. `error` (e, F) that
    is left, `variance` (e, F) that weighted it. `significance` (m,): rise of χ² without the mode,
    poles of others held. `excess` (F,) ≥ 1 is χ² per degree of freedom (and of information) around
    a line, 1 where that was not asked for.
    """

    poles: np.ndarray
    own: np.ndarray
    covariance: np.ndarray
    spread: np.ndarray
    coefficients: np.ndarray
    residue_variance: np.ndarray
    error: np.ndarray
    variance: np.ndarray
    significance: np.ndarray
    excess: np.ndarray | float = 1.0

    @property
    def residue(self) -> np.ndarray:
        """(e, m)."""
        return unpack(self.coefficients, self.poles.size)[0]

    @property
    def chi2(self) -> np.ndarray:
        """(e,) of each entry."""
        return np.sum(2 / self.variance * np.abs(self.error) ** 2, axis=1)

    def part(self, kept: np.ndarray) -> "PoleFit":
        """Some of the modes (bool); the error stays."""
        both = np.tile(kept, 2)
        columns = np.append(both, np.ones(self.coefficients.shape[1] - both.size, bool))
        return replace(
            self, poles=self.poles[kept], own=self.own[:, kept], spread=self.spread[both],
            covariance=self.covariance[np.ix_(both, both)],
            coefficients=self.coefficients[:, columns],
            residue_variance=self.residue_variance[:, kept], significance=self.significance[kept],
        )  # fmt: skip


MAX_ITERATIONS = 30
# Few lines around a resonance are fitted nearly quadratically: the damping may vanish at once.
# At first, by how much less after a step that gained and more after one that did not, at most.
DAMPING, LIGHTER, HEAVIER, MOST = 1e-3, 0.1, 10.0, 1e8


def refine(data: Data, variance: np.ndarray, start: np.ndarray) -> PoleFit:
    """Minimise the error, weighted by a variance (e, F) > 0, over poles that all entries share.

    From `start` (m,) in rad/s, m ≥ 1; a step to poles that are not allowed is shortened.
    """
    sets = WeightedSets(data.lines, data.values, variance)
    poles = data.to_plane(np.asarray(start, complex))
    point, damping = reduced_together(sets, poles), DAMPING
    # Damped Gauss-Newton steps (Levenberg-Marquardt)
    for _ in range(MAX_ITERATIONS):
        # In units in which the diagonal is 1: the damping is relative to it.
        diagonal = np.diagonal(point.normal)
        unit = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
        damped = point.normal * np.outer(unit, unit) + damping * np.eye(len(unit))
        step = -unit * np.linalg.lstsq(damped, unit * point.gradient)[0]
        there = poles + complex_of(step)
        tried = reduced_together(sets, there) if data.allowed(there) else None
        settled = False
        if tried is not None and damping < DAMPING:  # what damping keeps short tells nothing
            # Far below a standard deviation, or changed by rounding alone
            sds = np.abs(step) * np.sqrt(np.maximum(diagonal, 0.0))
            settled = np.max(sds) < 1e-3 or abs(point.chi2 - tried.chi2) < 1e-9 * point.chi2
        if tried is not None and tried.chi2 < point.chi2:
            poles, point, damping = there, tried, LIGHTER * damping
        else:
            damping *= HEAVIER
        if settled or damping > MOST:
            break
    common, covariance = stack(poles), np.linalg.pinv(point.normal, hermitian=True)
    found = _finish(sets, data, variance, common[None], common, 0 * common, covariance)
    return found if data.step_s is None else _in_rad_s(data, found, data.step_s)


def _in_rad_s(data: Data, found: PoleFit, step_s: float) -> PoleFit:
    """Poles and their covariance carried from the z-plane to the s-plane."""
    slope = 1 / (found.poles * step_s)
    real, imag = np.diag(slope.real), np.diag(slope.imag)
    turn = np.block([[real, -imag], [imag, real]])
    covariance, poles = turn @ found.covariance @ turn.T, data.to_poles(found.poles)
    return replace(found, poles=poles, own=poles[None], covariance=covariance)


def shared_error(data: Data, fit: PoleFit) -> tuple[np.ndarray, np.ndarray]:
    """Covariance of poles (2m, 2m) and variance of residues that the force's noise adds.

    Of a fit by `refine` in the s-plane. The residues' variance (e, m) is that of real and imaginary
    part each.
    """
    m = fit.poles.size
    if data.force_share is None:
        return np.zeros((2 * m, 2 * m)), np.zeros((data.entries, m))
    errors = data.force_errors(data.values - fit.error)
    sets = WeightedSets(data.lines, data.values, fit.variance)
    point, p = reduced_together(sets, fit.poles), fit.coefficients.shape[1]
    inverse = (point.inverse[:, None] / sets.weight[..., None, None]).reshape(-1, p, p)
    sensitivity = point.sensitivity.reshape(-1, p, 2 * m)
    both = stack(np.concatenate([basis(data.lines, fit.poles), basis_slope(data.lines, fit.poles)]))
    cross = stack(errors * 2 / fit.variance) @ both.T
    turn = slope_turn(fit.coefficients, m)
    gradient = np.einsum("eka,nek->na", turn, cross[..., p:])
    gradient += np.einsum("eka,nek->na", sensitivity, cross[..., :p])
    change = gradient @ fit.covariance
    moved = np.einsum("ekl,nel->nek", inverse, cross[..., :p])
    moved += np.einsum("eka,na->nek", sensitivity, change)
    return change.T @ change, of_each(np.sum(moved**2, axis=0), m)


def of_each(square: np.ndarray, m: int) -> np.ndarray:
    """(…, m) variance of residues' real and imaginary part each, from all coefficients' (…, c)."""
    return (square[..., :m] + square[..., m : 2 * m]) / 2


def fit_sets(
    data: Data, variance: np.ndarray, start: np.ndarray, rounds: int = ROUNDS,
    known: np.ndarray | None = None, lines: np.ndarray | None = None,
) -> PoleFit:  # fmt: skip
    """Fit sets from common poles `start` (m,) in rad/s, with variance (e, F).

    `known` (k, m) are the sets' own poles to go on from; only some `lines` (indices) are fitted,
    where stated. Raises DivergedPolesError where the data do not hold the poles.
    """
    m, common = start.size, stack(start)
    own = np.tile(common, (len(data.sets), 1)) if known is None else stack(known)
    spread, covariance = np.zeros(2 * m), np.zeros((2 * m, 2 * m))
    chosen = slice(None) if lines is None else lines
    some = data.lines.part(chosen), data.values[:, chosen], variance[:, chosen]
    part = WeightedSets(*some, data.sets)
    for _ in range(rounds):
        point = reduced(part, complex_of(own))
        spread = _spread(point, own, common)
        moved, covariance = _common(point, own, spread)
        # Longest step of a common pole in one round: half a bandwidth
        longest = np.tile(1.0 * np.abs(common[:m]), 2)
        step = np.clip(moved - common, -longest, longest)
        common = common + step
        astray = [not data.allowed(pole[None]) for pole in complex_of(common)]
        if any(astray):
            raise DivergedPolesError(np.array(astray))
        before = own
        own = _own(point, own, common, spread)
        # Still: half bandwidths: sets' own poles that move less are at rest
        still = np.abs(own - before) < 0.01 * np.tile(np.abs(common[:m]), 2)
        # Settled: standard deviations of the common poles: a step below is the last
        if np.all(still) and np.all(np.abs(step) < 0.1 * np.sqrt(np.diag(covariance))):
            break
    return _finish(part, data, variance, own, common, spread, covariance)


def _spread(point: ReducedFit, own: np.ndarray, common: np.ndarray) -> np.ndarray:
    """(2m,) variance from set to set beyond what each set's noise explains."""
    if len(own) < 3:
        return np.zeros(common.size)
    far = farthest(common)
    # What a set does not tell is told so little that it counts for nothing.
    # Of the information of a pole known as roughly as it may stray
    inverse = np.linalg.inv(point.normal + np.diag(1e-6 / far**2))
    alone = own - np.einsum("kab,kb->ka", inverse, point.gradient)
    least = (1e-6 * far) ** 2  # finer than that no set's pole is known
    weight = 1 / np.maximum(np.einsum("kaa->ka", inverse), least)
    # A set in which the mode can hardly be seen says nothing.
    weight = np.where(1 / weight < far**2, weight, 0.0)
    total = np.sum(weight, axis=0)
    safe = np.maximum(total, 1e-300)
    mean = np.sum(weight * alone, axis=0) / safe
    off = np.clip(alone - mean, -far, far)
    freedom = np.sum(weight > 0, axis=0) - 1
    beyond = np.sum(weight * off**2, axis=0) - freedom
    scale = total - np.sum(weight * (weight / safe), axis=0)
    found = np.where((freedom > 1) & (scale > 0), beyond / np.maximum(scale, 1e-300), 0.0)
    return np.clip(found, 0.0, far**2)


def farthest(common: np.ndarray) -> np.ndarray:
    """(2m,) how far a set's pole may lie from the common one (rad/s), real parts first."""
    real, imag = np.split(common, 2)
    return np.concatenate([np.minimum(FARTHEST_DAMPING * np.abs(real), imag), FARTHEST * imag])


def _held(point: ReducedFit, spread: np.ndarray) -> np.ndarray:
    """(I + TN)⁻¹ (k, 2m, 2m) for the spread T and each set's curvature N."""
    one = np.eye(spread.size)
    return np.linalg.solve(
        one + spread[:, None] * point.normal, np.broadcast_to(one, point.normal.shape)
    )


def _common(
    point: ReducedFit, own: np.ndarray, spread: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What all sets have in common, and its covariance, the sets' own parts integrated out."""
    held = _held(point, spread)
    # N(I + TN)⁻¹ x − (I + NT)⁻¹ g
    weighed = point.normal @ held
    precision = np.sum(weighed, axis=0)
    right = np.einsum("kab,kb->a", weighed, own) - np.einsum("kba,kb->a", held, point.gradient)
    covariance = scaled_inverse(precision)
    return covariance @ right, covariance


def _own(point: ReducedFit, x: np.ndarray, common: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """The sets' most probable poles (k, 2m), shrunk towards the common ones."""
    pull = np.einsum("kab,kb->ka", point.normal, x - common) - point.gradient
    off = np.einsum("kab,kb->ka", _held(point, spread) * spread, pull)
    far = farthest(common)
    return common + np.clip(off, -far, far)


def _finish(
    sets: WeightedSets, data: Data, variance: np.ndarray, own: np.ndarray, common: np.ndarray,
    spread: np.ndarray, covariance: np.ndarray,
) -> PoleFit:  # fmt: skip
    """With sets' own parts (k, 2m), or (1, 2m) of all, in the plane of the lines."""
    poles, m = complex_of(own), common.size // 2
    point = reduced(sets, poles)
    coefficients = np.zeros((data.entries, point.coefficients.shape[-1]))
    error, every = data.values.copy(), np.broadcast_to(poles, (len(sets.entries), m))
    for chosen, found, pole in zip(sets.entries, point.coefficients, every, strict=True):
        there = chosen[chosen >= 0]
        coefficients[there] = found[: there.size]
        error[there] -= found[: there.size] @ basis(data.lines, pole)
    # Own poles are as sure as the set and the others make them: a set that tells its own poles
    # hardly depends on what is common.
    held = _held(point, spread)
    total = held * spread + held @ covariance @ held.transpose(0, 2, 1)
    change = point.sensitivity[:, :, : 2 * m]
    spent = np.sum((change @ total[:, None]) * change, axis=-1)
    alone = np.einsum("kcc->kc", point.inverse)[:, None, : 2 * m]
    # Of rounding, where lines without noise leave curvatures almost singular, variances below 0
    square = np.maximum(alone / np.maximum(sets.weight, 1e-300)[..., None] + spent, 0.0)
    residue_variance, there = np.zeros((data.entries, m)), sets.entries >= 0
    residue_variance[sets.entries[there]] = of_each(square, m)[there]
    # Student's t over the normal quantile for that part of the variance that comes from how sets
    # differ: so many alone tell it.
    known = np.einsum("kaa->ka", point.normal)
    weight = known / (1 + spread * known)
    whole = np.maximum(np.sum(weight, axis=0), 1e-300)
    freedom = np.maximum(whole**2 / np.maximum(np.sum(weight**2, axis=0), 1e-300) - 1, 2.0)
    noise = whole / np.maximum(np.sum(known, axis=0), 1e-300)
    factor = np.sqrt(noise + (1 - noise) * widening_factor(freedom) ** 2)
    return PoleFit(
        complex_of(common), poles, factor[:, None] * covariance * factor, spread, coefficients,
        residue_variance, error, variance, point.significance(sets.weight),
    )  # fmt: skip
