"""Probabilities of candidates that stay honest where none of them is quite right."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import expit
from scipy.stats import norm

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.discrepancy import Worth, size_priors
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.linear.followed import followed, left_of, unfollowed, worths
from planner.diagnosis.linear.mismatch import Mismatch
from planner.diagnosis.linear.stated_values import pulled
from planner.diagnosis.thresholds import (
    ALIKE,
    DISCREPANCIES,
    DISCREPANCY_USUAL,
    LEFT_FACTOR,
    LEFT_SHARE,
    NOISE_OVERSTATED,
    SOMETHING_UNKNOWN,
)
from planner.inference.evidence import bootstrapped, shared_noise, temper
from planner.inference.log_space import log_sum

REACH = 40.0  # tempered log evidence behind the best, within which a candidate is followed
BOOTSTRAPS = 400
HARDLY = 5000.0  # the same before a fit is followed, beyond which it cannot come close
CLOSE = 500.0  # log evidence behind the best within which all sizes are looked at
USUAL = DISCREPANCIES.index(DISCREPANCY_USUAL)  # what every robot has may move as much
LOG_KNOWN = float(np.log(1 / SOMETHING_UNKNOWN - 1))  # odds, before any data, of nothing unknown


def temper_of(fits: Sequence[Fit]) -> float:
    """T for fits on the same lines, from the best of them."""
    shared = _shared(fits[0])
    misfit = min(f.per_value for f in fits)
    return temper(misfit, ALIKE, shared=shared, least=NOISE_OVERSTATED)


def _shared(fit: Fit) -> float:
    """How many neighbouring lines share their noise, see `shared_noise`."""
    measured = fit.misfit.measured
    spacing = float(np.median(np.diff(measured.frequency_hz, axis=1)))
    return shared_noise(spacing, float(np.median(measured.s.real[:, 0])))


@dataclass(frozen=True, eq=False)
class Weights:
    """Probabilities of fits in their order, then of "unknown"; T; what each is worth and leaves.

    `bent` (k,) are how far each had to move what is stated, see `pulled`. `log_evidence` is that of
    all of them together, priors and "unknown" included.
    """

    probabilities: np.ndarray
    log_evidence: float
    temper: float
    worth: tuple[Worth, ...]
    mismatch: tuple[Mismatch, ...]
    bent: np.ndarray

    @property
    def likeliest(self) -> int:
        """Number of the fit with the most evidence."""
        return int(np.argmax([w.log_evidence for w in self.worth]))


def weigh(fits: Sequence[Fit], prior: Sequence[float], seed: int = 0) -> Weights:
    """Evidence with the discrepancy inferred anew for each, averaged over which poses there are.

    The first fit is "none"; `prior` are the weights of the fits before any data.
    """
    springs = stated_springs(fits[0])
    first = np.array([evidence for _, evidence in unfollowed(fits, springs)])
    there = followed(fits, springs, first > first.max() - HARDLY)
    rough = np.array([evidence for _, evidence in there])
    close = rough > rough.max() - CLOSE
    close[0] = True
    per_value = left_of(there[int(np.argmax(rough))], springs)
    t = max(per_value, NOISE_OVERSTATED) * _shared(fits[0])
    worth = tuple(worths(there, springs, close, t))
    mismatch = tuple(Mismatch.of(f.misfit, f.x) for f in fits)
    left = np.array([m.unexplained for m in mismatch])
    seen = np.array([m.resolution for m in mismatch])
    matters = fits[0].misfit.setting.simulation.robot.config.diagnose.matters
    bent = np.array([_bent(f, w, fits[0]) for f, w in zip(fits, worth, strict=True)])
    least = float(seen.min())
    shares = shares_of(worth, left, prior, matters, least, seed, bent)
    joint = _log_joint(worth, np.maximum(left, least), prior, matters, least, bent)
    total = float(log_sum(joint.ravel(), axis=0))
    return Weights(shares, total, t, worth, mismatch, bent[:, USUAL])


def _bent(fit: Fit, worth: Worth, plain: Fit) -> np.ndarray:
    """See `pulled`, at each size (sizes,) of the discrepancy.

    Where a step goes too far for what is linear, where the fit is counts.
    """
    here = pulled(fit, fit.x, plain)
    return np.array([min(here, pulled(fit, x, plain)) for x in worth.ends])


def shares_of(
    worth: Sequence[Worth],
    left: np.ndarray,
    prior: Sequence[float],
    matters: float,
    seen: float,
    seed: int = 0,
    bent: np.ndarray | float = 0.0,
) -> np.ndarray:
    """Probabilities (k + 1,) of k fits, each of them all there is, and of "unknown".

    "Unknown" is an effect of no library, alone (with the first fit, which has no effect) or in
    addition to another fit's effects. Three things speak for it: a large discrepancy, a large
    misfit `left` (k,), relative to the recordings and not below `seen`, which noise hides, and
    stated values that had to move far (`bent` (k, sizes), see `pulled`). Where refitting leaves
    less than `matters` and moves stated values little, its share goes to the first fit.
    """
    left = np.maximum(left, seen)
    both = _log_joint(worth, left, prior, matters, seen, bent)
    # Sizes are told apart in each resample anew: poses differ in which of them they tell.
    scores = np.tile(np.concatenate([w.scores for w in worth]), (2, 1))
    found = bootstrapped(scores, both.ravel(), 1.0, -np.inf, BOOTSTRAPS, seed)[:-1]
    alone, beside = found.reshape(both.shape).sum(axis=2)
    unmoved = expit(LOG_KNOWN - np.broadcast_to(bent, both.shape[1:])[0, USUAL])
    counts = 1 - unmoved * norm.cdf(np.log(matters / left[0]) / np.log(LEFT_FACTOR))
    alone[0] += (1 - counts) * beside.sum()
    return np.append(alone, counts * beside.sum())


def _log_joint(
    worth: Sequence[Worth],
    left: np.ndarray,
    prior: Sequence[float],
    matters: float,
    seen: float,
    bent: np.ndarray | float,
) -> np.ndarray:
    """ln of prior times evidence (2, k, sizes): of fits alone, and beside something unknown."""
    usual, unusual = size_priors()
    each = np.array([w.by_size for w in worth]) + np.log(prior)[:, None]
    known = each + usual + left_alone(left, matters, seen)[:, None]
    strange = each + unusual + bent - LOG_KNOWN
    return np.array([known, strange])


def stated_springs(none: Fit) -> tuple[str, ...]:
    """Names of the springs and dampers that robot.toml states."""
    return tuple(p.name for p in none.misfit.parametrisation.parameters if p.stated)


def left_alone(left: np.ndarray, matters: float, seen: float) -> np.ndarray:
    """Log likelihoods of so much (k,) being left, relative, where nothing unknown is there.

    The first is what refitting leaves: that may be what does not matter. What explains takes most
    of it, as far as noise lets that be `seen`.
    """
    least = np.full(len(left), max(seen, LEFT_SHARE * left[0]))
    least[0] = matters
    return -(np.log(np.maximum(left, least) / least) ** 2) / (2 * np.log(LEFT_FACTOR) ** 2)


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
