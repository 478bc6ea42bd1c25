"""Something loose on a link: a mass on a spring of its own (hose pack, bracket)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from planner.dynamics.gradient import Impedance
from planner.effects.effect import (
    ACROSS,
    Gain,
    Motions,
    Number,
    Operator,
    PosedBodies,
    Start,
    Values,
    gain_of,
    moving,
    turning,
)
from planner.effects.parameters import axis_name
from planner.robot.config import Resonator
from planner.words import listed, significant

LIGHTER = np.log(6.0)  # it is begun once more by so much
SCREENED = 30  # frequencies over the band
SCREEN_DAMPING = 0.04  # so that none falls between them
DIRECTION_SD = 0.5  # of a direction about the one it begins with: about 0 it shrinks to nothing
PLACED = (("direction", "1"), ("position", "m"))
NAMED = (("mass", "kg"), ("frequency", "Hz"), ("damping_ratio", "1"),
         *((f"{what}_{axis}", unit) for what, unit in PLACED for axis in "xyz"))  # fmt: skip
# Sds of a stated one's numbers: logarithms of the first three, direction, place in m; and the
# factor of its frequency from which it is another.
STATED, ANOTHER = (0.7, 0.2, 0.7, *(0.3,) * 3, *(0.1,) * 3), 5.0
SAME_SD = 2.0  # within which masses are one
PAIRS = tuple((i, k) for i in range(3) for k in range(i, 3))


@dataclass(frozen=True)
class LinkResonator(Operator):
    """A mass that slides along a direction of the link, held by spring and damper.

    ψ: ln mass, ln frequency, ln damping ratio, direction (3), place (3) in m.
    """

    joint: str = ""
    band_hz: tuple[float, float] = (1.0, 100.0)

    kind = "local_resonator"
    several = True

    def impedance(self, poses: PosedBodies, psi: np.ndarray) -> Impedance:
        """s² m Jₚᵀ [1 + (T − 1) d dᵀ] Jₚ with the transmissibility T of spring and damper."""
        mass, omega, zeta = np.exp(psi[0]), 2 * np.pi * np.exp(psi[1]), np.exp(psi[2])
        length = np.linalg.norm(psi[3:6]) + 1e-12
        d, s = psi[3:6] / length, poses.s
        below = s**2 + 2 * zeta * omega * s + omega**2
        above = 2 * zeta * omega * s + omega**2
        t = above / below
        # Derivatives of T with respect to ln ω and ln ζ.
        d_above = np.stack([2 * zeta * omega * s + 2 * omega**2, 2 * zeta * omega * s])
        t_slope = (d_above * below - above * d_above) / below**2
        turn, along = (np.eye(3) - np.outer(d, d)) / length, np.outer(d, d)
        shapes = [moving(np.eye(3)), moving(along)]
        shapes += [moving(np.outer(turn[v], d) + np.outer(d, turn[v])) for v in range(3)]
        shapes += [turning(one) for one in ACROSS]
        shapes += [turning(along @ one) for one in ACROSS]
        m = mass * s**2
        u = m * (t - 1)
        values = (0, m), (1, u)
        slope = [values, ((1, m * t_slope[0]),), ((1, m * t_slope[1]),)]
        slope += [((2 + v, u),) for v in range(3)]
        slope += [((5 + v, m), (8 + v, u)) for v in range(3)]
        ports = [poses.carried(self.joint, psi[6:9]), poses.body(self.joint)[:, 3:]]
        return Impedance(np.concatenate(ports, axis=1), np.array(shapes), values, tuple(slope))

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """The best of many frequencies; its direction and mass are the first order's."""
        low, high = self.band_hz
        tried = self.at_frequencies(np.geomspace(low * 1.1, high, SCREENED), motions, gain)
        return (max(tried, key=gain_of),)

    def at_frequencies(self, hertz: np.ndarray, motions: Motions, gain: Gain) -> list[Start]:
        """Where it begins at each: six columns, one for each pair of directions."""
        poses = motions.poses
        hit, sensor = motions.at(poses.carried(self.joint, self.mean[6:9]))
        pairs = [
            sensor[:, i][:, :, None] * hit[:, k][:, None]
            + (i != k) * sensor[:, k][:, :, None] * hit[:, i][:, None]
            for i, k in PAIRS
        ]
        s, omega = poses.s[:, None], 2 * np.pi * hertz[:, None]
        above = 2 * SCREEN_DAMPING * omega * s + omega**2
        shown = -(s**4) * above / (s**2 + above)
        columns = shown[:, :, None, None, None] * np.stack(pairs, axis=1)[:, None]
        usual = float(np.exp(self.mean[0]))
        sds = usual * np.array([1.0 if i == k else 0.5 for i, k in PAIRS])
        told = gain(columns.reshape(len(s), -1, *columns.shape[3:]), sds)
        return [self._start(f, *one) for f, one in zip(hertz, told, strict=True)]

    def _start(self, hertz: float, nats: float, psi: np.ndarray) -> Start:
        """Of the columns' likeliest factors (6,)."""
        usual, start = float(np.exp(self.mean[0])), self.mean.copy()
        dyad = np.zeros((3, 3))
        for value, (i, k) in zip(psi, PAIRS, strict=True):
            dyad[i, k] = dyad[k, i] = value
        sizes, ways = np.linalg.eigh(dyad)
        most = int(np.argmax(np.abs(sizes)))
        start[0] = np.log(np.clip(abs(sizes[most]), 0.2 * usual, 5 * usual))
        start[1], start[3:6] = np.log(hertz), ways[:, most]
        return Start(self.towards(ways[:, most]), start, nats)

    def moved_to(self, found: Operator, psi: np.ndarray, motions: Motions, gain: Gain) -> Start:
        """It keeps frequency and damping."""
        [begun] = self.at_frequencies(np.exp(psi[1:2]), motions, gain)
        return replace(begun, psi=np.array([*begun.psi[:2], psi[2], *begun.psi[3:]]))

    def beside(self, psi: np.ndarray) -> tuple[np.ndarray, ...]:
        """A light one, too: it changes little and can only help."""
        return (psi - LIGHTER * np.eye(psi.size)[0],)

    def towards(self, way: np.ndarray) -> "LinkResonator":
        """The same with its direction expected about `way` (3,)."""
        unit = way / np.linalg.norm(way)
        directed = tuple(
            Number(f"direction_{a}", "1", float(w), DIRECTION_SD)
            for a, w in zip("xyz", unit, strict=True)
        )
        return replace(self, numbers=(*self.numbers[:3], *directed, *self.numbers[6:]))

    @property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """See `Operator.box`: what swings outside the band is a mass, or nothing, to what is in."""
        low, high = super().box
        low[1], high[1] = np.log(self.band_hz)
        return low, high

    def vanishing(self, psi: np.ndarray) -> np.ndarray:
        """See `Operator.vanishing`."""
        return np.array([-1.0])  # of ln mass

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        return self.words_together([values])

    def same_thing(self, mine: Values, others: Values) -> bool:
        """One mass swings along several directions, as often as each of its springs has it."""
        (mass, sd), (other, other_sd) = mine["mass"], others["mass"]
        near = abs(mass - other) <= SAME_SD * np.hypot(sd, other_sd)
        return bool(near and abs(_way(mine) @ _way(others)) < np.sqrt(0.5))

    def words_together(self, each: Sequence[Values]) -> str:
        """See `Operator.words_together`."""
        mass, sd = np.array([values["mass"] for values in each]).T
        told = significant(float(np.average(mass, weights=sd**-2.0)))
        ways: dict[str, list[str]] = {}
        for values in each:
            hertz = f"{values['frequency'][0]:.1f} Hz"
            ways.setdefault(hertz, []).append(axis_name(_nearest_axis(_way(values))))
        at = [f"{hertz} along {listed(sorted(way))}" for hertz, way in sorted(ways.items())]
        at = at if len(each) > 1 else [*ways]
        return (
            f"Something of {told} kg on {self.at} has a resonance of its own at {listed(at)}: "
            f"check hose pack, brackets and covers there."
        )

    def tables(self, values: Mapping[str, tuple[float, float]]) -> dict[str, list[dict[str, Any]]]:
        """A [[resonator]]."""
        place, way = (
            np.array([values[f"{what}_{a}"][0] for a in "xyz"])
            for what in ("position", "direction")
        )
        block = {
            "joint": self.joint,
            "position_m": place.tolist(),
            "direction": (way / np.linalg.norm(way)).tolist(),
            "mass": values["mass"][0],
            "frequency_hz": values["frequency"][0],
            "damping_ratio": values["damping_ratio"][0],
        }
        return {"resonator": [block]}


