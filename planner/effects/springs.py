"""Springs that robot.toml does not state: a soft base, bearings that tilt, links that bend."""

from collections.abc import Mapping
from dataclasses import dataclass

from planner.effects.effect import Operator


@dataclass(frozen=True)
class SoftBase(Operator):
    """The base tilts on its floor."""

    kind = "soft_base"

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        return f"The base gives way ({_stiffness(values)}): check anchor bolts and foundation."


@dataclass(frozen=True)
class ShiftingBase(Operator):
    """The base turns and shifts on its floor."""

    kind = "shifting_base"

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        return f"The base shifts or turns ({_stiffness(values)}): check anchor bolts and pins."


@dataclass(frozen=True)
class Tilt(Operator):
    """A joint's bearing tilts across its axis."""

    kind = "tilt"

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        return f"The bearing of {self.at} tilts ({_stiffness(values)}): check its preload."


@dataclass(frozen=True)
class BendingLink(Operator):
    """A link bends and twists half-way to the next joint."""

    kind = "bending_link"

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        return f"{self.at} bends ({_stiffness(values)})."


KNOWN = 0.3  # relative sd to which a stiffness is told


def _stiffness(values: Mapping[str, tuple[float, float]]) -> str:
    told = {n.split(" of ")[1]: v for n, v in values.items() if n.startswith("stiffness")}
    known = {name: v for name, v in told.items() if v[1] < KNOWN * v[0]}
    said = []
    for name, (value, sd) in known.items():
        unit = "N/m" if " along " in name else "N·m/rad"
        said.append(f"{name.split(' ', 1)[1]} {value:.3g} ± {sd:.1g} {unit}")
    return ", ".join(said) if said else "the recordings do not tell yet by how much"
