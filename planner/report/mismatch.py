"""How much and where simulation and recordings differ, as the answer of `diagnose` states it."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from planner.words import significant

if TYPE_CHECKING:
    from planner.diagnosis.linear.drift_fit import DriftFits
    from planner.diagnosis.linear_diagnosis import Diagnosis


@dataclass(frozen=True)
class MismatchPlaces:
    """Where the refitted simulation misses the recordings clearly."""

    bands_hz: list[list[float]]
    poses: tuple[str, ...]
    directions: list[str]

    @property
    def sentence(self) -> str:
        """For the engineer."""
        if not self.bands_hz:
            return "Once refitted, the simulation is clearly off in no frequency band."
        bands = ", ".join(f"{low:.0f} to {high:.0f}" for low, high in self.bands_hz)
        where = f", at poses {', '.join(self.poses)}" if self.poses else ""
        along = f", along {', '.join(self.directions)}" if self.directions else ""
        off = f"the simulation is clearly off at {bands} Hz{where}{along}"
        return f"With its own springs refitted and nothing added, {off}."


@dataclass(frozen=True)
class TwoMisfits:
    """χ² per value, refitted and with what explains it; 1: noise, and what just does not matter."""

    refitted: float
    explained: float


@dataclass(frozen=True)
class MismatchShares:
    """Mean square of mismatch over that of the recordings, in dB, at the used poses.

    Of the simulation as stated, refitted, and with what explains it; `left` is what remains of the
    last once misses of hits and the chain's tolerances are taken out: noise, or physics.
    """

    stated: float
    refitted: float
    explained: float
    left: float

    @classmethod
    def of(cls, found: "Diagnosis", drift: "DriftFits | None" = None) -> "MismatchShares":
        """Of a diagnosis; where the robot drifts, of its visits, each by itself."""
        from planner.diagnosis.linear.mismatch import Mismatch
        from planner.diagnosis.linear.problem import FINE

        of = found if drift is None else drift
        given = replace(of.problem, as_built=False).misfit(of.refitted.effect, FINE)
        plain = of.problem.misfit(of.refitted.effect, FINE)
        last = Mismatch.of(of.problem.misfit(of.best.effect, FINE), of.best.x)
        stated = Mismatch.of(given, given.mean).whole
        refitted = Mismatch.of(plain, of.refitted.x).whole
        shares = stated, refitted, last.whole, last.left
        return cls(*(round(10 * float(np.log10(max(share, 1e-12))), 2) for share in shares))

    @property
    def sentence(self) -> str:
        """For the engineer."""
        sides = self.stated, self.refitted, self.explained, self.left
        stated, refitted, explained, left = (significant(100 * 10 ** (db / 20)) for db in sides)
        text = (
            f"The simulation is off from the measured FRFs by {stated} % (root mean square) as "
            f"robot.toml states it, by {refitted} % once its own springs and dampers are refitted, "
            f"and by {explained} % with what was found. Once the likeliest errors of hits "
            f"and sensor are taken out too, {left} % remains."
        )
        if self.refitted <= self.stated:
            return text
        return (
            f"{text} Refitted alone, peaks are farther off than as stated: no values of its own "
            f"springs bring it to the recordings, so that the fit gives up the peaks."
        )
