"""What recordings taught a simulation: a structure, and its parameters."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from planner.dynamics.vibration import SimulatedModes
from planner.fit.departures import KNOWN, departures_text
from planner.fit.fitted import StructureFit
from planner.fit.frequency_uncertainty import frequency_sd
from planner.fit.posterior import RobotPosterior
from planner.fit.result import Estimate, Identification, as_identification
from planner.fit.visit_chains import other_chain
from planner.words import counted, significant

BEYOND = 2.0  # sds of the gains, from which their deviation is told
OTHER = 3.0  # the same of one pose's
# Poses from which a place is told as found: from one, neighbours imitate each other.
PLACED = 3
ABOVE, NOT_THERE = 2, 1.0  # modes that a wider structure may have beside; ln f of one that is none


@dataclass(frozen=True, eq=False)
class IdentifiedRobot:
    """What so many `poses` taught the simulation; `identified` says it in numbers of springs and
    bodies, effects held as they are."""

    posterior: RobotPosterior
    identified: Identification
    poses: int = PLACED
    wider: "IdentifiedRobot | None" = None
    names: tuple[str, ...] = ()

    @classmethod
    def of(cls, found: StructureFit, names: Sequence[str] = ()) -> "IdentifiedRobot":
        """From the structure that was found, at poses of these names."""
        posterior = RobotPosterior.of(found)
        wider = None if found.wider is None else cls.of(found.wider)
        poses = len(found.misfit.data.q)
        return cls(posterior, as_identification(posterior), poses, wider, tuple(names))

    @property
    def other_chains(self) -> tuple[str, ...]:
        """Poses whose recordings were made by another chain than all others', a sentence each."""
        t, found, told = self.posterior.tolerances, self.posterior.found, []
        for number, name in enumerate(self.names if self.poses >= PLACED else ()):
            size, turn, moved = other_chain(found, number)
            what = []
            if abs(np.log(size)) > OTHER * np.hypot(t.gain, t.force_gain):
                what.append(f"accelerations are {size:.2f} times as large for the same forces")
            if turn > OTHER * t.across:
                what.append(f"the sensor looks turned by {np.rad2deg(turn):.0f}°")
            if moved > OTHER * t.position_m:
                what.append(f"the sensor looks moved by {1e3 * moved:.0f} mm")
            if what:
                told.append(
                    f"Beside the other poses, at {name} {' and '.join(what)}: check sensitivities, "
                    f"the hammer's tip and how the sensor sat. The fit allows for it. Where it was "
                    f"a mistake, withdraw {name}, correct it, and import its hits again with "
                    f"--pose {name}b."
                )
        return tuple(told)

    def frequency_sd(self, q: np.ndarray, modes: SimulatedModes) -> np.ndarray:
        """Sd of ln f (n, count) of its `modes` at q (n, dof) in rad.

        By the numbers of the wider structure, and by how far its modes are from these.
        """
        if self.wider is None:
            return frequency_sd(self.posterior, q, modes)
        count = modes.frequency_hz.shape[1]
        every = self.wider.identified.simulation.frequencies(q, count + ABOVE)
        same, away = _same(every.frequency_hz, modes.frequency_hz)
        hertz, ratio = (
            np.take_along_axis(v, same, 1) for v in (every.frequency_hz, every.damping_ratio)
        )
        wider = SimulatedModes(hertz, ratio, modes.residue)
        return np.minimum(np.hypot(self.wider.frequency_sd(q, wider), away), NOT_THERE)

    def predicted(self, q: np.ndarray, frequency_hz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """FRFs (n, 3, 3, F) of the tool in m/s²/N at q (n, dof) in rad, and their sds.

        Of one pose, which many structures explain, with the wider one's sds and how far it is off.
        """
        mean, sd = self.posterior.predicted(q, frequency_hz)
        if self.wider is None or self.poses > 1:
            return mean, sd
        other, sd = self.wider.posterior.predicted(q, frequency_hz)
        return mean, np.hypot(sd, np.abs(other - mean))

    def frf_sd_percent(self, q: np.ndarray) -> tuple[float, float]:
        """Root mean square sd of FRFs at q (n, dof) in rad in % of them, and of it the scale's."""
        mean, sd = self.predicted(q, self.posterior.lines_hz)
        whole = float(np.linalg.norm(sd) / np.linalg.norm(mean))
        return 100 * whole, 100 * self.posterior.scale_sd

    @property
    def fits(self) -> bool:
        """Whether it explains the recordings."""
        return self.posterior.explains

    @property
    def stated(self) -> int:
        """How many springs, the first ones, robot.toml states."""
        return self.posterior.structure.prior.effect_library.stated

    @property
    def added(self) -> int:
        """How many it does not state."""
        return len(self.identified.simulation.robot.config.compliance) - self.stated

    @property
    def unstated(self) -> tuple[Estimate, ...]:
        """Springs that robot.toml does not state and that the recordings determine."""
        return tuple(
            e for e in self.identified.estimates
            if e.kind == "stiffness" and min(e.blocks) >= self.stated and e.log_sd < KNOWN
        )  # fmt: skip

    @property
    def scale(self) -> str:
        """What to say where recordings are larger or smaller than gains and masses allow."""
        off, allowed = self.posterior.chain_scale
        if abs(off) < BEYOND * allowed:
            return ""
        more = "larger" if off > 0 else "smaller"
        return (
            f"The recordings are {significant(100 * abs(off))} % {more} than the robot's FRFs, "
            f"though gains of sensor and hammer are stated to {significant(100 * allowed)} %: "
            f"check their sensitivities, and the masses in the URDF."
        )

    @property
    def departures(self) -> str:
        """What robot.toml may state wrongly; empty where the fit is near it."""
        p = self.posterior
        return departures_text(p.structure, p.x, p.sd)

    @property
    def words(self) -> str:
        """What the robot has that robot.toml does not state; empty where that is nothing."""
        found = " ".join(self.posterior.words)
        if not self.unplaced:
            return found and f"In the recordings, but not in robot.toml: {found}"
        if self.poses == 1:  # many sets of causes explain a single pose
            return self.unplaced
        of = "Together these explain both poses, as other sets of causes may"
        return f"{self.unplaced} {of}: {found}"

    @property
    def unplaced(self) -> str:
        """What to say where too few poses show that the robot differs from robot.toml, else ""."""
        if not self.posterior.words or self.poses >= PLACED:
            return ""
        return (
            f"The robot differs from what robot.toml states. From {counted(self.poses, 'pose')} "
            f"nothing tells where: repair nothing yet, and measure "
            f"{counted(PLACED - self.poses, 'more pose')}."
        )


def _same(every_hz: np.ndarray, hertz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which of all modes (n, more) those (n, k) are, in the same order, and how far off in ln f."""
    k = hertz.shape[1]
    choices = np.array(list(combinations(range(every_hz.shape[1]), k)))
    away = np.abs(np.log(every_hz[:, choices] / hertz[:, None]))
    away = np.where(np.isfinite(away), away, NOT_THERE)
    best = np.argmin(np.sum(away**2, axis=-1), axis=1)
    return choices[best], away[np.arange(len(best)), best]
