"""The measuring chain as one effect: a matrix between true and recorded accelerations, a delay."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.diagnosis.effects.effect import Effect, Quantity, Setting, Transfer
from planner.diagnosis.thresholds import (
    DELAY_SD_S,
    SENSOR_MATRIX_SD,
    WINDOW_RATE_1_S,
    WINDOW_RATE_LOG_SD,
)
from planner.recording.points import SENSOR


@dataclass(frozen=True)
class SensorChain(Effect):
    """x' = A x e^(−sτ), A (3, 3) the same at all poses; with `windowed` also a window's rate.

    ψ = (ln rate if windowed, τ in s, A − 1 row by row).
    """

    windowed: bool = False
    begin: tuple[tuple[float, ...], ...] = ()

    name = "sensor_chain"
    artefact = True

    @classmethod
    def build(
        cls,
        starts: Sequence[np.ndarray],
        windowed: bool = False,
        late_s: Sequence[float] = (),
        sensor: str = SENSOR,
    ) -> "SensorChain":
        """From several starts of A (3, 3), and of the delay where A changes nothing."""
        median = float(np.log(WINDOW_RATE_1_S))
        rate = [Quantity("rate", "1/s", median, WINDOW_RATE_LOG_SD, True)]
        delay = Quantity("delay", "s", 0.0, DELAY_SD_S)
        entries = [Quantity(f"a_{i}{j}", "1", 0.0, SENSOR_MATRIX_SD) for i in "xyz" for j in "xyz"]
        quantities = (*(rate if windowed else []), delay, *entries)
        first = [q.mean for q in quantities[:-9]]
        begin = [(*first, *(float(v) for v in (a - np.eye(3)).flat)) for a in starts]
        begin += [(*first[:-1], float(late), *np.zeros(9).tolist()) for late in late_s]
        return cls(sensor, quantities, windowed, tuple(begin))

    def starts(self) -> np.ndarray:
        """See `Effect.starts`."""
        return np.array(self.begin)

    def rate(self, psi: np.ndarray) -> float | None:
        """See `Effect.rate`."""
        return float(np.exp(psi[0])) if self.windowed else None

    def matrix(self, psi: np.ndarray) -> np.ndarray:
        """The sensor's matrix A (3, 3) at ψ."""
        return np.eye(3) + psi[-9:].reshape(3, 3)

    def transfer(self, setting: Setting, psi: np.ndarray) -> Transfer:
        """See `Effect.transfer`."""
        s = setting.s
        late = np.exp(-s * psi[-10])
        matrix = self.matrix(psi)
        left = matrix[None, :, :, None] * late[:, None, None]
        slope = np.zeros((len(s), 10, 3, 3, s.shape[1]), dtype=complex)
        slope[:, 0] = -s[:, None, None] * left
        for k in range(9):
            slope[:, 1 + k, k // 3, k % 3] = late
        return Transfer.of_sensor(setting, self.at, left, slope)
