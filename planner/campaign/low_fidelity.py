"""The low fidelity of a campaign: the simulation as it stands, or as the recordings teach it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from threadpoolctl import threadpool_limits

from planner.campaign.state import Measurement
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import SimulatedModes
from planner.effects.one_visit import of_one_visit
from planner.effects.parameters import CAD_INERTIAS
from planner.effects.table import EffectLibrary, diagnosed
from planner.fit.fitted import FitRecord
from planner.fit.identified_robot import PLACED, IdentifiedRobot
from planner.fit.search import Search
from planner.fit.structure import RobotPrior, exported
from planner.fit.trials import as_found
from planner.frf.frf import Frf
from planner.measurement.nuisances import Tolerances
from planner.surrogate.average import PRIOR_BELIEF

BELIEVED = 0.99  # in a simulation that fits the recordings
# Of ln f: what is left where the simulation explains the recordings, and where not, in shares of
# what is not explained of |H|: resonances of a few per cent of damping shift by so much of it.
RIGHT, DAMPING = 0.001, 0.05
# The same after one pose, when no other has shown yet whether the structure is the right one: 95 %
# intervals held 0.87 of the truths with RIGHT and hold 0.93 with this, on 30 robots of another
# engine (`tests/campaign/test_everyday_campaigns.py`).
UNCHECKED = 0.012
# Fewer poses tell neither the structure for sure, nor the scatter from visit to visit, nor, left
# out one by one, how far a simulation is off that lacks physics.
FEW_POSES = 5

Used = tuple[Measurement, ...]
# What was found of these measurements before, or is found now.
Recall = Callable[[Used, Callable[[], FitRecord]], FitRecord]
# FRFs of the first measurements, so many, without what the laws of this simulation do to hits.
Straighten = Callable[[Simulation, int], Sequence[Frf]]


@dataclass(frozen=True, eq=False)
class LowFidelity:
    """What the simulation says at any pose; None: the campaign uses none.

    What `tolerances` leave open of hits, measuring chain and readback is integrated out where it is
    identified.
    """

    count: int
    nominal: Simulation | None
    tolerances: Tolerances = field(default_factory=Tolerances)
    identified_robot: IdentifiedRobot | None = None
    rejected: IdentifiedRobot | None = None  # what was identified and then found worse than nominal

    @cached_property
    def prior(self) -> RobotPrior:
        """What is known before of everything that a robot may have; only with a simulation."""
        assert self.nominal is not None
        return RobotPrior(EffectLibrary.of(self.nominal, CAD_INERTIAS))

    @property
    def is_identified(self) -> bool:
        """Whether it was identified from the recordings and fits them to their noise."""
        return self.identified_robot is not None and self.identified_robot.fits

    @property
    def simulation(self) -> Simulation | None:
        """The identified simulation where there is one."""
        fit = self.identified_robot
        return fit.identified.simulation if fit else self.nominal

    def stood(self, q: np.ndarray) -> np.ndarray:
        """Where the joints stood at measured poses, stated as q (n, dof) in rad."""
        if self.identified_robot is None:
            return q
        belief = self.identified_robot.posterior
        return q + belief.structure.stood_off(belief.x, q)

    @property
    def of_other_robots(self) -> frozenset[str]:
        """Poses at which something was on the robot, or held it, that is not there elsewhere."""
        fit = self.identified_robot
        return fit.posterior.of_other_robots if fit else frozenset()

    @property
    def misread(self) -> tuple[str, ...]:
        """Where they stood elsewhere than is stated, or were heard otherwise, a sentence each."""
        fit = self.identified_robot
        return (*fit.posterior.misread, *fit.other_chains) if fit else ()

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

    def frequencies(self, q: np.ndarray) -> SimulatedModes:
        """The same without residues, for many poses."""
        if self.simulation is None:
            return self.simulate(q)
        return self.simulation.frequencies(q, self.count)

    @property
    def discrepancy(self) -> np.ndarray | None:
        """Size of ln f's error (count,) where the simulation was not fitted; None: not known."""
        fit = self.identified_robot
        if fit is None or not fit.fits:
            return None
        right = RIGHT if fit.poses > 1 else UNCHECKED
        return np.full(self.count, right + DAMPING * fit.posterior.size)

    @property
    def misfit_sds(self) -> float:
        """By how many sds of their noise it misses the recordings; 0 where it explains them."""
        fit = self.identified_robot or self.rejected
        if fit is None or fit.fits:
            return 0.0
        return float(np.sqrt(fit.identified.misfit))

    @property
    def remark(self) -> str:
        """What the engineer should know of the simulation; empty where it follows as stated."""
        fit = self.identified_robot or self.rejected
        if fit is None:
            return ""
        if fit.fits:
            return " ".join(filter(None, (*self.misread, fit.scale, fit.words, fit.departures)))
        return self.caution

    @property
    def caution(self) -> str:
        """What who uses its predictions must know before; empty where it explains the recordings.

        Of few poses, which tell that it was wrong but not where, too.
        """
        fit = self.identified_robot or self.rejected
        if fit is None or fit.fits:
            return fit.unplaced if fit else ""
        text = (
            f"Fitted to the recordings, the simulation still differs from them by "
            f"{self.misfit_sds:.2g} times their noise: it lacks physics"
        )
        if fit.poses > 1:
            text += ", or files or angles of a pose are not its own"
        if self.identified_robot is None:
            how = "the campaign goes on without it"
            if self.nominal is not None:
                how = "the campaign uses it unfitted, with the values of robot.toml"
            return f"{text}; {how}."
        return f"{text}; or its geometry is off."

    @property
    def belief(self) -> float:
        """Probability that it is of use, by the FRFs: a whole matrix of them is hard to fit."""
        return BELIEVED if self.is_identified else PRIOR_BELIEF

    def frequency_sd(self, q: np.ndarray, simulated: SimulatedModes) -> np.ndarray:
        """Sd of ln f (n, count) that the identified parameters leave; 0 for a frozen simulation.

        `simulated` are the simulation's modes at q (n, dof) in rad.
        """
        if self.identified_robot is None:
            return np.zeros((len(q), self.count))
        return self.identified_robot.frequency_sd(q, simulated)


