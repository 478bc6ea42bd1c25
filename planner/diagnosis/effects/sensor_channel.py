"""What can be wrong with a channel of the sensor: gain, polarity, delay."""

from dataclasses import dataclass

import numpy as np

from planner.diagnosis.effects.effect import Effect, Quantity, Setting, Transfer
from planner.diagnosis.thresholds import ALONE_DELAY_SD_S, ALONE_GAIN_LOG_SD, USUAL
from planner.dynamics.simulation import Simulation
from planner.measurement.nuisances import Tolerances
from planner.recording.points import SENSOR

AXES = "xyz"


@dataclass(frozen=True)
class SensorGain(Effect):
    """One channel too large or too small: calibration, range."""

    name = "sensor_gain"
    artefact = True

    @classmethod
    def everywhere(
        cls, simulation: Simulation, sensors: tuple[str, ...] = (SENSOR,)
    ) -> tuple["SensorGain", ...]:
        """One effect for each channel."""
        gain = Quantity("gain", "1", 0.0, ALONE_GAIN_LOG_SD, True)
        return tuple(cls(at, (gain,)) for at in _channels(simulation, sensors))

    def transfer(self, setting: Setting, psi: np.ndarray) -> Transfer:
        """diag(1, …, g, …, 1)."""
        axis, gain = AXES.index(self.at[-1]), float(np.exp(psi[0]))
        left, slope = _ones(setting.s), np.zeros((len(setting.s), 1, 3, 3, setting.s.shape[1]))
        left[:, axis, axis] = gain
        slope[:, 0, axis, axis] = gain
        return Transfer.of_sensor(setting, self.at[:-2], left, slope)

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        value, sd, _ = values["gain"]
        return (
            f"Channel {self.at} shows {value:.3g} ± {sd:.1g} times what it should: check its "
            f"calibration."
        )

    def usual(self, values: dict[str, tuple[float, float, str]], t: Tolerances) -> bool:
        """See `Effect.usual`."""
        return abs(np.log(values["gain"][0])) < USUAL * t.gain


@dataclass(frozen=True)
class Polarity(Effect):
    """One channel has the wrong sign."""

    name = "polarity"
    artefact = True

    @classmethod
    def everywhere(
        cls, simulation: Simulation, sensors: tuple[str, ...] = (SENSOR,)
    ) -> tuple["Polarity", ...]:
        """One effect for each channel."""
        return tuple(cls(at) for at in _channels(simulation, sensors))

    def transfer(self, setting: Setting, psi: np.ndarray) -> Transfer:
        """diag(1, …, −1, …, 1)."""
        axis, left = AXES.index(self.at[-1]), _ones(setting.s)
        left[:, axis, axis] = -1.0
        none = np.zeros((len(left), 0, 3, 3, left.shape[-1]))
        return Transfer.of_sensor(setting, self.at[:-2], left, none)

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        return f"Channel {self.at} has the wrong sign: check mounting and wiring."


@dataclass(frozen=True)
class ChannelDelay(Effect):
    """All responses late against the force: e^(−sτ)."""

    name = "channel_delay"
    artefact = True

    @classmethod
    def everywhere(cls, simulation: Simulation) -> tuple["ChannelDelay", ...]:
        """The effect at the sensor, whose channels share one delay."""
        return (cls("sensor", (Quantity("delay", "s", 0.0, ALONE_DELAY_SD_S),)),)

    def transfer(self, setting: Setting, psi: np.ndarray) -> Transfer:
        """e^(−sτ) times the identity."""
        late = np.exp(-setting.s * psi[0])
        left = _ones(setting.s, setting.layout.shape[0]) * late[:, None, None]
        slope = -setting.s[:, None, None] * left
        return Transfer(left, slope[:, None])

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        value, sd, _ = values["delay"]
        return (
            f"The responses come {1e3 * value:.3g} ± {1e3 * sd:.1g} ms after the force: check "
            f"filters and sampling of the channels."
        )

    def usual(self, values: dict[str, tuple[float, float, str]], t: Tolerances) -> bool:
        """See `Effect.usual`."""
        return abs(values["delay"][0]) < USUAL * t.delay_s


def _ones(s: np.ndarray, size: int = 3) -> np.ndarray:
    shape = len(s), size, size, s.shape[1]
    return np.broadcast_to(np.eye(size)[None, :, :, None], shape).astype(complex)


def _channels(simulation: Simulation, sensors: tuple[str, ...]) -> list[str]:
    """Places "sensor_x" and so on of all axes that the sensors have."""
    axes = simulation.robot.points.axes_of
    return [f"{sensor}_{axis}" for sensor in sensors for axis in axes(sensor)]
