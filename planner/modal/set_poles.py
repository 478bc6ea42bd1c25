"""Poles of FRFs that were measured in several sets: common to all, and each set's own.

Between one set and the next a structure changes a little: a sensor that moves loads it elsewhere,
it warms up, a clamp settles, hits are harder. One pole for all then misfits, and two poles are
found where there is one mode. Here every set k has poles of its own, x_k = x + d_k, d_k normal
with a variance that the sets tell (DerSimonian and Laird 1986); x is what is common. Where sets
agree, the variance is zero and all share one pole.
"""

from dataclasses import dataclass

import numpy as np

from planner.modal.fit_data import Data
from planner.modal.refine import ReducedFit, evaluate, significance
from planner.modal.residues import Lines, Residues, synthesize, unpack

ROUNDS = 4  # each a Gauss-Newton step of every set and of what is common
FARTHEST = 1.0  # bandwidths, or twice the share of its frequency: farther no set strays
FREQUENCY_SHARE = 0.01
SETTLED = 0.1  # standard deviations of the common poles: a step below is the last
STILL = 0.01  # half bandwidths: sets' own poles that move less are at rest
LONGEST_STEP = 1.0  # of half a bandwidth, of a common pole in one round


class StrayedError(ValueError):
    """Poles left the band, or their damping the possible: the data do not hold them.

    `astray` (m,) bool says which.
    """

    def __init__(self, astray: np.ndarray) -> None:
        super().__init__("poles strayed")
        self.astray = astray


@dataclass(frozen=True, eq=False)
class SetPoles:
    """Common poles (m,) in rad/s and those of every set (k, m), with residues of all entries.

    `covariance` (2m, 2m) of the common poles' real, then imaginary parts; `spread` (2m,) their
    variance from set to set. `residue` and `residue_variance` (e, m), the variance of real and
    imaginary part each; `fitted` (e, F). `significance` (m,): rise of χ² without the mode.
    """

    poles: np.ndarray
    own: np.ndarray
    covariance: np.ndarray
    spread: np.ndarray
    residue: np.ndarray
    residue_variance: np.ndarray
    fitted: np.ndarray
    significance: np.ndarray


def fit_sets(
    data: Data, sets: tuple[np.ndarray, ...], variance: np.ndarray, start: np.ndarray,
    rounds: int = ROUNDS, known: np.ndarray | None = None, lines: np.ndarray | None = None,
) -> SetPoles:  # fmt: skip
    """Fit from common poles `start` (m,) in rad/s.

    `sets` are the entries (indices) of each set; data.response (e, 1, F), variance (e, F). `known`
    (k, m) are the sets' own poles to go on from; poles are fitted to some of the `lines`
    (indices), where stated. Raises StrayedError where the data do not hold the poles.
    """
    m, every = start.size, np.arange(data.frequency_hz.size)
    common = np.concatenate([start.real, start.imag])
    own = np.tile(common, (len(sets), 1))
    if known is not None:
        own = np.concatenate([known.real, known.imag], axis=1)
    spread, covariance = np.zeros(2 * m), np.zeros((2 * m, 2 * m))
    chosen = every if lines is None else lines
    response, weight = data.response[:, 0, chosen], 2 / variance[:, chosen]
    part = data.lines.part(chosen)
    for _ in range(rounds):
        points = [
            evaluate(part, response[k], weight[k], _complex(x))
            for k, x in zip(sets, own, strict=True)
        ]
        spread = _spread(points, own, common)
        moved, covariance = _common(points, own, spread)
        longest = np.tile(LONGEST_STEP * np.abs(common[:m]), 2)
        step = np.clip(moved - common, -longest, longest)
        common = common + step
        astray = [not data.allowed(pole[None]) for pole in _complex(common)]
        if any(astray):
            raise StrayedError(np.array(astray))
        before = own
        own = np.array([_own(p, x, common, spread) for p, x in zip(points, own, strict=True)])
        still = np.abs(own - before) < STILL * np.tile(np.abs(common[:m]), 2)
        if np.all(still) and np.all(np.abs(step) < SETTLED * np.sqrt(np.diag(covariance))):
            break
    return _finish(data, sets, variance, own, common, spread, covariance)


def _complex(parts: np.ndarray) -> np.ndarray:
    real, imag = np.split(parts, 2)
    return real + 1j * imag


