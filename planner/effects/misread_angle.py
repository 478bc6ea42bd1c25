"""A joint that stood elsewhere than its readback says at one of the poses measured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planner.effects.effect import Gain, Motions, Number, Operator, Start
from planner.recording.joints import SCALES, JointUnits
from planner.words import with_sd

MISREAD = 0.1, 0.05  # sd: rad of a joint that turns, m of one that slides; a mistyped digit


@dataclass(frozen=True)
class MisreadAngle(Operator):
    """Of a joint, number `number` from 0, at the pose stated as `q` (dof,) in rad or m."""

    joint: str = ""
    number: int = 0
    q: tuple[float, ...] = ()
    pose: str = ""
    slides: bool = False

    kind = "misread_angle"
    artefact = True

    def stood_off(self, q: np.ndarray, psi: np.ndarray) -> np.ndarray:
        """(n, dof) in rad or m: by how much joints stood beside their readback q (n, dof)."""
        off = np.zeros(q.shape)
        off[self._among(q), self.number] = psi[0]
        return off

    def _among(self, q: np.ndarray) -> slice:
        """Where its pose is; nowhere in other data."""
        same = np.all(q == np.array(self.q), axis=1)
        row = int(np.argmax(same))
        return slice(row, row + int(same[row]))

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """By its column."""
        assert motions.by_angle is not None
        here = self._among(motions.poses.readback)
        [(nats, psi)] = gain(motions.by_angle[here, self.number, None], self.sd, here)
        return (Start(self, psi, nats),)

    def vanishing(self, psi: np.ndarray) -> np.ndarray:
        """See `Operator.vanishing`."""
        return -psi

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        scale, unit = (SCALES["mm"], " mm") if self.slides else (SCALES["deg"], "°")
        stated = scale * self.q[self.number]
        off, sd = (scale * v for v in values["angle"])
        return (
            f"At {self.pose} {self.joint} stood at {with_sd(stated + off, sd)}{unit}, not at "
            f"{stated:.2f}{unit} as stated: look it up. If it was misread, withdraw {self.pose}, "
            f"correct the angle in its recordings.csv, and import its hits again with --pose "
            f"{self.pose}b."
        )


def misread_angles(
    joints: JointUnits, q: np.ndarray, poses: Sequence[str]
) -> tuple[MisreadAngle, ...]:
    """Every joint at every pose q (n, dof) in rad or m, by the poses' names."""
    found = []
    for pose, row in zip(poses, q.tolist(), strict=True):
        for k, (name, slides) in enumerate(zip(joints.names, joints.slides, strict=True)):
            number = Number("angle", "m" if slides else "rad", 0.0, MISREAD[slides])
            at = f"joint_{k + 1} of {pose}"
            found.append(MisreadAngle(at, (), (number,), name, k, tuple(row), pose, slides))
    return tuple(found)
