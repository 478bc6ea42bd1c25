"""A mass on a link that the simulation does not know, or a payload stated too large."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from planner.dynamics.gradient import Impedance, Terms
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
from planner.effects.parameters import MOMENTS
from planner.words import significant

LEAST = 0.05  # of the mass's sd: a start needs some mass for its place to matter
FARTHEST = 2.0  # prior sds, of a start's mass; its place begins within one of where it is tried
BELOW = np.tril_indices(3, -1)
CENTRE = ((0.0, 0.0, 0.0),)
AROUND = (*CENTRE, *map(tuple, np.vstack([np.eye(3), -np.eye(3)]).tolist()))


@dataclass(frozen=True)
class AddedMass(Operator):
    """A body of mass ψ₀ sds at a place (ψ₁..₃ sds about the link's centre of mass).

    How its mass is spread about that, ∫ρ x xᵀ = m D U Uᵀ D in the link's frame, is whatever matter
    can be: D is diagonal (e^ψ₄..₆ in m), U triangular with ones (ψ₇..₉ in it).
    """

    joint: str = ""
    centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mass_kg: float = 1.0  # its sd
    size_m: float = 1.0  # sd of its place
    places: tuple[tuple[float, ...], ...] = CENTRE  # in sds, where it is looked for

    kind = "added_mass"
    absorbed = True

    def impedance(self, poses: PosedBodies, psi: np.ndarray) -> Impedance:
        """m s² (Jₚᵀ Jₚ + Jωᵀ I/m Jω) at the place p, with moments I about it."""
        place = np.array(self.centre_m) + self.size_m * psi[1:4]
        ports = np.concatenate([poses.carried(self.joint, place), poses.body(self.joint)[:, 3:]], 1)
        shapes = np.array([moving(np.eye(3)), *map(turning, ACROSS), *TURNS])
        unit = self.mass_kg * poses.s**2
        moved = [((1 + k, self.size_m * psi[0] * unit),) for k in range(3)]
        spread, by_number = _spread(psi[4:])

        def turned(change: np.ndarray, factor: float = 1.0) -> Terms:
            moments = np.trace(change) * np.eye(3) - change
            return tuple((4 + k, factor * moments[i, j] * unit) for k, (i, j) in enumerate(MOMENTS))

        terms = (0, psi[0] * unit), *turned(spread, psi[0])
        slopes = ((0, unit), *turned(spread)), *moved, *(turned(d, psi[0]) for d in by_number)
        return Impedance(ports, shapes, terms, slopes)

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """By the columns of the mass and of its first moments, at the likeliest of some places."""
        places = map(np.array, self.places)
        return (max((self._start(motions, gain, place) for place in places), key=nats_of),)

    def _start(self, motions: Motions, gain: Gain, place: np.ndarray) -> Start:
        there = self.impedance(motions.poses, np.array([1.0, *place, *self.mean[4:]]))
        columns = motions.changed_by(there)[:, :4]
        nats, psi, moved = gain(columns, np.array([1.0, 0.7, 0.7, 0.7]))
        mass = float(np.clip(psi[0], -FARTHEST, FARTHEST))
        if abs(mass) < LEAST:
            mass = LEAST
        place = place + np.clip(psi[1:4] / mass, -1, 1)
        return Start(self, np.array([mass, *place, *self.mean[4:]]), nats, moved)

    def beside(self, psi: np.ndarray) -> tuple[np.ndarray, ...]:
        """See `Operator.beside`: far off, the first order may have even the sign wrong."""
        return (np.array([LEAST, 0.0, 0.0, 0.0, *self.mean[4:]]),)

    def inertia(self, psi: np.ndarray) -> tuple[str, np.ndarray]:
        """See `Operator.inertia`."""
        place = np.array(self.centre_m) + self.size_m * psi[1:4]
        spread = np.outer(place, place) + _spread(psi[4:])[0]
        moments = np.trace(spread) * np.eye(3) - spread
        about = [moments[i, j] for i, j in MOMENTS]
        return self.joint, self.mass_kg * psi[0] * np.array([1.0, *place, *about])

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
        at = (self.parameters(values)[f"position_{axis}"][0] for axis in "xyz")
        centre = ", ".join(f"{v:.2f}" for v in at)
        return (
            f"{self.at} carries {significant(self.mass_kg * mass)} ± "
            f"{significant(self.mass_kg * sd)} kg that is not stated, centred at ({centre}) m of "
            f"its frame: check what is mounted there."
        )


def _spread(psi: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """D U Uᵀ D in m², and its slopes by ψ (6,)."""
    d, u = np.exp(psi[:3]), np.eye(3)
    u[BELOW] = psi[3:]
    root = d[:, None] * u
    slopes = []
    for k in range(6):
        moved = np.zeros((3, 3))
        if k < 3:
            moved[k] = root[k]
        else:
            row, column = BELOW[0][k - 3], BELOW[1][k - 3]
            moved[row, column] = d[row]
        slopes.append(moved @ root.T + root @ moved.T)
    return root @ root.T, tuple(slopes)


def _about(i: int, j: int) -> np.ndarray:
    """(6, 6): a shape of rates of turn i and j alone, and its transpose."""
    out = np.zeros((6, 6))
    out[3 + i, 3 + j] = out[3 + j, 3 + i] = 1.0
    return out


TURNS = np.array([_about(i, j) for i, j in MOMENTS])
