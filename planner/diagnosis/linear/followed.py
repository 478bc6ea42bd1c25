"""Fits followed to where their evidence is best: on two cores, and remembered."""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from typing import Any, Generic, TypeVar

from planner.diagnosis.linear.discrepancy import MOST_STEPS, InnerProducts, Worth
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.thresholds import DISCREPANCY_USUAL
from planner.inference.parallel import side_by_side

REMEMBERED = 64  # answers of each kind
ROUGH_STEPS = 4
K = TypeVar("K", bound=Hashable)
R = TypeVar("R")
Springs = tuple[str, ...]
There = tuple[InnerProducts, float]  # around where a fit was followed to, and its log evidence


class _Remembered(Generic[K, R]):
    """What `work` makes of each: what is added to a set of fits is weighed with those known."""

    def __init__(self, work: Callable[[K], Any], whole: Callable[[K, Any], R]):
        self.work, self.whole, self.known = work, whole, dict[K, R]()

    def __call__(self, asked: Sequence[K]) -> list[R]:
        """Answers in the order of what is asked."""
        new = [one for one in dict.fromkeys(asked) if one not in self.known]
        for one, found in zip(new, side_by_side(self.work, new), strict=True):
            self.known[one] = self.whole(one, found)
        answers = [self.known[one] for one in asked]
        for one in list(self.known)[:-REMEMBERED]:
            del self.known[one]
        return answers


def unfollowed(fits: Sequence[Fit], springs: Springs) -> list[There]:
    """Products of each fit where it is, and its log evidence by one step."""
    return _UNFOLLOWED([(fit, springs) for fit in fits])


def followed(fits: Sequence[Fit], springs: Springs, hopeful: Sequence[bool]) -> list[There]:
    """The same, followed to where it is best if there is hope."""
    there = unfollowed(fits, springs)
    far = iter(_FOLLOWED([(n[0], springs) for n, hope in zip(there, hopeful, strict=True) if hope]))
    return [next(far) if hope else near for hope, near in zip(hopeful, there, strict=True)]


def worths(
    there: Sequence[There], springs: Springs, close: Sequence[bool], temper: float
) -> list[Worth]:
    """What is close is asked at all sizes of the discrepancy, the rest at the usual one."""
    steps = (MOST_STEPS if c else None for c in close)
    return _WORTHS([(p, springs, s, temper) for (p, _), s in zip(there, steps, strict=True)])


def left_of(there: There, springs: Springs) -> float:
    """χ² per value that the likeliest size of the discrepancy leaves, roughly: for the temper."""
    return _WORTHS([(there[0], springs, ROUGH_STEPS, 1.0)])[0].per_value


def _first(asked: tuple[Fit, Springs]) -> tuple:
    products = InnerProducts.of(*asked)
    return _bare(products, products.at(DISCREPANCY_USUAL, 1.0).evidence)


def _far(asked: tuple[InnerProducts, Springs]) -> tuple:
    near, springs = asked
    products, there = near.settled(DISCREPANCY_USUAL, 1.0, springs)
    return _bare(products, there.evidence)


def _worth(asked: tuple[InnerProducts, Springs, int | None, float]) -> Worth:
    products, springs, steps, temper = asked
    if steps:
        return products.worth(temper, springs, steps=steps)
    return products.worth(temper, springs, (DISCREPANCY_USUAL,), steps=1)


def _bare(products: InnerProducts, evidence: float) -> tuple:
    """Without the fit, which is at hand and holds all recordings."""
    return products.fit.x, products.products, products.own, products.numbers, evidence


def _whole(fit: Fit, bare: tuple) -> There:
    x, products, own, numbers, evidence = bare
    return InnerProducts(replace(fit, x=x), products, own, numbers), evidence


_UNFOLLOWED = _Remembered(_first, lambda asked, bare: _whole(asked[0], bare))
_FOLLOWED = _Remembered(_far, lambda asked, bare: _whole(asked[0].fit, bare))
_WORTHS = _Remembered(_worth, lambda asked, worth: worth)