def _spread(points: list[ReducedFit], own: np.ndarray, common: np.ndarray) -> np.ndarray:
    """(2m,) variance from set to set beyond what each set's noise explains."""
    if len(points) < 3:
        return np.zeros(common.size)
    inverse = [np.linalg.pinv(p.normal, hermitian=True) for p in points]
    alone = np.array([x - i @ p.gradient for x, i, p in zip(own, inverse, points, strict=True)])
    m = common.size // 2
    far = _farthest(common)
    least = (1e-6 * np.tile(far, 2)) ** 2  # finer than that no set's pole is known
    weight = 1 / np.maximum([np.diag(i) for i in inverse], least)
    # A set in which the mode can hardly be seen says nothing.
    weight = np.where(1 / weight < np.tile(far, 2) ** 2, weight, 0.0)
    total = np.sum(weight, axis=0)
    safe = np.maximum(total, 1e-300)
    mean = np.sum(weight * alone, axis=0) / safe
    off = np.clip(alone - mean, -np.tile(far, 2), np.tile(far, 2))
    freedom = np.sum(weight > 0, axis=0) - 1
    beyond = np.sum(weight * off**2, axis=0) - freedom
    scale = total - np.sum(weight * (weight / safe), axis=0)
    found = np.where((freedom > 1) & (scale > 0), beyond / np.maximum(scale, 1e-300), 0.0)
    return np.clip(found, 0.0, np.tile(far, 2) ** 2) if m else found


def _farthest(common: np.ndarray) -> np.ndarray:
    """(m,) how far a set's pole may lie from the common one (rad/s)."""
    real, imag = np.split(common, 2)
    return FARTHEST * np.minimum(np.abs(real) * 2, 2 * FREQUENCY_SHARE * imag)


def _common(
    points: list[ReducedFit], own: np.ndarray, spread: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What all sets have in common, and its covariance, the sets' own parts integrated out."""
    size = own.shape[1]
    precision, right = np.zeros((size, size)), np.zeros(size)
    for point, x in zip(points, own, strict=True):
        # N(I + TN)⁻¹ x − (I + NT)⁻¹ g
        held = np.linalg.solve(np.eye(size) + spread[:, None] * point.normal, np.eye(size))
        weighed = point.normal @ held
        precision += weighed
        right += weighed @ x - held.T @ point.gradient
    scale = np.sqrt(np.maximum(np.diag(precision), 1e-300))
    covariance = np.linalg.pinv(precision / scale[:, None] / scale, hermitian=True)
    covariance = covariance / scale[:, None] / scale
    return covariance @ right, covariance


def _own(point: ReducedFit, x: np.ndarray, common: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """The set's most probable poles, shrunk towards the common ones."""
    size = x.size
    held = np.linalg.solve(np.eye(size) + spread[:, None] * point.normal, np.diag(spread))
    off = held @ (point.normal @ (x - common) - point.gradient)
    far = np.tile(_farthest(common), 2)
    return common + np.clip(off, -far, far)


def _finish(
    data: Data, sets: tuple[np.ndarray, ...], variance: np.ndarray, own: np.ndarray,
    common: np.ndarray, spread: np.ndarray, covariance: np.ndarray,
) -> SetPoles:  # fmt: skip
    response, m = data.response[:, 0], common.size // 2
    residue = np.zeros((response.shape[0], m), complex)
    residue_variance = np.zeros(residue.shape)
    fitted = np.zeros(response.shape, complex)
    found_by = np.zeros(m)
    for k, x in zip(sets, own, strict=True):
        point = evaluate(data.lines, response[k], 2 / variance[k], _complex(x))
        found = unpack(point.coefficients[:, None], m)
        residue[k] = found.residue[:, 0]
        fitted[k] = _synthesized(data.lines, _complex(x), found)
        # Own poles are as sure as the set and the others make them.
        held = np.linalg.solve(np.eye(2 * m) + spread[:, None] * point.normal, np.diag(spread))
        total = held + covariance
        spent = np.einsum("eka,ab,ekb->ek", point.sensitivity, total, point.sensitivity)
        parts = (np.einsum("ekk->ek", point.inverse) + spent)[:, : 2 * m]
        residue_variance[k] = (parts[:, :m] + parts[:, m:]) / 2
        found_by += significance(point, m)
    return SetPoles(
        _complex(common), np.array([_complex(x) for x in own]), covariance, spread,
        residue, residue_variance, fitted, found_by,
    )  # fmt: skip


def _synthesized(lines: Lines, poles: np.ndarray, found: Residues) -> np.ndarray:
    return synthesize(lines, poles, found)[:, 0]