def identify_low_fidelity(
    before: LowFidelity,
    frfs: Sequence[Frf],
    q: np.ndarray,
    band_hz: tuple[float, float],
    used: Used = (),
    recall: Recall = lambda used, find: find(),
    straighten: Straighten | None = None,
) -> LowFidelity:
    """The simulation identified from the FRFs measured at n poses, at least one, q (n, dof) in rad.

    They may be between any points. Where the measurements in use are named, what is found of n
    begins where that of the first 1, 2, 3, 4, 6, 8, 12, … led: it is a function of the measurements
    in their order alone, whatever was computed before, and each step costs little. FRFs are those
    that `straighten` gives by what was found before, if it is given; measurements are named then.
    """
    nominal = before.nominal
    assert nominal is not None
    prior, others = before.prior, diagnosed(nominal)

    def search(count: int, known: FitRecord | None) -> Search:
        first, few = frfs[:count], count < FEW_POSES
        if straighten is not None:
            first = straighten(exported(*as_found(prior, known))[0] if known else nominal, count)
        poses = [m.pose for m in used[:count]] if count >= PLACED else []
        read = of_one_visit(nominal.robot, q[: len(poses)], poses, others)
        return Search(
            prior, tuple(first), q[:count], band_hz, before.tolerances, widen=few, readings=read
        )

    def found(count: int) -> FitRecord:
        def find() -> FitRecord:
            fewer = _fewer(count)
            known = found(fewer) if fewer else None
            if straighten is not None:  # by what is found of hits without laws by the fit before
                known = replace(search(count, known), widen=False).found(known).remembered
            return search(count, known).found(known).remembered

        return recall(used[:count], find)

    with threadpool_limits(1):
        known = found(len(used)) if used else None
        whole = search(len(frfs), known)
        last = whole.found() if known is None else whole.recalled(known)
        fit = IdentifiedRobot.of(last, [m.pose for m in used])
    return replace(before, identified_robot=fit)


def _fewer(count: int) -> int:
    """The largest of 1, 2, 3, 4, 6, 8, 12, … below a count; 0 below 2."""
    series = (n for k in range(count.bit_length()) for n in (2**k, 3 * 2**k // 2))
    return max((n for n in series if n < count), default=0)


def in_memory() -> Recall:
    """Recalls for as long as it is there itself."""
    kept: dict[Used, FitRecord] = {}

    return lambda used, find: kept[used] if used in kept else kept.setdefault(used, find())
