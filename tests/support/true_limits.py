"""Limits of a cut by a campaign's predicted FRFs beside those of the true ones."""

from dataclasses import dataclass

import numpy as np

from planner.milling.cut import Cut
from planner.milling.cutter_frf import of_accelerance
from planner.milling.lobes import depths_of, sampled_limits, stability_limits
from planner.milling.structure import of_frf


@dataclass(frozen=True, eq=False)
class LimitPair:
    """At n speeds: limit by the mean FRFs, by the true ones, and the 90 % band (2, n), in m."""

    predicted: np.ndarray
    true: np.ndarray
    band: np.ndarray

    @property
    def off(self) -> np.ndarray:
        """(n,) relative error."""
        return np.abs(self.predicted / self.true - 1)

    @property
    def inside(self) -> np.ndarray:
        """(n,) whether the true limit is inside the band."""
        return (self.band[0] <= self.true) & (self.true <= self.band[1])


def limit_pair(
    cut: Cut, lines: np.ndarray, mean: np.ndarray, sd: np.ndarray, true: np.ndarray, samples: int,
    true_lines: np.ndarray | None = None,
) -> LimitPair:  # fmt: skip
    """Of accelerances (3, 3, F) in m/s²/N; the true ones at lines of their own, where given."""
    told = of_frf(of_accelerance("predicted", lines, mean, sd), cut)
    known = of_frf(
        of_accelerance("true", lines if true_lines is None else true_lines, true, None), cut
    )
    found = stability_limits(told.machine(cut))
    drawn = sampled_limits(told.samples(cut, samples), found).depth_m
    return LimitPair(
        depths_of(found),
        depths_of(stability_limits(known.machine(cut))),
        np.quantile(drawn, (0.05, 0.95), axis=0),
    )
