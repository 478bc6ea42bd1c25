"""An exponential window of the analyser of which nobody said anything."""

from dataclasses import dataclass

import numpy as np

from planner.diagnosis.effects.effect import Effect, Quantity
from planner.diagnosis.thresholds import ALONE_WINDOW_RATE_1_S, ALONE_WINDOW_RATE_LOG_SD
from planner.dynamics.simulation import Simulation


@dataclass(frozen=True)
class ExponentialWindow(Effect):
    """Force and responses were multiplied by e^(−rate t): H is that at s + rate."""

    name = "exponential_window"
    artefact = True

    @classmethod
    def everywhere(cls, simulation: Simulation) -> tuple["ExponentialWindow", ...]:
        """The effect at the sensor, whose channels share one window."""
        median = float(np.log(ALONE_WINDOW_RATE_1_S))
        return (cls("sensor", (Quantity("rate", "1/s", median, ALONE_WINDOW_RATE_LOG_SD, True),)),)

    def rate(self, psi: np.ndarray) -> float:
        """The window's decay rate e^ψ in 1/s."""
        return float(np.exp(psi[0]))

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        value, sd, _ = values["rate"]
        return (
            f"All modes decay {value:.3g} ± {sd:.1g} 1/s too fast: an exponential window was "
            f"applied and not corrected; switch it off or state it."
        )
