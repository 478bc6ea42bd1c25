"""Which hit best discriminates between candidate explanations that the recordings leave tied.

T-optimal design (Atkinson & Fedorov 1975): for each pair of candidates, the χ² misfit that remains
when one is refitted to the FRFs that the other predicts, its present posterior being the prior.
(Hunter & Reiner 1965 compare without refitting, which counts differences that refitting removes.)
For all poses the refit is one linear step in closed form. Parameters such as the place of a mass
can move farther than that, so at the most promising hits every candidate is truly refitted to the
FRF that every other one predicts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations

import numpy as np

from planner.design.frequency_posterior import AXES
from planner.design.parameter_sensitivity import FrfNoise
from planner.diagnosis.linear.fit import Fit, carried_on
from planner.diagnosis.linear.predict import misfit_at
from planner.diagnosis.linear.problem import FINE, Problem, tolerances_of
from planner.frf.frf import Frf
from planner.inference.block_diagonal import block_diagonal
from planner.inference.parallel import side_by_side
from planner.measurement.nuisances import OpenNumbers, basis
from planner.recording.points import TOOL, Layout

FRF_LINES = 96  # lines over the band at which FRFs are compared, evenly spaced
TRIED_POSES = 8  # poses at which candidates are fitted, the most promising in closed form
MOST_CANDIDATES = 4  # candidates compared: the likeliest
REFIT_STEPS = 20  # least-squares steps of each refit


@dataclass(frozen=True)
class DiscriminatingHit:
    """A hit at the pose with this number along tcp axis 0, 1 or 2 (x, y, z).

    `log_odds` is the natural logarithm of the odds it is expected to give.
    """

    pose: int
    axis: int
    log_odds: float


def best_hit(
    problem: Problem,
    fits: Sequence[Fit],
    probability: Sequence[float],
    q: np.ndarray,
    temper: float,
) -> DiscriminatingHit:
    """The hit that best separates two or more fits, at one of q (n, dof) in rad.

    `probability` of each fit; χ² counts 1/`temper`. Only the MOST_CANDIDATES are looked at.
    """
    likeliest = np.argsort(-np.asarray(probability))[:MOST_CANDIDATES].tolist()
    fits, probability = [fits[i] for i in likeliest], [probability[i] for i in likeliest]
    gain = np.nan_to_num(separation(problem, fits, probability, q, temper))
    share = np.array(probability) / np.sum(probability)
    axes = np.argmax(gain, axis=1)
    promising = np.argsort(-np.max(gain, axis=1))[:TRIED_POSES].tolist()
    settled = side_by_side(partial(_to_the_end, problem), fits)
    hits = [(pose, int(axes[pose])) for pose in promising]
    odds = side_by_side(partial(_tried, problem, settled, share, q, temper), hits)
    return max(map(DiscriminatingHit, *zip(*hits, strict=True), odds), key=lambda t: t.log_odds)


def _to_the_end(problem: Problem, fit: Fit) -> Fit:
    return carried_on(problem, fit, fit.effect)


def _tried(
    problem: Problem,
    fits: Sequence[Fit],
    share: np.ndarray,
    q: np.ndarray,
    temper: float,
    hit: tuple[int, int],
) -> float:
    pose, axis = hit
    return odds_after(problem, fits, share, q[pose], axis, temper)


def odds_after(
    problem: Problem,
    fits: Sequence[Fit],
    share: np.ndarray,
    q: np.ndarray,
    axis: int,
    temper: float,
) -> float:
    """Logarithm of the odds that a hit at q (dof,) gives, all fitted to what each predicts.

    `fits` are settled on the problem's recordings; `share` (fits,) sums to 1.
    """
    before = np.array([f.log_evidence(temper) for f in fits])
    out = 0.0
    for true, source in enumerate(fits):
        frfs = (*problem.frfs, _predicted_column(problem, source, q, axis))
        more = replace(problem, frfs=frfs, q=np.vstack([problem.q, q]))
        refitted = [carried_on(more, f, f.effect, REFIT_STEPS) for f in fits]
        after = np.array([f.log_evidence(temper) for f in refitted])
        gained = after - before
        for other in range(len(fits)):
            if other != true:
                weight = share[true] * share[other] / (1 - share[true])
                out += float(weight * (gained[true] - gained[other]))
    return out


def _predicted_column(problem: Problem, source: Fit, q: np.ndarray, axis: int) -> Frf:
    """The FRF column that a fit predicts at q (dof,), with the noise of those measured."""
    like, noise = problem.frfs[0], FrfNoise.of(problem.frfs, problem.band_hz, 1.0)
    rate = like.exponential_rate_1_s
    there = misfit_at(problem, source.effect, q[None], like.frequency_hz, rate)
    h = there.response(source.x)[0][0]
    # The model's own error is no part of an FRF's variance; fits add it.
    floor = _sd(noise, h) if noise.floor is None else np.full(h.shape, noise.floor)
    unknown = np.full(h.shape, np.nan)
    seen, variance = unknown.astype(complex), unknown.copy()
    seen[:, axis], variance[:, axis] = h[:, axis], floor[:, axis] ** 2
    hits = int(axis == 0), int(axis == 1), int(axis == 2)
    return Frf(like.frequency_hz, seen, variance, unknown, hits, like.usable_band_hz, rate)


def separation(
    problem: Problem,
    fits: Sequence[Fit],
    probability: Sequence[float],
    q: np.ndarray,
    temper: float,
    layout: Layout = TOOL,
) -> np.ndarray:
    """Expected logarithm of the odds (n, 3) that a hit along each tcp axis gives at q (n, dof).

    q in rad; the sensors of `layout` listen. The odds are those of the true fit to each other one,
    averaged with the probabilities of the fits; 0 where there are fewer than two.
    """
    q = np.atleast_2d(q)
    gain = np.zeros((len(q), AXES))
    if len(fits) < 2:
        return gain
    share = np.array(probability) / np.sum(probability)
    noise = FrfNoise.of(problem.frfs, problem.band_hz, temper)
    lines = np.linspace(*problem.band_hz, FRF_LINES)
    # As many count as fits look at: what does not matter errs at each of them.
    each = min((lines[-1] - lines[0]) / noise.step_hz, FINE.lines) / FRF_LINES
    numbers = OpenNumbers.of(np.empty((*layout.shape, 0)))
    open_ = 0 if problem.exact else numbers.known + problem.q.shape[1]
    known = [block_diagonal(fit.precision(temper), np.eye(open_)) for fit in fits]
    rate = problem.frfs[0].exponential_rate_1_s
    for place, row in enumerate(q):
        predicted = [_predicted(problem, f, row, lines, rate, layout) for f in fits]
        scales = [
            np.sqrt(2 * each / noise.misfit) / np.hypot(_sd(noise, h), _unmodelled(problem, h))
            for h, _ in predicted
        ]
        gain[place] = expected_log_odds(predicted, scales, known, share)
    return gain


def _predicted(
    problem: Problem,
    found: Fit,
    q: np.ndarray,
    lines: np.ndarray,
    rate_1_s: float,
    layout: Layout,
) -> tuple[np.ndarray, np.ndarray]:
    """FRF (r, 3, F) of a fit at q (dof,), and its derivatives (D, r, 3, F).

    By what hit and measuring chain leave open, too, in sds: a hit is never told as well as its
    noise allows.
    """
    misfit = misfit_at(problem, found.effect, q[None], lines, rate_1_s, layout)
    h, slope, turned = misfit.parts(found.x)
    if problem.exact:
        return h[0], slope[0]
    left_open = basis(h, turned, misfit.setting.s, tolerances_of(problem.simulation))
    return h[0], np.concatenate([slope[0], left_open[0]])


def expected_log_odds(
    predicted: Sequence[tuple[np.ndarray, np.ndarray]],
    scales: Sequence[np.ndarray],
    known: Sequence[np.ndarray],
    share: np.ndarray,
) -> np.ndarray:
    """Of the true candidate to each other one (3,), for a hit along each axis.

    Args:
        predicted: of each candidate the FRF (3, 3, F) and its derivatives (D, 3, 3, F).
        scales: of each candidate the weight (3, 3, F) of a deviation from its FRF: √2 over its sd.
        known: of each candidate the precision (D, D) of its parameters.
        share: probability (candidates,), of sum 1.
    """
    gain = np.zeros(AXES)
    for true, other in permutations(range(len(predicted)), 2):
        weight = share[true] * share[other] / (1 - share[true])
        missed = scales[true] * (predicted[true][0] - predicted[other][0])
        moved = scales[true] * predicted[other][1]
        for axis in range(AXES):
            left = _left(missed[:, axis], moved[:, :, axis], known[other])
            gain[axis] += weight * left / 2
    return gain


def _sd(noise: FrfNoise, h: np.ndarray) -> np.ndarray:
    """Root of E|δH|² of an FRF h (3, 3, F)."""
    floor = noise.floor
    if floor is None:
        floor = noise.relative * np.sqrt(np.mean(np.abs(h) ** 2))
    return np.hypot(noise.relative * np.abs(h), floor)


def _unmodelled(problem: Problem, h: np.ndarray) -> np.ndarray:
    """Sd of what a fit to an FRF h (r, 3, F) need not follow, as in `stack`."""
    error, spread = problem.error(FINE)
    return error * np.hypot(np.abs(h), spread * np.sqrt(np.mean(np.abs(h) ** 2, axis=(0, 1))))


def _left(missed: np.ndarray, slope: np.ndarray, precision: np.ndarray) -> float:
    """χ² of `missed` (3, F) that moving along `slope` (D, 3, F) leaves; prior `precision`."""
    r = np.ascontiguousarray(missed).reshape(-1).view(float)
    j = np.ascontiguousarray(slope).reshape(len(slope), -1).view(float)
    pull = j @ r
    return float(r @ r - pull @ np.linalg.solve(precision + j @ j.T, pull))
