"""Which hit best discriminates between explanations that the recordings leave tied.

T-optimal design (Atkinson & Fedorov 1975): for each pair of fits, the χ² misfit that remains when
one is refitted, by one linear step, to the FRFs that the other predicts, its present posterior
being the prior. (Hunter & Reiner 1965 compare without refitting, which counts differences that
refitting removes.)
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from planner.diagnosis.diagnose import Diagnosis
from planner.diagnosis.search import key_of
from planner.diagnosis.verdict import Place, probabilities
from planner.fit.fitted import StructureFit
from planner.fit.misfit import FrfMisfit
from planner.fit.posterior import RobotPosterior
from planner.inference.block_diagonal import block_diagonal
from planner.measurement.nuisances import OF_HAMMER
from planner.recording.points import TCP, Layout

LIKELY = 0.05  # probability from which an explanation counts as tied with the likeliest
MOST_TIED = 4  # compared: the likeliest
LINES = 48  # over the band at which FRFs are compared, evenly spaced
AXES = 3


@dataclass(frozen=True, eq=False)
class Tied:
    """A fit, and effects of it that matter; probabilities of those that are tied sum to 1."""

    places: tuple[Place, ...]
    probability: float
    fit: StructureFit


def tied(found: Diagnosis) -> tuple[Tied, ...]:
    """Explanations that recordings leave tied, likeliest first; one where nothing is tied.

    Those that differ only by what is too small to matter are one.
    """
    idle = {e.place for e in found.verdict.effects if not e.counts}
    weight, groups = probabilities(found.explored.settled), {}
    for fit in sorted(found.explored.settled, key=lambda f: -weight[key_of(f)]):
        groups.setdefault(key_of(fit) - idle, []).append(fit)
    shares = {key: sum(weight[key_of(f)] for f in fits) for key, fits in groups.items()}
    kept = sorted((k for k in groups if shares[k] > LIKELY), key=lambda k: -shares[k])[:MOST_TIED]
    whole = sum(shares[key] for key in kept)
    return tuple(
        Tied(tuple(sorted(key)) or (("none", None),), shares[key] / whole, groups[key][0])
        for key in kept
    )


def separation(candidates: Sequence[Tied], q: np.ndarray, more: tuple[str, ...] = ()) -> np.ndarray:
    """Expected logarithm of the odds (n, 3) that a hit along each tcp axis gives at q (n, dof).

    q in rad; sensors at the points `more` listen beside those of the recordings. The odds are those
    of the true candidate to each other one, averaged with their probabilities; 0 where there are
    fewer than two.
    """
    gain = np.zeros((len(q), AXES))
    share = np.array([c.probability for c in candidates])
    for place, row in enumerate(np.atleast_2d(q) if len(candidates) > 1 else ()):
        seen = [_Predicted.of(RobotPosterior.of(c.fit), row, more) for c in candidates]
        for true, other in permutations(range(len(candidates)), 2):
            weight = share[true] * share[other] / (1 - share[true])
            gain[place] += weight * seen[other].left_of(seen[true]) / 2
    return np.nan_to_num(gain)


@dataclass(frozen=True, eq=False)
class _Predicted:
    """FRF (1, r, 3, F) at a pose, its columns (1, D, r, 3, F), the precision (D, D) of what moves
    it, and a misfit to it."""

    frf: np.ndarray
    columns: np.ndarray
    precision: np.ndarray
    misfit: FrfMisfit

    @classmethod
    def of(cls, posterior: RobotPosterior, q: np.ndarray, more: tuple[str, ...]) -> "_Predicted":
        """At q (dof,) in rad; what hits, readback and visits leave open moves it too."""
        found, measured = posterior.found, posterior.found.misfit.data.measured
        lines = np.linspace(measured.frequency_hz.min(), measured.frequency_hz.max(), LINES)
        layout = Layout((TCP,), (*measured.layout.sensors, *more))
        structure = replace(posterior.structure, sensors=len(layout.sensors))
        sloped = structure.prior.carried.with_slopes(q, layout)
        data = replace(posterior.at(q[None], lines, layout), matrices=sloped)
        misfit = FrfMisfit(structure, data, posterior.tolerances, posterior.size)
        # Of a sensor that is new nothing is known but its tolerances.
        same = [*range(posterior.structure.size - OF_HAMMER), -2, -1]
        x, precision = structure.mean.copy(), structure.precision.copy()
        x[same] = found.at.x[same]
        precision[np.ix_(same, same)] = (found.at.normal + found.at.precision)[np.ix_(same, same)]
        own = misfit.nothing_open()
        frf, columns, _ = misfit.columns(x, misfit.about(own, x))
        noise = float(np.median((measured.sd / found.misfit.size)[measured.used]))
        there = replace(data.measured, accelerance=frf)
        size = replace(misfit, data=replace(data, measured=there)).size
        there = replace(there, sd=noise * size)
        misfit = replace(misfit, data=replace(data, measured=there))
        both = block_diagonal(precision, np.eye(own.shape[1]))
        return cls(frf, columns[:, :-1], both, misfit)

    def left_of(self, true: "_Predicted") -> np.ndarray:
        """χ² (3,), of a hit along each axis, that refitting to what `true` predicts leaves."""
        missed = (true.frf - self.frf)[:, None]
        given = np.concatenate([missed, self.columns], axis=1)
        white = true.misfit.whitened(given).reshape(given.shape[1], 2, -1, AXES, given.shape[-1])
        found = []
        for axis in range(AXES):
            r, *j = white[:, :, :, axis].reshape(len(white), -1)
            columns = np.array(j)
            pull = columns @ r
            inner = self.precision + columns @ columns.T
            found.append(float(r @ r - pull @ np.linalg.solve(inner, pull)))
        return np.array(found)