def _way(values: Values) -> np.ndarray:
    way = np.array([values[f"direction_{axis}"][0] for axis in "xyz"])
    return way / np.linalg.norm(way)


def _nearest_axis(way: np.ndarray) -> tuple[float, float, float]:
    """An axis of the link, where a direction is within 30° of it; else the direction."""
    most = int(np.argmax(np.abs(way)))
    near = abs(way[most]) > np.cos(np.pi / 6)
    x, y, z = np.eye(3)[most] if near else np.round(way, 1) + 0.0
    return float(x), float(y), float(z)


def resonator_numbers(means: Sequence[float], sds: Sequence[float]) -> tuple[Number, ...]:
    """As `LinkResonator` has them, about means of ψ."""
    told = enumerate(zip(NAMED, means, sds, strict=True))
    return tuple(Number(*named, float(mean), sd, k < 3) for k, (named, mean, sd) in told)


@dataclass(frozen=True)
class StatedResonator(LinkResonator):
    """One of robot.toml's own, whose numbers are refitted as those of its springs are."""

    kind = "stated_resonator"
    stated = True

    @classmethod
    def of(cls, at: str, block: Resonator) -> "StatedResonator":
        """On a link, about the numbers that robot.toml has."""
        way = np.array(block.direction) / np.linalg.norm(block.direction)
        middle = *np.log([block.mass, block.frequency_hz, block.damping_ratio]), *way
        numbers = resonator_numbers((*middle, *block.position_m), STATED)
        hertz = block.frequency_hz
        return cls(at, (), numbers, block.joint, (hertz / ANOTHER, hertz * ANOTHER))
