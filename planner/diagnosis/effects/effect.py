"""An effect: a change of the simulation, its priors, Z, or the measured FRFs."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from planner.diagnosis.thresholds import ODDS_OF_NOTHING
from planner.dynamics.gradient import Impedance
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Priors
from planner.measurement.nuisances import Tolerances
from planner.recording.points import TOOL, Layout


@dataclass(frozen=True)
class Quantity:
    """A parameter of an effect: normal prior of the value, or of its logarithm."""

    name: str
    unit: str
    mean: float
    sd: float
    logarithmic: bool = False

    def value(self, psi: float) -> float:
        """In the unit, from the coordinate that is fitted."""
        return float(np.exp(psi)) if self.logarithmic else float(psi)

    def value_sd(self, psi: float, sd: float) -> float:
        """Sd in the unit, from that of the coordinate."""
        return sd * self.value(psi) if self.logarithmic else sd


@dataclass(frozen=True, eq=False)
class Setting:
    """Where an effect acts: n poses q (n, dof) in rad, lines s (n, F) in rad/s.

    `jacobians` (n, B, 6, e) are those of the bodies, in the order of `simulation.elastic.bodies`;
    FRFs are between the points of `layout`.
    """

    simulation: Simulation
    q: np.ndarray
    s: np.ndarray
    jacobians: np.ndarray
    layout: Layout = TOOL

    def body(self, joint: str) -> np.ndarray:
        """Jacobian (n, 6, e) of the link that a joint moves, linear part first."""
        return self.jacobians[:, self.simulation.elastic.bodies.index(joint)]


@dataclass(frozen=True, eq=False)
class Transfer:
    """FRF as measured = `left` (n, r, r, F) times the true one; `slope` (n, p, r, r, F)."""

    left: np.ndarray
    slope: np.ndarray

    @classmethod
    def of_sensor(
        cls, setting: Setting, sensor: str, left: np.ndarray, slope: np.ndarray
    ) -> "Transfer":
        """Of one sensor's `left` (n, 3, 3, F), all others being as they should; `slope` likewise.

        A sensor that is not there changes nothing.
        """
        layout = setting.layout
        if layout.sensors == (sensor,):
            return cls(left, slope)
        n, lines = setting.s.shape
        size = layout.shape[0]
        whole = np.zeros((n, size, size, lines), dtype=complex)
        whole[:, np.arange(size), np.arange(size)] = 1.0
        moved = np.zeros((n, slope.shape[1], size, size, lines), dtype=complex)
        if sensor in layout.sensors:
            at = 3 * layout.sensors.index(sensor)
            whole[:, at : at + 3, at : at + 3] = left
            moved[:, :, at : at + 3, at : at + 3] = slope
        return cls(whole, moved)


@dataclass(frozen=True)
class Effect:
    """An effect at a place. Each kind overrides what it changes.

    `springs` names the parameters of `priors` that belong to the effect: they are reported with
    `quantities`, the ones that it adds. `absorbed`: springs and inertias that are refitted can take
    its place, so that not only what FRFs lack without it says how much it matters.
    """

    at: str
    quantities: tuple[Quantity, ...] = field(default=())

    name = "none"
    artefact = False
    absorbed = False

    @property
    def prior(self) -> float:
        """Weight before any data: nothing is wrong as likely as all effects together."""
        return 1.0 if self.at else ODDS_OF_NOTHING

    def structure(self, simulation: Simulation) -> Simulation:
        """The simulation with further elastic degrees of freedom."""
        return simulation

    def priors(self, simulation: Simulation, priors: Priors) -> Priors:
        """Priors of the springs; `simulation` is the one that `structure` gave."""
        return priors

    def springs(self, simulation: Simulation) -> tuple[str, ...]:
        """Names of the springs' parameters that tell of the effect."""
        return ()

    def impedance(self, setting: Setting, psi: np.ndarray) -> tuple[Impedance, ...]:
        """What it adds to Z at its own parameters ψ (p,)."""
        return ()

    def transfer(self, setting: Setting, psi: np.ndarray) -> Transfer | None:
        """What it does to the measured FRFs."""
        return None

    def rate(self, psi: np.ndarray) -> float | None:
        """Decay rate in 1/s (its only parameter's exponential) by which it shifts s."""
        return None

    def starts(self) -> np.ndarray:
        """ψ (k, p) from which it is fitted."""
        return np.array([[q.mean for q in self.quantities]])

    def usual(self, values: dict[str, tuple[float, float, str]], t: Tolerances) -> bool:
        """Whether an artefact of these parameters lies within the tolerances of hits and chain."""
        return False

    def parts(self) -> "tuple[Effect, ...]":
        """The effects that act together; itself where it is one."""
        return (self,)

    def elements(
        self, simulation: Simulation, values: dict[str, tuple[float, float, str]]
    ) -> dict[str, list[dict[str, Any]]]:
        """What it adds to robot.toml: entries of the lists of an [[effects]] block, by list."""
        return {}

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """One or two plain sentences an engineer can act on."""
        told = ", ".join(f"{n} {v:.3g} ± {sd:.1g} {u}" for n, (v, sd, u) in values.items())
        return f"{self.name.replace('_', ' ')} at {self.at}: {told}."
