"""Two loose things on one link, each of which swings in all directions."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from planner.diagnosis.effects.effect import Setting
from planner.diagnosis.effects.hanging_resonator import WAYS, HangingResonator
from planner.diagnosis.effects.local_resonator import LocalResonator
from planner.diagnosis.thresholds import ODDS_OF_NOTHING, SECOND_EFFECT
from planner.dynamics.gradient import Impedance
from planner.dynamics.simulation import Simulation

SECOND = "second_"  # before the names of the second one's numbers


@dataclass(frozen=True)
class TwoHangingResonators(HangingResonator):
    """A hose pack and a bracket, say: ψ is that of the one, then that of the other.

    It is looked for beside one that is known (`linear.second_resonators`).
    """

    @classmethod
    def of(cls, sliding: LocalResonator) -> Self:
        """At the place of one, with the same priors for both."""
        one = sliding if isinstance(sliding, HangingResonator) else HangingResonator.of(sliding)
        other = tuple(replace(q, name=SECOND + q.name) for q in one.quantities)
        return cls(one.at, (*one.quantities, *other), one.low_hz, one.high_hz)

    @property
    def first(self) -> HangingResonator:
        """The one."""
        own = self.quantities[: len(self.quantities) // 2]
        return HangingResonator(self.at, own, self.low_hz, self.high_hz)

    @property
    def prior(self) -> float:
        """That of one, and of a second effect beside it."""
        return self.first.prior * SECOND_EFFECT / ODDS_OF_NOTHING

    def starts(self) -> np.ndarray:
        """Those of the second, the first being at its prior's mean."""
        second = self.first.starts()
        middle = [q.mean for q in self.first.quantities]
        return np.hstack([np.tile(middle, (len(second), 1)), second])

    def impedance(self, setting: Setting, psi: np.ndarray) -> tuple[Impedance, ...]:
        """What both add."""
        return tuple(i for own in np.split(psi, 2) for i in self.first.impedance(setting, own))

    def elements(
        self, simulation: Simulation, values: dict[str, tuple[float, float, str]]
    ) -> dict[str, list[dict[str, Any]]]:
        """See `Effect.elements`."""
        one, other = (self.first.elements(simulation, own) for own in _apart(values))
        return {name: [*one[name], *other[name]] for name in one}

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        told = [
            f"{own['mass'][0]:.2g} kg (at {', '.join(f'{f:.1f}' for f in _frequencies(own))} Hz)"
            for own in _apart(values)
        ]
        return (
            f"Two things on {self.at} swing on their own in three directions, one of {told[0]}, "
            f"one of {told[1]}: check hose pack, brackets and covers there."
        )


def _apart(
    values: dict[str, tuple[float, float, str]],
) -> tuple[dict[str, tuple[float, float, str]], ...]:
    """Values of the one, and of the other, by the names that one alone has."""
    second = {n.removeprefix(SECOND): v for n, v in values.items() if n.startswith(SECOND)}
    return {n: v for n, v in values.items() if not n.startswith(SECOND)}, second


def _frequencies(values: dict[str, tuple[float, float, str]]) -> list[float]:
    return sorted(values[name][0] for name in WAYS)
