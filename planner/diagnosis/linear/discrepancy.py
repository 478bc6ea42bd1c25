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
from planner.diagnosis.linear.one_size import AtSize
from planner.diagnosis.thresholds import (
    CHAIN_VARIES,
    DAMPERS,
    DISCREPANCIES,
    DISCREPANCY_FACTOR,
    DISCREPANCY_UNKNOWN,
    DISCREPANCY_USUAL,
)
from planner.inference.least_squares import Damping, Limits, accept, begin, propose
from planner.inference.log_space import log_sum
from planner.measurement.missed_ports import guess
from planner.measurement.nuisances import OpenNumbers, real_rows

MOST_STEPS, NOTHING_GAINED = 16, 0.5  # to where a fit is best; nats that a step is not worth
STILL = 0.25  # nats within which log evidences are the same: a fit is then followed no farther
# Nearly undamped, as fits are close to where they are best; after a step that led nowhere better a
# hundred times more.
DAMPING = Damping(first=1e-3, least=1e-3, heavier=100.0)
FALLEN = 40.0  # nats by which one size is behind another, from which on no farther ones count
NOT_LOOKED_AT = -1e12  # log evidence of sizes at which a fit was not followed


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
        there = first.at(DISCREPANCY_USUAL, 1.0)
        told = guess(first.missed(there, there.best))
        return cls.around(fit, springs, misfit.around_these(fit.x, told))

    @classmethod
    def around(cls, fit: Fit, springs: Sequence[str], there: AroundMisses) -> "InnerProducts":
        """Of a fit, around known misses."""
        assert there.slope is not None
        numbers, open_ = OpenNumbers.of(there.residual), there.opened()
        own, count = multiples(fit.misfit, springs), open_.shape[1]
        loose, chain = np.flatnonzero(own), np.arange(numbers.hits, numbers.known)
        # Rows of r, of what is open, and of derivatives, some of them twice.
        first, last = 1 + count, 1 + count + there.slope.shape[1]
        rows = np.r_[0:first, first + loose, 1 + chain, first:last]
        scale = np.ones(len(rows))
        scale[1 + chain] = CHAIN_VARIES
        made = []
        for one, opened, sloped in zip(there.residual, open_, there.slope, strict=True):
            each = real_rows(np.concatenate([one[None], opened, sloped]))
            made.append((each @ each.T)[np.ix_(rows, rows)] * np.outer(scale, scale))
        own = np.concatenate([np.zeros(count), own[loose]])
        return cls(fit, np.array(made), own, numbers)

    def worth(
        self,
        temper: float,
        springs: Sequence[str],
        sizes: Sequence[float] = DISCREPANCIES,
        steps: int = MOST_STEPS,
    ) -> "Worth":
        """Evidence over `sizes` of the discrepancy, χ² counting 1/`temper`.

        The named `springs` may differ from pose to pose. From the usual size on, each is followed
        from its neighbour in so many `steps`, while it may count; others are not looked at.
        """
        each: dict[float, tuple[InnerProducts, AtSize]] = {}
        for way in (
            [size for size in sizes[::-1] if size <= DISCREPANCY_USUAL],
            [size for size in sizes if size > DISCREPANCY_USUAL],
        ):
            here = self
            for size in way:
                most = max((e.evidence for _, e in each.values()), default=-np.inf)
                least = most - 2 * FALLEN
                here, one = each[size] = here.settled(size, temper, springs, steps, least)
                if one.evidence < most - FALLEN:
                    break
        likeliest = max(each, key=lambda size: each[size][1].evidence)
        products, best = each[likeliest]
        values = max(float(self.fit.misfit.counts.sum()), 1.0)
        known = [each.get(size, each[likeliest]) for size in DISCREPANCIES]
        return Worth(
            np.array([each[s][1].evidence if s in each else NOT_LOOKED_AT for s in DISCREPANCIES]),
            np.array([one.scores for _, one in known]), best.chi2 / values, likeliest,
            products.missed(best, best.best), np.array([p.end(one.best) for p, one in known]),
        )  # fmt: skip

    def at(self, size: float, temper: float) -> AtSize:
        """With a discrepancy of this size, χ² counting 1/`temper`."""
        misfit, free = self.fit.misfit, self.fit.misfit.free
        left, volumes, told = self._without_own(size, temper)
        scale = np.concatenate([np.ones(1 + self.numbers.chain), misfit.sd[free]])
        u, lower, upper = (
            ((x - misfit.mean) / misfit.sd)[free] for x in (self.fit.x, *misfit.sides)
        )
        left = left * np.outer(scale, scale)
        return AtSize(left, volumes, told * scale, temper, u, lower, upper)

    def _without_own(self, size: float, temper: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Products (n, 1 + k + D, …) once what is a pose's own is integrated out.

        The logarithms (n,) that this costs, and what is told of a pose's own by the rest.
        """
        count = len(self.own)
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
        return np.array(left), np.array(volume), np.array(told)

    def settled(
        self,
        size: float,
        temper: float,
        springs: Sequence[str],
        steps: int = MOST_STEPS,
        least: float = -np.inf,
    ) -> "tuple[InnerProducts, AtSize]":
        """Followed, step by step, to where it is best with a discrepancy of this size.

        What has less than the `least` log evidence after a few steps is followed no farther.

        Damped Gauss-Newton over x, the chain and the misses of each pose being eliminated; answers
        products there, and what they say. What is told of misses, and of x, is told around itself:
        one step from elsewhere is wrong by hundreds of nats where hits miss.
        """
        here, last = self, self.at(size, temper)
        state = begin(last.u, last, DAMPING, Limits(np.inf, last.lower, last.upper))
        seen = [last.evidence]
        for _ in range(steps):
            if _ended(seen, least) or last.evidence - last.stays < NOTHING_GAINED or state.stuck:
                break
            u = propose(state)
            there = here.moved(last, u, springs)
            after = None if there is None else there.at(size, temper)
            state = accept(state, u, after)
            if state.at is last:  # perhaps only as misses were told around others
                there = here.moved(last, last.u, springs)
                after = None if there is None else there.at(size, temper)
                state = replace(state, at=after or last)
            if there is not None and state.at is after:
                here, last = there, state.at
                seen.append(last.evidence)
        return here, last

    def moved(self, last: AtSize, u: np.ndarray, springs: Sequence[str]) -> "InnerProducts | None":
        """Products where x is u (free,), in prior sds; None where x cannot be.

        Misses are taken around what `last`, of these products, tells of them there.
        """
        misfit, x = self.fit.misfit, self.end(u)
        if not misfit.possible(x):
            return None
        around = misfit.around_these(x, guess(self.missed(last, u)))
        return InnerProducts.around(replace(self.fit, x=x), springs, around)

    def missed(self, last: AtSize, u: np.ndarray) -> np.ndarray:
        """What hits, chain and readback missed (n, l), in sds, where x is u (free,)."""
        own, chain = last.open_at(u)
        missed = own[:, : np.count_nonzero(self.own == 0)]
        of_chain = slice(self.numbers.hits, self.numbers.known)
        missed[:, of_chain] = CHAIN_VARIES * missed[:, of_chain] + chain
        return missed

    def end(self, u: np.ndarray) -> np.ndarray:
        """x (D,) whose free entries are u (free,) prior sds from their means."""
        misfit, x = self.fit.misfit, self.fit.x.copy()
        x[misfit.free] = misfit.mean[misfit.free] + misfit.sd[misfit.free] * u
        return x


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


def _ended(seen: Sequence[float], least: float) -> bool:
    """Whether log evidences stay as they are, to and fro too, or are behind for long.

    Of two in turn the lower counts: steps to the other do not lead there.
    """
    if len(seen) < 4:
        return False
    same = max(abs(seen[-1] - seen[-3]), abs(seen[-2] - seen[-4])) < STILL
    return (same and seen[-1] < seen[-2] + STILL) or max(seen[-4:]) < least


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
