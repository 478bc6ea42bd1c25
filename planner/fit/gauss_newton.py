"""One solver: damped Gauss–Newton steps (Levenberg–Marquardt) of a misfit from x on."""

from typing import Protocol, TypeVar

import numpy as np

from planner.fit.linearised import Numbers, Point

GOOD, GROWTH, MOST_REJECTED, MOST_DAMPED = 0.5, 3.0, 8, 1e9
SOFTER, STIFFER = 6.0, 0.8  # of a new spring's step, in shares of its compliance


P_co = TypeVar("P_co", bound=Point, covariant=True)


class Misfit(Protocol[P_co]):
    """Of numbers x, beside `own` numbers of poses."""

    @property
    def numbers(self) -> Numbers: ...

    def possible(self, x: np.ndarray) -> bool: ...

    def __call__(self, x: np.ndarray, own: np.ndarray | None = None) -> P_co: ...


def minimised(
    misfit: Misfit[P_co],
    x: np.ndarray,
    steps: int,
    tolerance: float = 0.5,
    own: np.ndarray | None = None,
    by_prior: bool = False,
) -> P_co:
    """Where at most so many steps lead, none of which promises less than `tolerance` nats.

    `by_prior`: damped in the prior's sds, not the data's: so it follows what they leave open.
    """
    s = misfit.numbers
    low, high = s.least, s.most
    at, rejected, growth = misfit(x, own), 0, GROWTH
    damping = 1e-2 if by_prior else 1e-3
    for _ in range(steps):
        normal, gradient = at.normal + s.precision, at.gradient + s.precision @ (at.x - s.mean)
        scale = np.diag(s.precision) if by_prior else np.diag(normal)
        # What is as small, or as large, as it may be stays there.
        free = ~((at.x <= low) & (gradient > 0) | (at.x >= high) & (gradient < 0))
        step = np.zeros(len(free))
        damped = (normal + damping * np.diag(scale))[np.ix_(free, free)]
        step[free] = -np.linalg.solve(damped, gradient[free])
        promised = -float(gradient @ step + 0.5 * step @ normal @ step)
        if promised < tolerance:
            break
        there = np.clip(_moved(s, at.x, step), low, high)
        tried = misfit(there, at.own) if misfit.possible(there) else None
        if tried is not None and tried.value < at.value:
            if at.value - tried.value > GOOD * promised:
                damping = max(0.2 * damping, 1e-4 if by_prior else 1e-7)
            at, rejected, growth = tried, 0, GROWTH
            continue
        damping = max(damping, 0.1 if by_prior else 0.0) * growth * (3 if by_prior else 1)
        growth, rejected = 2 * growth, rejected + 1
        if rejected > MOST_REJECTED or damping > MOST_DAMPED:
            break
    return at


def _moved(s: Numbers, x: np.ndarray, step: np.ndarray) -> np.ndarray:
    """No number goes farther than it may; springs not stated go in compliance, in which FRFs are
    linear."""
    out, new = x + np.clip(step, -s.longest, s.longest), list(s.compliant)
    out[new] = x[new] - np.log1p(np.clip(-step[new], -STIFFER, SOFTER))
    return out
