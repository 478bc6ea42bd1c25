"""One pose at odds with all others: the robot did not stand there as said, or differs there."""

from dataclasses import dataclass

import numpy as np

from planner.diagnosis.diagnose import Diagnosis
from planner.fit.fitted import settled
from planner.fit.misfit import FrfMisfit
from planner.fit.posterior import RobotPosterior
from planner.words import significant

LEAST, MOST = 3, 12  # poses among which one can be odd
TRIED = 2  # poses that refitting follows least
CLEARLY, AGREES = 2.0, 1.0  # misfits; at 1 are noise and what just does not matter


@dataclass(frozen=True)
class OddPose:
    """Misfit (χ² per value) of the simulation refitted to all poses, and without this one."""

    pose: str
    misfit: float
    misfit_without: float

    @property
    def sentence(self) -> str:
        """For the engineer."""
        without, whole = significant(self.misfit_without), significant(self.misfit)
        return (
            f"Pose {self.pose} is at odds with all others: without it the refitted simulation "
            f"agrees with them (misfit {without}, with it {whole}; 1 just matters). Check whether "
            f"the robot stood there as said, or measure it again."
        )


def odd_pose(found: Diagnosis) -> OddPose | None:
    """The pose without which refitting alone explains the rest, where nothing explains them all.

    None where there is no such pose among the worst, or more than one: then it is not known which.
    """
    names, fit = np.array(found.recorded.poses), found.refitted
    every, least = list(dict.fromkeys(names)), found.search.floor
    whole, by_pose = RobotPosterior.of(fit).misfits(least)
    several = LEAST <= len(every) <= MOST
    if found.verdict.verdict != "unexplained" or whole <= CLEARLY or not several:
        return None
    odd = []
    for name in sorted(every, key=lambda name: -by_pose[names == name].sum())[:TRIED]:
        rest = np.flatnonzero(names != name)
        data = fit.misfit.data.at(rest)
        misfit = FrfMisfit(fit.structure, data, found.search.tolerances, fit.misfit.rho, least)
        again = settled(misfit, misfit(fit.at.x, fit.at.own[rest]), rounds=2)
        without = RobotPosterior.of(again).misfits(least)[0]
        if without <= AGREES:
            odd.append(OddPose(str(name), whole, without))
    return odd[0] if len(odd) == 1 else None
