"""Probabilities of candidates that stay honest where none of them is quite right."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.thresholds import (
    ALIKE,
    NOISE_OVERSTATED,
    SLIGHT_GAIN,
    TOLERATED,
    UNKNOWN_PARAMETERS,
)
from planner.inference.evidence import bootstrapped, shared_noise, temper

REACH = 40.0  # tempered log evidence behind the best, within which a candidate is followed
BOOTSTRAPS = 400


def temper_of(fits: Sequence[Fit]) -> float:
    """T for fits on the same lines, from the best of them."""
    measured = fits[0].misfit.measured
    spacing = float(np.median(np.diff(measured.frequency_hz, axis=1)))
    shared = shared_noise(spacing, float(np.median(measured.s.real[:, 0])))
    misfit = min(f.per_value for f in fits)
    return temper(misfit, ALIKE, shared=shared, least=NOISE_OVERSTATED)


@dataclass(frozen=True, eq=False)
class Weights:
    """Probabilities of the fits, in their order, then of "unknown"; T; log evidence of the fits."""

    probabilities: np.ndarray
    temper: float
    log_evidence: np.ndarray


def weigh(fits: Sequence[Fit], prior: Sequence[float], seed: int = 0) -> Weights:
    """Tempered evidence, averaged over which poses might have been taken; the first fit is "none".

    `prior` are the weights of the fits before any data, in their order.
    """
    t = temper_of(fits)
    own = np.array([f.data.chi2 for f in fits])
    chi2 = _without_slight(fits, own)
    slight = (chi2 - own).sum(axis=1) / (2 * t)
    evidence = np.array([f.log_evidence(t) for f in fits]) - slight + np.log(prior)
    count = float(fits[0].misfit.counts.sum())
    charge = UNKNOWN_PARAMETERS / 2 * np.log(max(count / t, 2.0))
    # Springs that a fit has bent to imitate what is not known cost that fit, not the unknown.
    unknown = -TOLERATED * count / (2 * t) - charge + max(_volume(f, t) for f in fits)
    shares = bootstrapped(chi2, evidence, t, unknown, BOOTSTRAPS, seed)
    return Weights(shares, t, evidence)


def _without_slight(fits: Sequence[Fit], chi2: np.ndarray) -> np.ndarray:
    """χ² (fits, poses), those of the first fit where an effect hardly changes FRFs.

    A simulation is never right to a tenth of the noise, and a spring that differs by 1 % at two
    poses takes some of that. What widens priors alone gains nothing here and loses nothing.
    """
    out = chi2.copy()
    for i, f in enumerate(fits):
        gain = 1 - chi2[i].sum() / chi2[0].sum()
        if gain > 0 and any(part.quantities for part in f.effect.parts()):
            out[i] += min(1.0, max(2 * SLIGHT_GAIN / gain - 1, 0.0)) * (chi2[0] - chi2[i])
    return out


def _volume(fit: Fit, t: float) -> float:
    """Log evidence of a fit without its χ²: what springs and nuisances cost any candidate."""
    return fit.log_evidence(t) + float(fit.data.chi2.sum()) / (2 * t)


def lag(fits: Sequence[Fit]) -> np.ndarray:
    """By how much the tempered log evidence of fits on the same lines is behind the best's."""
    t = temper_of(fits)
    evidence = np.array([f.log_evidence(t) for f in fits])
    return evidence.max() - evidence


def best_of(fits: Sequence[Fit], most: int) -> list[Fit]:
    """The best of fits on the same lines."""
    return [fits[i] for i in np.argsort(lag(fits))[:most]] if fits else []


def cut(fits: Sequence[Fit], most: int) -> tuple[list[Fit], list[tuple[Effect, float, Fit]]]:
    """The first, and up to `most` in all; those that are left, by how far they are behind."""
    behind = lag(fits)
    order = [0, *(int(i) for i in np.argsort(behind) if i)]
    kept = {i for place, i in enumerate(order) if i == 0 or (place < most and behind[i] < REACH)}
    left = [(fits[i].effect, float(behind[i]), fits[i]) for i in order if i not in kept]
    return [fits[i] for i in order if i in kept], left
