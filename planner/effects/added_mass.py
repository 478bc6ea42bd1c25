"""A mass on a link that the simulation does not know, or a payload stated too large."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from planner.dynamics.gradient import Impedance
from planner.effects.effect import Gain, Motions, Operator, PosedBodies, Start, gain_of
from planner.effects.parameters import MOMENTS
from planner.robot.virtual_joints import inertia_basis
from planner.words import significant

LEAST = 0.05  # of the mass's sd: a start needs some mass for its place to matter
FARTHEST = 2.0  # prior sds, of a start's mass; its place begins within one of where it is tried
BELOW, AXES = np.tril_indices(3, -1), np.arange(3)
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
        """s² times its inertia, on what turns with the joint."""
        there, slopes = self._body(psi)
        every = np.tensordot(np.vstack([there, slopes]), inertia_basis(), 1)
        terms = [((number, poses.s**2),) for number in range(len(every))]
        return Impedance(poses.body(self.joint), every, terms[0], tuple(terms[1:]))

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """By the columns of the mass and of its first moments, at the likeliest of some places."""
        places = map(np.array, self.places)
        return (max((self._start(motions, gain, place) for place in places), key=gain_of),)

    def _start(self, motions: Motions, gain: Gain, place: np.ndarray) -> Start:
        there = self.impedance(motions.poses, np.array([1.0, *place, *self.mean[4:]]))
        columns = motions.changed_by(there)[:, :4]
        [(nats, psi)] = gain(columns, np.array([1.0, 0.7, 0.7, 0.7]))
        mass = float(np.clip(psi[0], -FARTHEST, FARTHEST))
        if abs(mass) < LEAST:
            mass = LEAST
        place = place + np.clip(psi[1:4] / mass, -1, 1)
        return Start(self, np.array([mass, *place, *self.mean[4:]]), nats)

    def moved_to(self, found: Operator, psi: np.ndarray, motions: Motions, gain: Gain) -> Start:
        """The same matter on another link: springs that move both feel it as they did."""
        matter = found.inertia(psi)
        assert matter is not None
        here, there = (motions.poses.body(joint) for joint in (self.joint, matter[0]))
        both = np.any(here, axis=(0, 1)) & np.any(there, axis=(0, 1))
        columns, felt = (
            np.einsum("nae,kab,nbf->nefk", j, inertia_basis(), j, optimize=True).reshape(-1, 10)
            for j in (here[..., both], there[..., both])
        )
        same = self.of_matter(np.linalg.lstsq(columns, felt @ matter[1], rcond=None)[0])
        return self.starts(motions, gain)[0] if same is None else Start(self, same, 0.0)

    def of_matter(self, inertia: np.ndarray) -> np.ndarray | None:
        """See `Operator.of_matter`: with moments that matter can have."""
        if abs(inertia[0]) < LEAST * self.mass_kg:
            return None
        mass, place = inertia[0], inertia[1:4] / inertia[0]
        moments = np.empty((3, 3))
        for value, (i, j) in zip(inertia[4:] / mass, MOMENTS, strict=True):
            moments[i, j] = moments[j, i] = value
        second = 0.5 * np.trace(moments) * np.eye(3) - moments - np.outer(place, place)
        # As flat as the prior has it, at least.
        least = np.exp(2 * float(np.min(self.mean[4:7] - 2 * self.sd[4:7])))
        square, along = np.linalg.eigh(second)
        root = np.linalg.cholesky((along * np.maximum(square, least)) @ along.T)
        d = np.diag(root)
        place = (place - self.centre_m) / self.size_m
        return np.array([mass / self.mass_kg, *place, *np.log(d), *(root / d[:, None])[BELOW]])

    def beside(self, psi: np.ndarray) -> tuple[np.ndarray, ...]:
        """See `Operator.beside`: far off, the first order may have even the sign wrong."""
        return (np.array([LEAST, 0.0, 0.0, 0.0, *self.mean[4:]]),)

    def inertia(self, psi: np.ndarray) -> tuple[str, np.ndarray, np.ndarray] | None:
        """See `Operator.inertia`."""
        return self.joint, *self._body(psi)

    def _body(self, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Inertia (10,) about the joint's frame: kg, kg·m, kg·m²; and its slopes (10, 10) by ψ."""
        place = np.array(self.centre_m) + self.size_m * psi[1:4]
        d, u = np.exp(psi[4:7]), np.eye(3)
        u[BELOW] = psi[7:]
        root, roots = d[:, None] * u, np.zeros((6, 3, 3))
        roots[AXES, AXES] = root
        roots[AXES + 3, BELOW[0], BELOW[1]] = d[BELOW[0]]
        whole = _inertia(np.ones(1), place[None], (np.outer(place, place) + root @ root.T)[None])[0]
        step, none = self.size_m * np.eye(3), np.zeros(3)
        moved = step[:, :, None] * place + place[:, None] * step[:, None]
        spread = roots @ root.T
        slopes = np.vstack(
            [
                whole[None],
                psi[0] * _inertia(none, step, moved),
                psi[0] * _inertia(np.zeros(6), np.zeros((6, 3)), spread + spread.swapaxes(1, 2)),
            ]
        )
        return self.mass_kg * psi[0] * whole, self.mass_kg * slopes

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


def _inertia(mass: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(k, 10) as Pinocchio has it, of mass (k,), ∫ρ x (k, 3) and ∫ρ x xᵀ (k, 3, 3)."""
    moments = np.trace(second, axis1=1, axis2=2)[:, None, None] * np.eye(3) - second
    rows, columns = np.transpose(MOMENTS)
    return np.column_stack([mass, first, moments[:, rows, columns]])
