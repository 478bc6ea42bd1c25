"""Springs that robot.toml does not state: a soft base, bearings that tilt, links that bend."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from planner.effects.effect import Operator, SpringPrior
from planner.words import with_sd

# Stiffness of what is not stated, in that of the stiffest spring stated at the joint (the floor: of
# the whole robot); of bearings of which nobody would say a word.
STIFFNESS, SLIGHTLY = (1.0, 300.0), (50.0, 2000.0)
SOFT_SD = float(np.log(STIFFNESS[1] / STIFFNESS[0]) / np.sqrt(12))  # of a log-uniform one


@dataclass(frozen=True)
class SoftBase(Operator):
    """The base tilts on its floor."""

    kind = "soft_base"
    effect = "base_compliance"

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        return f"The base gives way ({stiffness_told(values)}): check anchor bolts and foundation."


@dataclass(frozen=True)
class ShiftingBase(Operator):
    """The base turns and shifts on its floor."""

    kind = "shifting_base"
    effect = "base_compliance"

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        return f"The base shifts or turns ({stiffness_told(values)}): check anchor bolts and pins."


@dataclass(frozen=True)
class Tilt(Operator):
    """A joint's bearing tilts across its axis."""

    kind = "transverse_compliance"

    @property
    def spring_priors(self) -> Mapping[int, SpringPrior]:
        """As any spring that is not stated, whatever bearings are elsewhere."""
        return {spring: SpringPrior(0.0, SOFT_SD) for spring in self.springs}

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        return f"The bearing of {self.at} tilts ({stiffness_told(values)}): check its preload."


@dataclass(frozen=True)
class SlightBearing(Operator):
    """A bearing that gives as little as all do: nothing is wrong, and FRFs show it.

    Its stiffness is within SLIGHTLY times the joint's.
    """

    kind = "slight_bearing"

    @property
    def spring_priors(self) -> Mapping[int, SpringPrior]:
        """See `Operator.spring_priors`."""
        low, high = np.log(SLIGHTLY) - np.log(STIFFNESS).mean()
        prior = SpringPrior((low + high) / 2, (high - low) / np.sqrt(12), low)
        return {spring: prior for spring in self.springs}

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        return f"The bearing of {self.at} gives slightly, as any does."


@dataclass(frozen=True)
class BendingLink(Operator):
    """A link bends and twists half-way to the next joint."""

    kind = "link_flexibility"

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        return f"{self.at} bends ({stiffness_told(values)})."


KNOWN = 0.3  # relative sd to which a stiffness is told


def stiffness_told(values: Mapping[str, tuple[float, float]]) -> str:
    """The springs that are known, with their sds."""
    told = {n.split(" of ")[1]: v for n, v in values.items() if n.startswith("stiffness")}
    known = {name: v for name, v in told.items() if v[1] < KNOWN * v[0]}
    said = []
    for name, (value, sd) in known.items():
        unit = "N/m" if " along " in name else "N·m/rad"
        said.append(f"{name.split(' ', 1)[1]} {with_sd(value, sd)} {unit}")
    return f"stiffness {', '.join(said)}" if said else "the recordings do not tell yet by how much"
