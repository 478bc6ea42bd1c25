"""The low fidelity of a campaign: the simulation as it stands, or as the recordings teach it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.errors import InputError
from planner.frf.types import Frf
from planner.identify.identify import QUICK, identify
from planner.identify.parameters import Priors
from planner.identify.result import Identification
from planner.identify.uncertainty import frequency_sd
from planner.physics.dynamics import SimulatedModes
from planner.physics.simulation import Simulation

# CAD masses and moments are right to 5 %, centres of mass to 1 cm.
PRIORS = Priors(mass=0.05, inertia=0.05, com_m=0.01)
# Misfit (χ² per value) from which the simulation is suspected to lack physics, so that what it
# says of a pose is tested by identifying it without that pose; into so many parts at most.
SUSPECT, FOLDS = 3.0, 2
ROUGH = replace(QUICK, last_lines=40, last_completions=0)  # beside an error of a percent
RIGHT = 0.003  # of ln f: what is left where the simulation explains the recordings


@dataclass(frozen=True, eq=False)
class LowFidelity:
    """What the simulation says at any pose; None: the campaign uses none.

    `left_out` (n, count) is what simulations that were identified without a pose say of its
    natural frequencies (Hz), NaN where that was not asked.
    """

    count: int
    nominal: Simulation | None
    identified: Identification | None = None
    left_out: np.ndarray | None = None
    suspect: "LowFidelity | None" = None  # what was identified and then found worse than nominal

    @property
    def simulation(self) -> Simulation | None:
        """The identified simulation where there is one."""
        return self.identified.simulation if self.identified else self.nominal

    def simulate(self, q: np.ndarray, more: int = 0) -> SimulatedModes:
        """Simulated modes of poses q (n, dof) in rad; NaN without a simulation.

        As many as the campaign models, and `more` above them.
        """
        count = self.count + more
        if self.simulation is None:
            empty = np.full((len(q), count), np.nan)
            residue = np.full((len(q), count, 3, 3), np.nan + 0j)
            return SimulatedModes(empty, empty, residue)
        return self.simulation.modes(q, count)

    def discrepancy(self, measured_hz: np.ndarray) -> np.ndarray | None:
        """Size of ln f's error (count,) where the simulation was not fitted; None: not known.

        measured_hz (n, count), NaN where a mode was not found. Before a pose could be left out it
        is as uncertain as ever; a simulation that explains its recordings is nearly right.
        """
        if self.identified is None or len(measured_hz) < 2:
            return None
        if self.left_out is None:
            return np.full(self.count, RIGHT)
        error = np.log(measured_hz / self.left_out)
        known = np.isfinite(error)
        square = np.where(known, error, 0.0) ** 2
        # A prior observation keeps few errors that happen to be small from being trusted.
        return np.sqrt((RIGHT**2 + square.sum(axis=0)) / np.maximum(known.sum(axis=0), 1))

    @property
    def remark(self) -> str:
        """One sentence where the simulation cannot follow the recordings; empty where it can."""
        identified = self.identified or (self.suspect.identified if self.suspect else None)
        if identified is None or identified.misfit <= SUSPECT:
            return ""
        text = (
            f"Identified from the recordings, the simulation still misses them by "
            f"{np.sqrt(identified.misfit):.0f} times their noise: it lacks physics"
        )
        if self.suspect is not None:
            return f"{text}, so that it is used as robot.toml states it."
        return f"{text}, or its geometry is off."

    def frequency_sd(self, q: np.ndarray) -> np.ndarray:
        """Sd of ln f (n, count) that the identified parameters leave; 0 for a frozen simulation."""
        if self.identified is None or self.nominal is None:
            return np.zeros((len(q), self.count))
        priors = PRIORS if self.identified.nuisances else Priors()
        return frequency_sd(self.identified, self.nominal, priors, q, self.count)


def learn(
    before: LowFidelity, frfs: Sequence[Frf], q: np.ndarray, band_hz: tuple[float, float]
) -> LowFidelity:
    """The simulation identified again from the FRFs measured at q (n, dof) in rad.

    A function of its arguments alone, whatever was identified before: replays must agree.
    """
    nominal = before.nominal
    if nominal is None or not frfs:
        return before
    identified = _identified(nominal, frfs, q, band_hz)
    left_out = None
    if identified.misfit > SUSPECT and len(frfs) > 1:
        left_out = _left_out(nominal, identified, frfs, q, band_hz, before.count)
    return LowFidelity(before.count, nominal, identified, left_out)


def _identified(
    nominal: Simulation,
    frfs: Sequence[Frf],
    q: np.ndarray,
    band_hz: tuple[float, float],
) -> Identification:
    """With uncertain inertias; with springs alone where the inertias found are impossible.

    Inertias are strained beyond what a body can have where something else is missing.
    """
    try:
        found = identify(frfs, q, nominal, PRIORS, band_hz=band_hz, starts=1, effort=QUICK)
    except InputError:  # not even the mass matrix makes sense
        found = None
    if found is not None and possible(found.simulation):
        return found
    return identify(frfs, q, nominal, Priors(), band_hz=band_hz, starts=1, warm=found, effort=QUICK)


def possible(simulation: Simulation) -> bool:
    """Whether every body with mass could exist: its pseudo-inertia is positive definite.

    (Wensing, Kim & Slotine 2018, eq. 20.)
    """
    for m, x, y, z, xx, xy, yy, xz, yz, zz in simulation.elastic.inertia:
        if m == 0:
            continue
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        pseudo = np.empty((4, 4))
        pseudo[:3, :3] = np.trace(inertia) / 2 * np.eye(3) - inertia
        pseudo[:3, 3] = pseudo[3, :3] = x, y, z
        pseudo[3, 3] = m
        if not np.all(np.linalg.eigvalsh(pseudo) > 0):
            return False
    return True


def _left_out(
    nominal: Simulation,
    warm: Identification,
    frfs: Sequence[Frf],
    q: np.ndarray,
    band_hz: tuple[float, float],
    count: int,
) -> np.ndarray:
    out = np.full((len(frfs), count), np.nan)
    folds = min(len(frfs), FOLDS)
    for fold in range(folds):
        away = np.arange(len(frfs)) % folds == fold
        kept = [frf for frf, gone in zip(frfs, away, strict=True) if not gone]
        found = _again(nominal, warm, kept, q[~away], band_hz)
        out[away] = found.simulation.modes(q[away], count).frequency_hz
    return out


def _again(
    nominal: Simulation,
    warm: Identification,
    frfs: Sequence[Frf],
    q: np.ndarray,
    band_hz: tuple[float, float],
) -> Identification:
    """From fewer poses, starting where all of them led."""
    priors = PRIORS if warm.nuisances else Priors()
    try:
        return identify(
            frfs, q, nominal, priors, band_hz=band_hz, starts=1, warm=warm, effort=ROUGH
        )
    except InputError:
        return identify(frfs, q, nominal, Priors(), band_hz=band_hz, starts=1, effort=QUICK)
