"""Poles of FRFs that were measured in several sets: common to all, and each set's own.

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
    of_each,
    reduced,
    scaled_inverse,
    slope_turn,
)
from planner.modal.residues import Lines, basis, complex_of, unpack

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
class SetData:
    """What is fitted, responses (e, 1, F), and the entries (indices) of each set.

    `rows` and `columns` (e,) of each entry, columns being those of the few references.
    """

    data: Data
    sets: tuple[np.ndarray, ...]
    rows: np.ndarray
    columns: np.ndarray

    def table(self, values: np.ndarray) -> np.ndarray:
        """(r, c, …) of values (e, …), 0 where nothing was measured."""
        out = np.zeros((self.rows.max() + 1, self.columns.max() + 1, *values.shape[1:]), complex)
        out[self.rows, self.columns] = values
        return out


@dataclass(frozen=True, eq=False)
class SetPoles:
    """Common poles (m,) in rad/s and those of every set (k, m), with residues of all entries.

    `covariance` (2m, 2m) of the common poles' real, then imaginary parts, for intervals of 95 %;
    `spread` (2m,) their variance from set to set. `residue` and `residue_variance` (e, m), the
    variance of real and imaginary part each; `fitted` (e, F). `significance` (m,): rise of χ²
    without the mode.
    """

    poles: np.ndarray
    own: np.ndarray
    covariance: np.ndarray
    spread: np.ndarray
    residue: np.ndarray
    residue_variance: np.ndarray
    fitted: np.ndarray
    significance: np.ndarray

    def part(self, kept: np.ndarray) -> "SetPoles":
        """Some of the modes (bool); what was fitted stays."""
        both = np.tile(kept, 2)
        return replace(
            self, poles=self.poles[kept], own=self.own[:, kept], spread=self.spread[both],
            covariance=self.covariance[np.ix_(both, both)], residue=self.residue[:, kept],
            residue_variance=self.residue_variance[:, kept], significance=self.significance[kept],
        )  # fmt: skip


def fit_sets(
    given: SetData, variance: np.ndarray, start: np.ndarray, rounds: int = ROUNDS,
    known: np.ndarray | None = None, lines: np.ndarray | None = None,
) -> SetPoles:  # fmt: skip
    """Fit from common poles `start` (m,) in rad/s, with variance (e, F).

    `known` (k, m) are the sets' own poles to go on from; only some `lines` (indices) are fitted,
    where stated. Raises DivergedPolesError where the data do not hold the poles.
    """
    m, data, sets = start.size, given.data, given.sets
    common = np.concatenate([start.real, start.imag])
    own = np.tile(common, (len(sets), 1))
    if known is not None:
        own = np.concatenate([known.real, known.imag], axis=1)
    spread, covariance = np.zeros(2 * m), np.zeros((2 * m, 2 * m))
    response = data.response[:, 0]
    chosen = slice(None) if lines is None else lines
    part = WeightedSets.of(data.lines.part(chosen), response[:, chosen], variance[:, chosen], sets)
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
    return _finish(part, data.lines, own, common, spread, covariance)


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


def _student(point: ReducedFit, spread: np.ndarray) -> np.ndarray:
    """(2m,) factors of sds, since so many sets alone tell how much sets differ.

    Student's t over the normal quantile, for that part of the variance which comes from it.
    """
    known = np.einsum("kaa->ka", point.normal)
    weight = known / (1 + spread * known)
    total = np.maximum(np.sum(weight, axis=0), 1e-300)
    freedom = np.maximum(total**2 / np.maximum(np.sum(weight**2, axis=0), 1e-300) - 1, 2.0)
    noise = total / np.maximum(np.sum(known, axis=0), 1e-300)
    return np.sqrt(noise + (1 - noise) * widening_factor(freedom) ** 2)


def _own(point: ReducedFit, x: np.ndarray, common: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """The sets' most probable poles (k, 2m), shrunk towards the common ones."""
    pull = np.einsum("kab,kb->ka", point.normal, x - common) - point.gradient
    off = np.einsum("kab,kb->ka", _held(point, spread) * spread, pull)
    far = farthest(common)
    return common + np.clip(off, -far, far)


def _finish(
    data: WeightedSets, lines: Lines, own: np.ndarray, common: np.ndarray,
    spread: np.ndarray, covariance: np.ndarray,
) -> SetPoles:  # fmt: skip
    poles, m, count = complex_of(own), common.size // 2, int(np.max(data.entries)) + 1
    point = reduced(data, poles)
    residue, response = np.zeros((count, m), complex), np.zeros((count, lines.x.size), complex)
    for chosen, coefficients, pole in zip(data.entries, point.coefficients, poles, strict=True):
        measured = chosen >= 0
        residue[chosen[measured]] = unpack(coefficients[measured], m)[0]
        response[chosen[measured]] = coefficients[measured] @ basis(lines, pole)
    # Own poles are as sure as the set and the others make them: a set that tells its own poles
    # hardly depends on what is common.
    held = _held(point, spread)
    total = held * spread + held @ covariance @ held.transpose(0, 2, 1)
    change = point.turned[:, None, : 2 * m] @ slope_turn(point.coefficients, m)
    spent = np.sum((change @ total[:, None]) * change, axis=-1)
    alone = np.einsum("kcc->kc", point.inverse)[:, None, : 2 * m]
    parts = alone / np.maximum(data.weight, 1e-300)[..., None] + spent
    there = data.entries >= 0
    residue_variance = np.zeros(residue.shape)
    residue_variance[data.entries[there]] = of_each(parts, m)[there]
    factor = _student(point, spread)
    return SetPoles(
        complex_of(common), poles, factor[:, None] * covariance * factor, spread, residue,
        residue_variance, response, point.significance(data.weight),
    )  # fmt: skip
