"""Artefacts of the measuring chain: factors on what the sensor hears. No physics of the robot."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from planner.effects.effect import ACROSS, Gain, Motions, Operator, Start

AXES = "xyz"
STEP_RAD = 1e-6  # of differences by a rotation's angles
DELAYS_S = np.linspace(-2e-3, 4e-3, 25)  # among which a start is looked for


@dataclass(frozen=True)
class SensorGain(Operator):
    """A channel is e^ψ times as sensitive as stated."""

    kind = "sensor_gain"
    absorbed = artefact = True

    def chain(self, s: np.ndarray, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `Operator.chain`."""
        own = np.zeros((3, 3))
        own[(AXES.index(self.at[-1]),) * 2] = np.exp(psi[0])
        whole = own + np.diag(np.diag(own) == 0)
        return whole[None, :, :, None], own[None, None, :, :, None]

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """By the median ratio of what is heard and what is expected, over that of the others."""
        channel = AXES.index(self.at[-1])
        ratio = np.abs(motions.measured) / np.maximum(np.abs(motions.accelerance), 1e-300)
        of = [np.median(np.log(np.maximum(ratio[:, k::3], 1e-12))) for k in range(3)]
        others = np.mean([v for k, v in enumerate(of) if k != channel])
        psi = np.array([np.clip(of[channel] - others, -2, 2)])
        column = np.zeros_like(motions.accelerance)[:, None]
        column[:, 0, channel::3] = motions.accelerance[:, channel::3]
        return (Start(self, psi, gain(column, self.sd)[0][0]),)

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        factor, sd = values["gain"]
        return (
            f"Channel {self.at[-1]} of the sensor reads {factor:.3g} ± {sd:.1g} times what is "
            "right: check its sensitivity and range."
        )


@dataclass(frozen=True)
class Polarity(Operator):
    """A channel has the other sign."""

    kind = "polarity"
    absorbed = artefact = True

    def chain(self, s: np.ndarray, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `Operator.chain`."""
        signs = np.where(np.arange(3) == AXES.index(self.at[-1]), -1.0, 1.0)
        return np.diag(signs)[None, :, :, None], np.zeros((0, 1, 3, 3, 1))

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        return f"Channel {self.at[-1]} of the sensor has the wrong sign: turn it round."


@dataclass(frozen=True)
class SensorRotation(Operator):
    """The sensor is turned by a rotation vector ψ (3,) in rad."""

    kind = "sensor_rotation"
    absorbed = artefact = True

    def chain(self, s: np.ndarray, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `Operator.chain`."""
        from scipy.spatial.transform import Rotation  # not needed between hits

        there = Rotation.from_rotvec(psi).as_matrix()
        steps = STEP_RAD * np.eye(3)
        slopes = [(Rotation.from_rotvec(psi + d).as_matrix() - there) / STEP_RAD for d in steps]
        return there[None, :, :, None], np.array(slopes)[:, None, :, :, None]

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """From where it is mounted as stated, and by the rotation that fits best (Procrustes)."""
        from scipy.spatial.transform import Rotation

        h, y = motions.accelerance, motions.measured
        size = np.sqrt(np.mean(np.abs(y) ** 2, axis=(1, 2), keepdims=True)) + 1e-300
        rows = [(a / size).reshape(len(a), -1, 3, *a.shape[2:]) for a in (h, y)]
        both = np.einsum("nmicf,nmjcf->ij", rows[1], rows[0].conj()).real
        u, _, v = np.linalg.svd(both)
        turned = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
        psi = Rotation.from_matrix(turned).as_rotvec()
        shape = (len(h), h.shape[1] // 3, 3, *h.shape[2:])
        columns = [np.einsum("ij,nmjcf->nmicf", a.T, h.reshape(shape)) for a in ACROSS]
        [(nats, small)] = gain(np.stack([c.reshape(h.shape) for c in columns], 1), self.sd)
        return Start(self, psi, nats), Start(self, small, nats)

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        angle = np.degrees(np.sqrt(sum(v**2 for v, _ in values.values())))
        return f"The sensor is turned by {angle:.3g}° against robot.toml: check how it is mounted."


@dataclass(frozen=True)
class ChannelDelay(Operator):
    """The accelerations come ψ s late."""

    kind = "channel_delay"
    absorbed = artefact = True

    def chain(self, s: np.ndarray, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `Operator.chain`."""
        late = np.exp(-s * psi[0])[:, None, None] * np.eye(3)[..., None]
        return late, (-s[:, None, None] * late)[None]

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """By the delay that brings the phases closest."""
        cross = motions.measured * motions.accelerance.conj()
        cross /= np.maximum(np.abs(cross), 1e-300)
        s = motions.poses.s[:, None, None]
        fits = [float(np.sum(cross * np.exp(s * delay)).real) for delay in DELAYS_S]
        column = (-s * motions.accelerance)[:, None]
        psi = np.array([DELAYS_S[int(np.argmax(fits))]])
        return (Start(self, psi, gain(column, self.sd)[0][0]),)

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        late, sd = (1e3 * v for v in values["delay"])
        return (
            f"The accelerations come {late:.3g} ± {sd:.1g} ms after the force: check filters and "
            "the trigger of both channels."
        )


ARTEFACTS = frozenset(
    {one.kind for one in (SensorGain, Polarity, SensorRotation, ChannelDelay)}
    | {"exponential_window"}
)
