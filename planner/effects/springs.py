"""Springs that robot.toml does not state: a soft base, bearings that tilt, links that bend."""

from collections.abc import Mapping
from dataclasses import dataclass

from planner.effects.effect import Effect


@dataclass(frozen=True)
class SoftBase(Effect):
    """The base tilts, turns and shifts on its floor."""

    kind = "soft_base"

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Effect.words`."""
        return f"The base gives way ({_stiffness(values)}): check anchor bolts and foundation."


@dataclass(frozen=True)
class Tilt(Effect):
    """A joint's bearing tilts across its axis."""

    kind = "tilt"

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Effect.words`."""
        return f"The bearing of {self.at} tilts ({_stiffness(values)}): check its preload."


@dataclass(frozen=True)
class BendingLink(Effect):
    """A link bends and twists half-way to the next joint."""

    kind = "bending_link"

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Effect.words`."""
        return f"{self.at} bends ({_stiffness(values)})."


def _stiffness(values: Mapping[str, tuple[float, float]]) -> str:
    said = [
        f"{name.split(' of ')[1]} {value:.3g} ± {sd:.1g}"
        for name, (value, sd) in values.items()
        if name.startswith("stiffness")
    ]
    return ", ".join(said)
