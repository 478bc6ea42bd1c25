"""Drift: stiffness that changes in the course of the campaign, whatever the pose.

All springs are multiplied by e^ψ(order), order being 0 at the first visit and 1 at the last.
"""

from dataclasses import dataclass

import numpy as np

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.thresholds import DRIFT_LOG_SD


@dataclass(frozen=True)
class Drift(Effect):
    """ψ(order) of one kind: "gradual" (end, bend), "step" (size, after `since`), "free" (each)."""

    kind: str = "gradual"
    since: float = 0.5

    name = "drift"

    def log_factor(self, order: np.ndarray, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """ψ(order) (n,) and its derivatives (n, p)."""
        if self.kind == "step":
            after = (order >= self.since).astype(float)
            return psi[0] * after, after[:, None]
        if self.kind == "free":
            return np.append(0.0, psi), np.vstack([np.zeros(len(psi)), np.eye(len(psi))])
        shape, slope = _bent(order, psi[1])
        return psi[0] * shape, np.stack([shape, psi[0] * slope], axis=1)

    def starts(self) -> np.ndarray:
        """See `Effect.starts`."""
        if self.kind == "gradual":
            return np.array([[0.5 * DRIFT_LOG_SD, 0.0], [-0.5 * DRIFT_LOG_SD, 0.0]])
        return np.array([[q.mean for q in self.quantities]])

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        size, sd, _ = values["change"]
        how = "at once" if self.kind == "step" else "bit by bit"
        return (
            f"Stiffness changes by {100 * size:.3g} ± {100 * sd:.1g} % in the course of the "
            f"campaign, {how}: let the robot warm up, and return to a pose to check."
        )


def _bent(order: np.ndarray, bend: float) -> tuple[np.ndarray, np.ndarray]:
    """(1 − e^(−κo)) / (1 − e^(−κ)) and its derivative with respect to κ."""
    if abs(bend) < 1e-4:
        return order + bend * order * (1 - order) / 2, order * (1 - order) / 2
    up, down = -np.expm1(-bend * order), -np.expm1(-bend)
    rise = order * np.exp(-bend * order)
    return up / down, rise / down - up * np.exp(-bend) / down**2
