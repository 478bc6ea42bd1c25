"""Elastic degrees of freedom that the simulation lacks: what base, bearings and links share."""

from dataclasses import dataclass, replace
from typing import Any, Self

import msgspec
import numpy as np

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.places import damping_time, movable, with_blocks
from planner.diagnosis.thresholds import FURTHER_DAMPING_FACTOR, LOSS_FACTOR_FACTOR
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import KINDS, Priors, place_name
from planner.robot.config import BASE, Compliance, Payload
from planner.robot.massless_base import massless_base


@dataclass(frozen=True)
class Give:
    """One degree of freedom: rotation about an axis, or shift along it, of stiffness in a range."""

    axis: tuple[float, float, float]
    lower: float
    upper: float
    slide: bool = False

    @property
    def median(self) -> float:
        """Of a log-uniform prior."""
        return float(np.sqrt(self.lower * self.upper))


@dataclass(frozen=True)
class ExtraCompliance(Effect):
    """Further degrees of freedom of `joint` (a joint, a link, the base)."""

    joint: str = ""
    gives: tuple[Give, ...] = ()

    def structure(self, simulation: Simulation) -> Simulation:
        """The simulation with one more [[compliance]] block for each spring."""
        blocks = self.blocks(damping_time(simulation))
        return with_blocks(simulation, blocks, self._carried(simulation))

    def _carried(self, simulation: Simulation) -> tuple[Payload, ...]:
        return massless_base(simulation.robot) if self.joint == BASE and self.gives else ()

    def blocks(self, time: float) -> tuple[Compliance, ...]:
        """At the prior's median; damping is `time` in s by stiffness."""
        return tuple(
            Compliance(self.joint, g.axis, g.median, time * g.median, slide=g.slide)
            for g in self.gives
        )

    def _movable(self, simulation: Simulation) -> Self:
        """Without what moves nothing that springs of robot.toml do not move already."""
        blocks = self.blocks(damping_time(simulation))
        kept = movable(simulation, blocks)
        gives = (g for g, b in zip(self.gives, blocks, strict=True) if b in kept)
        return replace(self, gives=tuple(gives))

    def priors(self, simulation: Simulation, priors: Priors) -> Priors:
        """Log-uniform ones of the new springs' stiffness, damping and loss factor."""
        time, bounds = damping_time(simulation), dict(priors.bounds)
        there = {place_name(b): b for b in simulation.robot.config.compliance}
        for give, block in zip(self.gives, self.blocks(time), strict=True):
            place = place_name(block)
            bounds[f"stiffness of {place}"] = (give.lower, give.upper)
            if there[place].damping:
                further = FURTHER_DAMPING_FACTOR
                least, most = give.lower * time / further, give.upper * time * further
                bounds[f"damping of {place}"] = least, most
            if median := there[place].loss_factor:
                further = FURTHER_DAMPING_FACTOR * LOSS_FACTOR_FACTOR
                bounds[f"loss_factor of {place}"] = median / further, median * further
        return replace(priors, bounds=bounds)

    def springs(self, simulation: Simulation) -> tuple[str, ...]:
        """Stiffness, damping and loss factor of each new degree of freedom."""
        places = [place_name(b) for b in self.blocks(1.0)]
        lossy = any(b.loss_factor > 0 for b in simulation.robot.config.compliance)
        kinds = KINDS if lossy else KINDS[:2]
        return tuple(f"{kind} of {p}" for p in places for kind in kinds)

    def elements(
        self, simulation: Simulation, values: dict[str, tuple[float, float, str]]
    ) -> dict[str, list[dict[str, Any]]]:
        """See `Effect.elements`."""
        blocks = []
        for block in self.blocks(1.0):
            place = place_name(block)
            entry = {"joint": block.joint, "axis": list(block.axis), "slide": block.slide}
            entry |= {k: values.get(f"{k} of {place}", (0.0, 0.0, ""))[0] for k in KINDS}
            blocks.append(entry)
        carried = [msgspec.structs.asdict(block) for block in self._carried(simulation)]
        return {"compliance": blocks} | ({"payload": carried} if carried else {})


def told(values: dict[str, tuple[float, float, str]]) -> str:
    """The stiffnesses in words."""
    names = {n: v for n, v in values.items() if n.startswith("stiffness")}
    return ", ".join(
        f"{v:.2g} ± {sd:.1g} {u} {n.split(' ', 3)[-1]}" for n, (v, sd, u) in names.items()
    )


def triple(axis: np.ndarray) -> tuple[float, float, float]:
    """The numbers of a vector (3,)."""
    x, y, z = (float(a) for a in axis)
    return x, y, z


def across(axis: np.ndarray) -> np.ndarray:
    """(2, 3): two unit vectors normal to a unit vector (3,) and to each other."""
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(axis, first)])
