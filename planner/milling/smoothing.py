"""Measured receptances as few common modes: what noise adds from line to line is taken out.

Rotations are small differences of measured motions, so noise is what limits them most. All FRFs of
one structure share their poles: vector fitting finds where these are, maximum likelihood refines
them, and there are as many as the noise tells from nothing.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.milling.coupling import TipReceptance
from planner.milling.rank_one import rank_one
from planner.modal.rational_fit import rational_fit
from planner.modal.refine import Refined, refine
from planner.modal.residues import basis, laplace

PAIRS = (5, 8, 12)  # of conjugate poles from which the search begins
MOST = 24  # modes
NEIGHBOURS = 9  # lines over which a misfit is summed
TRIED_DAMPING = (0.01, 0.06)  # of a mode that is tried where the fit misses
FIRST_DAMPING = 0.01
# χ² per degree of freedom up to which a fit counts as one to the noise, and may be used.
FITS = 1.2
# Of χ²: where modes of one shape and one drive fit worse than this, residues are any.
PRODUCTS = 1.15
SWINGS = 0.3  # damping ratio from which a pole of the start stands for no mode
ABOVE = 1.5  # of the last line's frequency: where a mode above the lines is first looked for
LINES_PER_NUMBER = 3.0  # real values for each unknown number of an entry, at least
TERMS = 6  # of modes outside the lines, for each entry


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Receptances (F, n, n) of common poles (p,) in rad/s, and χ² per degree of freedom.

    `errors` (D, F, n, n) are independent of each other, of one sd each.
    """

    poles: np.ndarray
    receptance: np.ndarray
    errors: np.ndarray
    chi2: float

    @property
    def sd(self) -> np.ndarray:
        """(F, n, n): root of E|error|²."""
        return np.sqrt(np.sum(np.abs(self.errors) ** 2, axis=0))


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
    return replace(
        tip, measured=found.receptance, sd=found.sd, errors=found.errors, remarks=remarks
    )


def fit(frequency_hz: np.ndarray, values: np.ndarray, sd: np.ndarray) -> Smoothed | None:
    """The fit by the modes that the Bayesian information criterion likes best.

    values (F, n, n) at lines (F,) in Hz, sd of the same shape. None where there are too few lines.
    """
    square = (2 * np.pi * frequency_hz) ** 2
    receptance = np.moveaxis(values, 0, -1)
    problem = _SmoothingProblem(
        frequency_hz, -receptance * square, (np.moveaxis(sd, 0, -1) * square) ** 2
    )
    best: Refined | None = None
    for pairs in PAIRS:
        if 2 * len(values) < LINES_PER_NUMBER * (2 * pairs + TERMS):
            break
        even = 2 * np.pi * np.geomspace(frequency_hz[0], frequency_hz[-1], pairs + 2)[1:-1]
        start = rational_fit(frequency_hz, receptance, even * (-FIRST_DAMPING + 1j)).poles
        found = problem.pruned(problem.grown(problem.pruned(_swinging(start, frequency_hz[-1]))))
        if best is None or problem.criterion(found) < problem.criterion(best):
            best = found
    if best is None:
        return None
    fitted, errors = rank_one(frequency_hz, problem.accelerance, problem.variance, best)
    chi2 = problem.chi2(fitted, best)
    if chi2 > PRODUCTS * best.chi2 / max(best.degrees, 1):
        fitted, errors = rank_one(
            frequency_hz, problem.accelerance, problem.variance, best, products=False
        )
        chi2 = problem.chi2(fitted, best)
    moved = np.moveaxis(-fitted / square, -1, 0)
    return Smoothed(best.poles, moved, np.moveaxis(-errors / square, -1, 1), chi2)


def _swinging(poles: np.ndarray, highest_hz: float) -> np.ndarray:
    """Poles of a start that stand for modes, and one above the lines.

    That one stands for the nearest mode there: the few terms of the rest do not follow it.
    """
    swing = poles[-poles.real < SWINGS * np.abs(poles)]
    return np.append(swing, ABOVE * 2 * np.pi * highest_hz * (-FIRST_DAMPING + 1j))


@dataclass(frozen=True, eq=False)
class _SmoothingProblem:
    """Accelerance and its variance (n, n, F) at lines (F,) in Hz."""

    frequency_hz: np.ndarray
    accelerance: np.ndarray
    variance: np.ndarray

    def refined(self, poles: np.ndarray) -> Refined:
        lines = laplace(self.frequency_hz)
        return refine(lines, self.accelerance, self.variance, poles, _decaying)

    def chi2(self, fitted: np.ndarray, found: Refined) -> float:
        """Per degree of freedom of a fit."""
        off = np.abs(self.accelerance - fitted) ** 2
        return float(np.sum(2 * off / self.variance)) / max(found.degrees, 1)

    @property
    def each(self) -> float:
        """What a number costs in χ²."""
        return float(np.log(2 * self.accelerance.size))

    @property
    def entries(self) -> int:
        return self.accelerance[..., 0].size

    def worth(self, found: Refined) -> float:
        """χ² that a mode has to explain; more where the fit is off, for then anything explains."""
        return 2 * (self.entries + 1) * self.each * max(found.chi2 / max(found.degrees, 1), 1.0)

    def criterion(self, found: Refined) -> float:
        """The Bayesian information criterion, least for the best."""
        modes = len(found.poles)
        return found.chi2 + ((2 * modes + TERMS) * self.entries + 2 * modes) * self.each

    def pruned(self, start: np.ndarray | Refined) -> Refined:
        """Without the poles whose χ² is not worth their numbers, one after the other.

        Of two that stand for the same mode neither seems needed.
        """
        found = start if isinstance(start, Refined) else self.refined(start)
        while len(found.poles) > 1:
            if np.min(found.significance) > self.worth(found):
                break
            found = self.refined(np.delete(found.poles, np.argmin(found.significance)))
        return found

    def grown(self, found: Refined) -> Refined:
        """With further poles where the fit misses most, as long as they are worth it."""
        while len(found.poles) < MOST:
            columns = basis(laplace(self.frequency_hz), found.poles)
            fitted = np.reshape(found.point.coefficients @ columns, self.variance.shape)
            off = np.sum(np.abs(self.accelerance - fitted) ** 2 / self.variance, axis=(0, 1))
            off = np.convolve(off, np.ones(NEIGHBOURS), mode="same")
            place = 2 * np.pi * self.frequency_hz[np.argmax(off)]
            trials = [self.refined(np.append(found.poles, place * (1j - d))) for d in TRIED_DAMPING]
            best = min(trials, key=self.criterion)
            if found.chi2 - best.chi2 < self.worth(best):
                break
            found = best
        return found


def _decaying(poles: np.ndarray) -> bool:
    return bool(np.all(poles.real < 0) and np.all(poles.imag > 0))
