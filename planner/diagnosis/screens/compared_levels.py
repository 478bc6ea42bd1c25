"""Force levels compared by a linear fit: by how much hits differ, and whether a joint says why."""

from dataclasses import dataclass

import numpy as np

from planner.dataset.dataset import Dataset
from planner.diagnosis.laws.equivalent_stiffness import Equivalent, equivalent, system_of
from planner.diagnosis.laws.open_misses import OpenMisses
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.linear.problem import Problem, tolerances_of
from planner.diagnosis.thresholds import LEVELS_MATTER, LINEARISED, PLACED


@dataclass(frozen=True, eq=False)
class ComparedLevels:
    """Force levels compared by a linear fit, which tells what misses of hits leave open."""

    problem: Problem
    misses: OpenMisses
    found: Equivalent

    @classmethod
    def by(cls, recorded: Dataset, problem: Problem, plain: Fit) -> "ComparedLevels":
        misses = OpenMisses.told(plain, recorded, tolerances_of(problem.simulation))
        return cls(problem, misses, equivalent(recorded, system_of(plain), misses))

    @property
    def levels_matter(self) -> float:
        """How far FRFs of a level may be off their average, as a share of |H|."""
        return LEVELS_MATTER * self.problem.simulation.robot.config.diagnose.matters

    @property
    def rattles(self) -> bool:
        """Whether hits differ by what matters, and no stiffness of its own for every hit says how.

        So does a gear that its weight holds at one end of its gap, and that some hits lift off:
        repeats differ as levels do then.
        """
        if not self.found.delta.shape[1]:
            return False
        unlike_a_spring = equivalent_share(self.found) <= LINEARISED and not placed(self.found)
        return unlike_a_spring and off_the_average(self.found) > self.levels_matter


def off_the_average(found: Equivalent) -> float:
    """How far FRFs of a force level are off their average over levels, as a share of |H|, rms.

    By half of what they differ by from the strongest level, beyond noise and misses of hits; at the
    visit where that is most: contact and loose parts need not be everywhere.
    """
    here = found.visit == np.unique(found.visit)[:, None]
    beyond = np.maximum(here @ (found.before - found.count), 0.0)
    return float(np.sqrt(np.max(beyond / np.maximum(here @ found.power, 1e-300)))) / 2


def equivalent_share(found: Equivalent) -> float:
    """Share of the levels' differences that a stiffness of its own a hit explains, best joint."""
    left = float(found.chi2.sum(axis=0).min() - found.count.sum())
    return 1 - max(left, 0.0) / max(excess(found), 1e-9)


def placed(found: Equivalent) -> bool:
    """Whether a stiffness of its own a hit explains clearly more at one joint than at any other."""
    if not found.delta.shape[1]:
        return False
    first, *others = np.sort(found.chi2.sum(axis=0))
    return bool(first < PLACED * min(float(found.before.sum()), *others))


def disproportion(found: Equivalent) -> float:
    """χ² per value of the differences between force levels, 1 if the structure is linear."""
    return float(found.before.sum() / max(found.count.sum(), 1))


def excess(found: Equivalent) -> float:
    """χ² of what levels differ by, beyond noise."""
    return float(found.before.sum() - found.count.sum())
