"""One cut at one pose: is it stable, how sure is that, and on which modes does it hang?"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from planner.milling.cut import Cut
from planner.milling.machine import Machine, multipliers
from planner.milling.spread import moved
from planner.milling.structure import Structure

SAMPLES = 40
STEP = 1e-3  # relative, of a frequency, for slopes
LEAST_SD = 1e-6  # of log |µ|: where nothing is uncertain


@dataclass(frozen=True, eq=False)
class PoseDecision:
    """Margin −log |µ| at the wanted point, above 0 where stable, and its sd.

    `frequency_hz` (m,) of the modes, `slope` (m,) how the margin changes per relative change of
    each frequency.
    """

    margin: float
    sd: float
    frequency_hz: np.ndarray
    slope: np.ndarray

    @property
    def probability(self) -> float:
        """Of being stable."""
        return float(norm.cdf(self.margin / self.sd))


def decide(structure: Structure, cut: Cut, rpm: float, depth_m: float) -> PoseDecision:
    """At a speed in rpm and a depth in m, by full discretisation and samples."""
    machine = structure.machine(cut)
    margin = _margin(machine, rpm, depth_m)
    found = [_margin(m, rpm, depth_m) for m in structure.samples(cut, SAMPLES)]
    # About the margin of what is expected: samples are not centred where it bends.
    sd = float(np.sqrt(np.mean((np.array(found) - margin) ** 2))) if found else 0.0
    poles = np.unique(machine.modes.poles)
    slope = np.empty(len(poles))
    for i in range(len(poles)):
        by = np.zeros(3 * len(poles) + 1)
        by[i] = STEP
        shifted = Machine(moved(machine.modes, by), cut, machine.coefficients)
        slope[i] = (_margin(shifted, rpm, depth_m) - margin) / STEP
    return PoseDecision(margin, max(sd, LEAST_SD), np.abs(poles) / (2 * np.pi), slope)


def _margin(machine: Machine, rpm: float, depth_m: float) -> float:
    found = multipliers(machine.monodromies(rpm)(np.array([depth_m])))[0]
    return -float(np.log(np.abs(found)))
