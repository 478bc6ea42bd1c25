"""What a fit is worth where no simulation is quite right: a discrepancy whose size is inferred.

At each pose on its own, every spring may differ from the robot's by a share τ (1 sd) and every
damper by DAMPERS τ. FRFs then err smoothly over frequency, in proportion to themselves, and
otherwise at every pose, as those of a simulation do that leaves small things out. τ is unknown: the
evidence of a candidate is that of all sizes together (Kennedy and O'Hagan 2001, section 4.3, with
the discrepancy in the springs instead of the output). So an effect is worth what it says of all
poses in common, and what wears the discrepancy of each pose away is worth little.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.diagnosis.linear.around_misses import AroundMisses
from planner.diagnosis.linear.fit import LAST_STEPS, Fit, approached
from planner.diagnosis.linear.objective import Misfit
from planner.diagnosis.thresholds import (
    CHAIN_VARIES,
    DAMPERS,
    DISCREPANCIES,
    DISCREPANCY_FACTOR,
    DISCREPANCY_UNKNOWN,
    DISCREPANCY_USUAL,
)
from planner.identification.measurement_model import OpenNumbers, real_rows
from planner.identification.missed_ports import guess
from planner.inference.least_squares import within_box
from planner.inference.log_space import log_sum


@dataclass(frozen=True, eq=False)
class InnerProducts:
    """Of a fit's residuals, of what each pose leaves open, and of derivatives, pose by pose.

    `products` (n, 1 + l + k + D, …) are those of residual, l open numbers of the pose alone, k of
    the chain at all poses, and D derivatives by what is `free` in x; `own` (l,) are sds of the open
    numbers in multiples of τ (springs), 0 where they have their tolerance.
    """

    fit: Fit
    products: np.ndarray
    own: np.ndarray
    numbers: OpenNumbers

    @classmethod
    def of(cls, fit: Fit, springs: Sequence[str]) -> "InnerProducts":
        """Of a fit; `springs` may differ from pose to pose.

        All is taken around what the fit tells of hits, joints and the chain of all poses.
        """
        misfit = fit.misfit
        first = cls.around(fit, springs, misfit.around_misses(fit.x))
        told = guess(first.worth(1.0).missed)
        return cls.around(fit, springs, misfit.around_these(fit.x, told))

    @classmethod
    def around(cls, fit: Fit, springs: Sequence[str], there: AroundMisses) -> "InnerProducts":
        """Of a fit, around known misses."""
        assert there.slope is not None
        numbers, open_ = OpenNumbers.of(there.residual), there.opened()
        own = multiples(fit.misfit, springs)
        loose, made = np.flatnonzero(own), []
        for one, opened, sloped in zip(there.residual, open_, there.slope, strict=True):
            r, b, j = real_rows(one[None]), real_rows(opened), real_rows(sloped)
            varies = b.copy()
            varies[numbers.hits : numbers.known] *= CHAIN_VARIES
            rows = np.concatenate([r, varies, j[loose], numbers.shared(b), j])
            made.append(rows @ rows.T)
        own = np.concatenate([np.zeros(open_.shape[1]), own[loose]])
        return cls(fit, np.array(made), own, numbers)

    def worth(self, temper: float) -> "Worth":
        """Evidence over all sizes, χ² counting 1/`temper`."""
        each = [self._at(size, temper) for size in DISCREPANCIES]
        evidence = np.array([one[0] for one in each])
        scores = np.array([one[1] for one in each])
        likeliest = int(np.argmax(evidence))
        _, _, chi2, step, own = each[likeliest]
        values = max(float(self.fit.misfit.counts.sum()), 1.0)
        size, chain = DISCREPANCIES[likeliest], self.numbers.chain
        missed = own[:, : np.count_nonzero(self.own == 0)]
        of_chain = slice(self.numbers.hits, self.numbers.known)
        missed[:, of_chain] = CHAIN_VARIES * missed[:, of_chain] + step[:chain]
        ends = np.array([self._moved(one[3][chain:]) for one in each])
        return Worth(evidence, scores, chi2 / values, size, missed, ends)

    def _moved(self, step: np.ndarray) -> np.ndarray:
        """x (D,) after a step (free,) in prior sds."""
        misfit, x = self.fit.misfit, self.fit.x.copy()
        x[misfit.free] += misfit.sd[misfit.free] * step
        return x

    def _at(
        self, size: float, temper: float
    ) -> tuple[float, np.ndarray, float, np.ndarray, np.ndarray]:
        """Log evidence, −2 ln likelihood (n,) of each pose, χ², the step, and what is each pose's.

        By Laplace's method, after one step to the optimum that goes with this size.
        """
        misfit, count = self.fit.misfit, len(self.own)
        scale = np.where(self.own > 0, size * self.own, 1.0)
        rest = np.r_[0, 1 + count : self.products.shape[1]]
        left, volume, told = [], [], []
        for product in self.products / temper:
            inner = scale[:, None] * product[1 : 1 + count, 1 : 1 + count] * scale + np.eye(count)
            factor = np.linalg.cholesky(inner)
            onto = np.linalg.solve(factor, scale[:, None] * product[1 : 1 + count][:, rest])
            left.append(product[np.ix_(rest, rest)] - onto.T @ onto)
            volume.append(2 * float(np.sum(np.log(np.diagonal(factor)))))
            told.append(np.linalg.solve(factor.T, onto))
        whole = np.sum(left, axis=0)
        free = np.flatnonzero(misfit.free)
        chain = self.numbers.chain
        sd = np.concatenate([np.ones(chain), misfit.sd[free]])
        away = np.concatenate([np.zeros(chain), ((self.fit.x - misfit.mean) / misfit.sd)[free]])
        precision = whole[1:, 1:] * np.outer(sd, sd) + np.eye(len(sd))
        gradient = whole[1:, 0] * sd + away
        lower, upper = (
            np.append(np.full(chain, far), ((side - self.fit.x) / misfit.sd)[free])
            for far, side in zip((-np.inf, np.inf), misfit.sides, strict=True)
        )
        step = within_box(precision, -gradient, np.minimum(lower, 0.0), np.maximum(upper, 0.0))
        gain = -float(gradient @ step + step @ precision @ step / 2)
        # A step too long for what is linear gains at most what there is to gain.
        most = 0.45 * float(whole[0, 0])
        step = step * (1 - np.sqrt(1 - most / gain) if gain > most else 1.0)
        there = np.append(1.0, sd * step)
        chi2 = np.array([there @ one @ there for one in left])
        far, volumes = away + step, np.array(volume)
        evidence = -(chi2.sum() + far @ far + volumes.sum()) / 2
        evidence -= np.linalg.slogdet(precision)[1] / 2
        own = -np.array(told) @ there
        return float(evidence), chi2 + volumes, temper * float(chi2.sum()), step, own


@dataclass(frozen=True, eq=False)
class Worth:
    """Log evidence (sizes,) of a fit, and −2 ln likelihood (sizes, n) of each pose.

    What is left of χ² per value, and what was `missed` (n, l) by hits, chain and readback, in sds,
    are those of the likeliest `size` of the discrepancy; `ends` (sizes, D) is where x is best at
    each.
    """

    by_size: np.ndarray
    scores: np.ndarray
    per_value: float
    size: float
    missed: np.ndarray
    ends: np.ndarray

    @property
    def log_evidence(self) -> float:
        """Over all sizes, as they are where nothing unknown is there."""
        return float(log_sum(self.by_size + size_priors()[0], axis=0))


def multiples(misfit: Misfit, springs: Sequence[str]) -> np.ndarray:
    """(P,) sds in multiples of τ by which springs and dampers differ from pose to pose.

    0 for those that are not among the named `springs`.
    """
    names = [p.name for p in misfit.parametrisation.parameters]
    each = [(1.0 if "stiffness" in name else DAMPERS) * (name in springs) for name in names]
    return np.array(each)


def settled_with(fit: Fit, springs: Sequence[str], size: float) -> Fit:
    """The fit followed to where it is best with a discrepancy of this size.

    Its parameters are then as unsure as poses that differ leave them.
    """
    if not size or fit.misfit.tolerances is None:
        return fit
    misfit = replace(fit.misfit, discrepancy=size * multiples(fit.misfit, springs))
    return approached(misfit, [fit.x], LAST_STEPS)


def size_priors() -> tuple[np.ndarray, np.ndarray]:
    """Log probabilities of DISCREPANCIES, where nothing unknown is there and where something is."""
    sizes = np.maximum(DISCREPANCIES, 1e-6)
    over = np.log(np.maximum(sizes / DISCREPANCY_USUAL, 1.0)) / np.log(DISCREPANCY_FACTOR)
    under = np.log(np.minimum(sizes / DISCREPANCY_UNKNOWN, 1.0)) / np.log(DISCREPANCY_FACTOR)
    return tuple(p - log_sum(p, axis=0) for p in (-(over**2) / 2, -(under**2) / 2))  # type: ignore
