"""A mass on a link that the simulation does not know, or a payload stated too large."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from planner.dynamics.gradient import Impedance
from planner.effects.effect import (
    ACROSS,
    Gain,
    Motions,
    Operator,
    PosedBodies,
    Start,
    moving,
    nats_of,
    turning,
)

LEAST = 0.05  # of the mass's sd: a start needs some mass for its place to matter
FARTHEST = 2.0  # prior sds, of a start's mass; its place begins within one of where it is tried
TURNS = np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])  # (6, 6): a shape of rates of turn alone
CENTRE = ((0.0, 0.0, 0.0),)
AROUND = (*CENTRE, *map(tuple, np.vstack([np.eye(3), -np.eye(3)]).tolist()))


@dataclass(frozen=True)
class AddedMass(Operator):
    """A body of mass ψ₀ sds at a place (ψ₁..₃ sds about the link's centre of mass).

    Its moments of inertia are alike about all axes, by a radius of gyration e^ψ₄ in m.
    """

    joint: str = ""
    centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mass_kg: float = 1.0  # its sd
    size_m: float = 1.0  # sd of its place
    places: tuple[tuple[float, ...], ...] = CENTRE  # in sds, where it is looked for

    kind = "added_mass"
    absorbed = True

    def impedance(self, poses: PosedBodies, psi: np.ndarray) -> Impedance:
        """m s² (Jₚᵀ Jₚ + r² Jωᵀ Jω) at the place p, with the radius r."""
        place = np.array(self.centre_m) + self.size_m * psi[1:4]
        ports = np.concatenate([poses.carried(self.joint, place), poses.body(self.joint)[:, 3:]], 1)
        shapes = np.array([moving(np.eye(3)), *map(turning, ACROSS), TURNS])
        unit = self.mass_kg * poses.s**2
        moved = [((1 + k, self.size_m * psi[0] * unit),) for k in range(3)]
        about = np.exp(2 * psi[4]) * unit
        terms = (0, psi[0] * unit), (4, psi[0] * about)
        slopes = ((0, unit), (4, about)), *moved, ((4, 2 * psi[0] * about),)
        return Impedance(ports, shapes, terms, slopes)

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """By the columns of the mass and of its first moments, at the likeliest of some places."""
        places = map(np.array, self.places)
        return (max((self._start(motions, gain, place) for place in places), key=nats_of),)

    def _start(self, motions: Motions, gain: Gain, place: np.ndarray) -> Start:
        there = self.impedance(motions.poses, np.array([1.0, *place, self.mean[4]]))
        columns = motions.changed_by(there)[:, :4]
        nats, psi, moved = gain(columns, np.array([1.0, 0.7, 0.7, 0.7]))
        mass = float(np.clip(psi[0], -FARTHEST, FARTHEST))
        if abs(mass) < LEAST:
            mass = LEAST
        place = place + np.clip(psi[1:4] / mass, -1, 1)
        return Start(self, np.array([mass, *place, self.mean[4]]), nats, moved)

    def beside(self, psi: np.ndarray) -> tuple[np.ndarray, ...]:
        """See `Operator.beside`: far off, the first order may have even the sign wrong."""
        return (np.array([LEAST, 0.0, 0.0, 0.0, self.mean[4]]),)

    def inertia(self, psi: np.ndarray) -> tuple[str, np.ndarray]:
        """See `Operator.inertia`."""
        x, y, z = np.array(self.centre_m) + self.size_m * psi[1:4]
        r = np.exp(2 * psi[4])
        moments = [y * y + z * z + r, -x * y, x * x + z * z + r, -x * z, -y * z, x * x + y * y + r]
        return self.joint, self.mass_kg * psi[0] * np.array([1.0, x, y, z, *moments])

    def vanishing(self, psi: np.ndarray) -> np.ndarray:
        """See `Operator.vanishing`."""
        return -psi[:1]

    def parameters(
        self, values: Mapping[str, tuple[float, float]]
    ) -> dict[str, tuple[float, float, str]]:
        """See `Operator.parameters`."""
        mass, sd = values["mass"]
        out = {"mass": (self.mass_kg * mass, self.mass_kg * sd, "kg")}
        for axis, centre in zip("xyz", self.centre_m, strict=True):
            at, sd = values[f"position_{axis}"]
            out[f"position_{axis}"] = centre + self.size_m * at, self.size_m * sd, "m"
        return out

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        mass, sd = values["mass"]
        return (
            f"{self.at} carries {self.mass_kg * mass:.2g} ± {self.mass_kg * sd:.1g} kg that is not "
            f"stated: check what is mounted there."
        )
