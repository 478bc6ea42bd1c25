"""A sensor that does not sit as stated."""

from dataclasses import dataclass

import numpy as np

from planner.diagnosis.effects.effect import Effect, Quantity, Setting, Transfer
from planner.diagnosis.thresholds import SENSOR_ROTATION_SD_DEG, USUAL
from planner.dynamics.simulation import Simulation
from planner.measurement.nuisances import Tolerances
from planner.recording.points import SENSOR


@dataclass(frozen=True)
class SensorRotation(Effect):
    """Turned about the sensor's z, then y, then x by small or large angles."""

    name = "sensor_rotation"
    artefact = True

    @classmethod
    def everywhere(
        cls, simulation: Simulation, sensors: tuple[str, ...] = (SENSOR,)
    ) -> tuple["SensorRotation", ...]:
        """The effect at each sensor."""
        sd = float(np.deg2rad(SENSOR_ROTATION_SD_DEG))
        angles = tuple(Quantity(f"angle_{a}", "rad", 0.0, sd) for a in "xyz")
        return tuple(cls(sensor, angles) for sensor in sensors)

    def transfer(self, setting: Setting, psi: np.ndarray) -> Transfer:
        """Rz Ry Rx at every line."""
        factors = [_turn(axis, psi[axis]) for axis in (2, 1, 0)]
        slopes = [_turn_slope(axis, psi[axis]) for axis in (2, 1, 0)]
        left = factors[0] @ factors[1] @ factors[2]
        by_axis = [
            factors[0] @ factors[1] @ slopes[2],
            factors[0] @ slopes[1] @ factors[2],
            slopes[0] @ factors[1] @ factors[2],
        ]
        n, f = setting.s.shape
        return Transfer.of_sensor(
            setting,
            self.at,
            np.broadcast_to(left[None, :, :, None], (n, 3, 3, f)),
            np.broadcast_to(np.array(by_axis)[None, :, :, :, None], (n, 3, 3, 3, f)),
        )

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        told = ", ".join(f"{np.rad2deg(v):.1f}°" for v, _, _ in values.values())
        which = "The sensor" if self.at == SENSOR else f"The sensor at {self.at}"
        return f"{which} is turned by {told} about its x, y and z axes: check how it sits."

    def usual(self, values: dict[str, tuple[float, float, str]], t: Tolerances) -> bool:
        """See `Effect.usual`."""
        angle = np.linalg.norm([value for value, _, _ in values.values()])
        return bool(angle < USUAL * t.mounting_rad)


def _turn(axis: int, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out = np.eye(3)
    out[i, i] = out[j, j] = c
    out[i, j], out[j, i] = -s, s
    return out


def _turn_slope(axis: int, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out = np.zeros((3, 3))
    out[i, i] = out[j, j] = -s
    out[i, j], out[j, i] = -c, c
    return out
