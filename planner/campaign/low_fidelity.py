"""The low fidelity of a campaign: the simulation as it stands, or as the recordings teach it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.campaign.learned import PLACED, SUSPECT, Learned, lacking, likeliest
from planner.campaign.missing_physics import (
    BEST,
    SWINGS,
    with_loss_factors,
    with_springs,
    with_strayed_springs_again,
    with_swinging_mass,
)
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import SimulatedModes
from planner.frf import synthesis
from planner.frf.frf import Frf
from planner.identification.effort import QUICK, Effort
from planner.identification.extended_structure import ExtendedModel
from planner.identification.frequency_uncertainty import frequency_sd
from planner.identification.identify import identify
from planner.identification.measured_frfs import layout_of
from planner.identification.measurement_model import Tolerances
from planner.identification.parameters import CAD_INERTIAS, Priors
from planner.identification.result import Identification
from planner.surrogate.hedged import PRIOR_BELIEF

# Where hits count as exact: masses and moments are right to 5 %, centres of mass to 1 cm.
OF_EXACT_HITS = Priors(mass=0.05, inertia=0.05, com_m=0.01)
# Misfit from which the simulation is suspected to lack physics where hits count as exact. Where
# springs that robot.toml does not state do not mend that, what it says of a pose is tested by
# identifying it without that pose; into so many parts at most.
EXACT_SUSPECT, FOLDS = 3.0, 2
BELIEVED = 0.99  # in a simulation that fits the recordings to their noise
RIGHT = 0.003  # of ln f: what is left where the simulation explains the recordings
LINES, LOG_LINES, LAST_LINES = 180, 150, 300  # of all poses together: nobody waits between hits
FEWEST = 12  # of them a pose
# Misfit of what is stated from which it is followed to the end only if nothing that is added fits:
# twice what those may leave, by a search of as many steps as the last fit has.
HOPELESS = 2 * SWINGS
# Factor on it at PLACED poses and fewer, where what few hits leave open leads through more
# than that. Looked at on starts 0 to 9 of the KR10 that lacks nothing (tests: fidelity_cells).
AMONG_FEW = 10.0
OPENINGS = 4  # rounds at most, in which what hits leave open follows the stated structure's fit


def _effort(frfs: Sequence[Frf]) -> Effort:
    """Lines a pose that keep the time about the same however many poses and sensors there are."""
    rows, columns = layout_of(frfs).shape
    of_all = len(frfs) * np.sqrt(rows * columns / 9)
    lines, log_lines, last = (int(n // of_all) for n in (LINES, LOG_LINES, LAST_LINES))
    return replace(
        QUICK,
        lines=max(FEWEST, min(QUICK.lines, lines)),
        log_lines=min(QUICK.log_lines, max(FEWEST, log_lines)),
        last_lines=max(20, min(QUICK.last_lines, last)),
        searched=LINES // FEWEST,
    )


@dataclass(frozen=True, eq=False)
class LowFidelity:
    """What the simulation says at any pose; None: the campaign uses none.

    What `tolerances` leave open of hits, measuring chain and readback is integrated out where it is
    identified; None: all are exact, as campaigns took them that began so.
    `left_out` (n, count) is what simulations that were identified without a pose say of its
    natural frequencies (Hz), NaN where that was not asked.
    """

    count: int
    nominal: Simulation | None
    tolerances: Tolerances | None = None
    learned: Learned | None = None
    left_out: np.ndarray | None = None
    suspect: Learned | None = None  # what was identified and then found worse than nominal

    @property
    def identified(self) -> Identification | None:
        """What was identified and is used."""
        return self.learned.identified if self.learned else None

    @property
    def priors(self) -> Priors:
        """What is known before anything is measured."""
        return OF_EXACT_HITS if self.tolerances is None else CAD_INERTIAS

    @property
    def taught(self) -> bool:
        """Whether it was identified from the recordings and fits them to their noise."""
        return self.learned is not None and self.learned.fits

    @property
    def simulation(self) -> Simulation | None:
        """The identified simulation where there is one."""
        return self.learned.identified.simulation if self.learned else self.nominal

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

    def above(self, q: np.ndarray, frequency_hz: np.ndarray) -> np.ndarray:
        """What modes above those modelled add to the accelerance, (n, 3, 3, F) in m/s²/N.

        0 unless the simulation was identified and fits: it is not known then.
        """
        if self.learned is None or not self.taught:
            return np.zeros((len(q), 3, 3, len(frequency_hz)), dtype=complex)
        simulation = self.learned.identified.simulation
        modes = simulation.modes(q, self.count)
        known = np.isfinite(modes.frequency_hz)
        pole = synthesis.pole(
            np.where(known, modes.frequency_hz, 1.0), np.where(known, modes.damping_ratio, 0.1)
        )
        residue = np.where(known[..., None, None], modes.residue, 0.0)
        below = synthesis.accelerance(frequency_hz, pole, residue)
        return simulation.accelerance(q, frequency_hz) - below

    def discrepancy(self, measured_hz: np.ndarray) -> np.ndarray | None:
        """Size of ln f's error (count,) where the simulation was not fitted; None: not known.

        measured_hz (n, count), NaN where a mode was not found. A simulation that explains its
        recordings is nearly right; another is as uncertain as ever before a pose was left out.
        """
        if self.learned is None:
            return None
        if self.learned.fits:
            return np.full(self.count, RIGHT * max(self.learned.identified.misfit, 1.0))
        if self.left_out is None:
            return None
        error = np.log(measured_hz / self.left_out)
        known = np.isfinite(error)
        square = np.where(known, error, 0.0) ** 2
        # A prior observation keeps few errors that happen to be small from being trusted.
        return np.sqrt((RIGHT**2 + square.sum(axis=0)) / np.maximum(known.sum(axis=0), 1))

    @property
    def misses(self) -> float:
        """By how many sds of their noise it misses the recordings; 0 where it explains them."""
        learned = self.learned or self.suspect
        if learned is None or learned.fits:
            return 0.0
        return float(np.sqrt(learned.identified.misfit))

    @property
    def remark(self) -> str:
        """What the engineer should know of the simulation; empty where it follows as stated."""
        learned = self.learned or self.suspect
        if learned is None:
            return ""
        swinging = learned.structure.swinging
        if learned.fits:
            more = lacking(learned.found, learned.poses) if learned.structure.added else ""
            return " ".join(filter(None, (swinging, more)))
        text = (
            f"Fitted to the recordings, the simulation still differs from them by "
            f"{self.misses:.2g} times their noise: it lacks physics"
        )
        if self.learned is None:
            how = "the campaign goes on without it"
            if self.nominal is not None:
                how = "the campaign uses it unfitted, with the values of robot.toml"
            return f"{text}; {how}."
        return f"{text}, or its geometry is off."

    @property
    def belief(self) -> float:
        """Probability that it is of use, by the FRFs: a whole matrix of them is hard to fit."""
        return BELIEVED if self.taught else PRIOR_BELIEF

    def frequency_sd(self, q: np.ndarray, simulated: SimulatedModes) -> np.ndarray:
        """Sd of ln f (n, count) that the identified parameters leave; 0 for a frozen simulation.

        `simulated` are the simulation's modes at q (n, dof) in rad.
        """
        if self.learned is None:
            return np.zeros((len(q), self.count))
        nominal, identified = self.learned.structure.simulation, self.learned.identified
        return frequency_sd(identified, nominal, self.learned.priors, q, simulated)


def learn(
    before: LowFidelity, frfs: Sequence[Frf], q: np.ndarray, band_hz: tuple[float, float]
) -> LowFidelity:
    """The simulation identified again from the FRFs measured at q (n, dof) in rad.

    They may be between any points. A function of its arguments alone, whatever was identified
    before: replays must agree.
    """
    nominal = before.nominal
    if nominal is None or not frfs:
        return before
    lesson = Lesson(tuple(frfs), q, band_hz, before.tolerances)
    structure = ExtendedModel(nominal, before.priors)
    stated, learned = _with_what_is_missing(lesson.glanced(structure), lesson)
    if stated.identified.misfit > lesson.hopeless and learned.identified.misfit > SWINGS:
        # Nothing explains the recordings: now it matters how nearly what is stated does.
        stated = lesson.identified(stated.structure)
        learned = likeliest([stated, learned])
    learned = with_swinging_mass(stated, learned, lesson)
    learned = with_strayed_springs_again(learned, lesson)
    left_out = None
    if not learned.fits and len(frfs) > 1:
        left_out = _left_out(learned, lesson, before.count)
    return replace(before, learned=learned, left_out=left_out)


def _with_what_is_missing(stated: Learned, lesson: "Lesson") -> tuple[Learned, Learned]:
    """What is stated, with loss factors where they help, and the same with springs beside it.

    Springs that would imitate loss factors come second; but where what is stated is far from the
    recordings and springs bring it to their noise, loss factors are not asked for.
    """
    learned = with_springs(stated, lesson) if stated.identified.misfit > HOPELESS else stated
    if learned.identified.misfit > BEST:
        lossy = with_loss_factors(stated, lesson)
        if learned is stated or lossy is not stated:
            return lossy, with_springs(lossy, lesson)
    return stated, learned


@dataclass(frozen=True, eq=False)
class Lesson:
    """FRFs at q (n, dof) in rad, by which a simulation is identified, and how they err."""

    frfs: tuple[Frf, ...]
    q: np.ndarray
    band_hz: tuple[float, float]
    tolerances: Tolerances | None

    @property
    def hopeless(self) -> float:
        """See HOPELESS."""
        return HOPELESS if len(self.frfs) > PLACED else AMONG_FEW * HOPELESS

    def identified(
        self,
        structure: ExtendedModel,
        warm: Identification | None = None,
        starts: int | np.ndarray = 1,
    ) -> Learned:
        found = self._identify(structure, warm, _effort(self.frfs), starts)
        return self._learned(structure, found)

    def _learned(self, structure: ExtendedModel, found: Identification) -> Learned:
        suspect = EXACT_SUSPECT if self.tolerances is None else SUSPECT
        return Learned(structure, found, suspect, len(self.frfs))

    def glanced(self, structure: ExtendedModel) -> Learned:
        """As `identified`; not followed to the end where it is far from the recordings.

        Where it is near, what hits leave open follows the fit more closely: as long as it has not
        settled, springs that are not there would seem to explain what is left. Of few
        poses what seems hopeless is followed farther.
        """
        effort = replace(_effort(self.frfs), openings=OPENINGS, hopeless=self.hopeless)
        return self._learned(structure, self._identify(structure, None, effort))

    def without(self, away: np.ndarray, warm: Learned) -> Identification:
        """From fewer poses, starting where all of them led; `away` (n,) bool."""
        kept = tuple(frf for frf, gone in zip(self.frfs, away, strict=True) if not gone)
        # Beside an error of a percent, forty lines and no completion are exact enough.
        rough = replace(_effort(kept), last_lines=40, last_completions=0)
        fewer = replace(self, frfs=kept, q=self.q[~away])
        return fewer._identify(warm.structure, warm.identified, rough)

    def _identify(
        self,
        structure: ExtendedModel,
        warm: Identification | None,
        effort: Effort,
        starts: int | np.ndarray = 1,
    ) -> Identification:
        return identify(
            self.frfs,
            self.q,
            structure.simulation,
            structure.priors,
            band_hz=self.band_hz,
            starts=starts,
            warm=warm,
            effort=effort,
            tolerances=self.tolerances,
        )


def _left_out(warm: Learned, lesson: Lesson, count: int) -> np.ndarray:
    out = np.full((len(lesson.frfs), count), np.nan)
    folds = min(len(lesson.frfs), FOLDS)
    for fold in range(folds):
        away = np.arange(len(lesson.frfs)) % folds == fold
        found = lesson.without(away, warm)
        out[away] = found.simulation.modes(lesson.q[away], count).frequency_hz
    return out
