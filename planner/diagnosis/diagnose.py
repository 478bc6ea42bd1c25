"""The whole diagnosis: window and tone by signals, effects by FRFs, laws by force levels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from msgspec import UNSET, UnsetType

from planner.dataset.dataset import Dataset
from planner.diagnosis.exponential_window import screen_window
from planner.diagnosis.finding import Finding
from planner.diagnosis.found_laws import straightened, with_laws
from planner.diagnosis.levels import LevelLaw, Levels, level_laws
from planner.diagnosis.tone import screen_tone
from planner.diagnosis.verdict import LEAST, NamedEffect, Verdict, judged
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import CAD_INERTIAS
from planner.effects.table import EffectLibrary, diagnosed
from planner.errors import InputError
from planner.fit.expected import ExpectedFrfs
from planner.fit.explanations import ExploredStructures, most_probable
from planner.fit.fitted import StructureFit, settled, size_of
from planner.fit.held_out import set_aside
from planner.fit.identify import TOO_SOFT
from planner.fit.misfit import FrfMisfit
from planner.fit.posterior import RobotPosterior
from planner.fit.search import SEARCHED, Search
from planner.fit.structure import RobotPrior
from planner.frf.frf import Frf
from planner.measurement.agreement import NO_SIMILARITY, Similarity, similarity_of
from planner.measurement.nuisances import Tolerances
from planner.progress import ProgressCallback, no_progress
from planner.robot.joint_laws import LawTable
from planner.words import significant

# Stated springs are known as well as datasheets have them (a fifth), dampers to a factor of two;
# masses lie elsewhere by 8 % of a body's radius of gyration: cables, oil, covers.
PRIORS = replace(CAD_INERTIAS, stiffness_factor=1.2, damping_factor=2.0, elsewhere=0.08)
ROUNDS = 2  # of laws by a linear fit, and that fit beside the laws
MOST_BETWEEN = 8  # poses between measured ones, at which sizes are told


@dataclass(frozen=True)
class ThreefoldSimilarity:
    """Of the simulation as stated, refitted, and with what explains the recordings.

    At `poses` that no fit had seen, or at all.
    """

    nominal: Similarity = NO_SIMILARITY
    refitted: Similarity = NO_SIMILARITY
    explained: Similarity = NO_SIMILARITY
    poses: tuple[str, ...] | UnsetType = UNSET


@dataclass(frozen=True)
class Established:
    """An effect that is there and matters: its place, how sure that is, by which share of |H| FRFs
    change when it is left out (None: of the signals alone), parameters (value, sd, unit) by name,
    and what to do."""

    effect: str
    at: str | None
    probability: float
    change: float | None
    parameters: Mapping[str, tuple[float, float, str]]
    text: str


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What was `recorded` (as it was used), the fits, the verdict, and agreement with FRFs.

    `screened` is what signals tell without any model. `aside` are numbers of poses that the fits
    behind `held_out` did not see.
    """

    recorded: Dataset
    search: Search
    explored: ExploredStructures
    verdict: Verdict
    screened: tuple[Finding, ...]
    levels: Levels | None
    fitted: ThreefoldSimilarity
    aside: tuple[int, ...]
    held_out: ThreefoldSimilarity | None

    @property
    def refitted(self) -> StructureFit:
        """The robot as stated, refitted."""
        return self.explored.plain

    @property
    def best(self) -> StructureFit:
        """With what explains the recordings."""
        return self.verdict.best

    @cached_property
    def robot(self) -> RobotPosterior:
        """What is believed of the robot with what explains the recordings."""
        return RobotPosterior.of(self.best)

    @cached_property
    def findings(self) -> tuple[Established, ...]:
        """Of signals first, then of the fits, what changes most first."""
        from_signals = [
            Established(f.effect, f.at, 1.0, None, f.parameters, f.text) for f in self.screened
        ]
        laws = [
            Established(
                law.effect, law.at, self._share(law), law.share, law.parameters, _words(law)
            )
            for law in self._laws
        ]
        return (
            *from_signals,
            *laws,
            *(self._established(e, e.probability) for e in self.verdict.findings),
        )

    @property
    def _laws(self) -> tuple[LevelLaw, ...]:
        told = self.verdict.verdict == "explained" and self.levels
        return told.laws if told else ()

    @cached_property
    def simulation(self) -> Simulation:
        """The robot with all that was found, and the pulse of the hits."""
        return with_laws(self.robot.simulation, self._laws, self.recorded)

    @property
    def laws(self) -> tuple[LawTable, ...]:
        """Of joints that are not linear, as robot.toml has them, beside `robot`'s springs."""
        told = [law.table for law in self._laws]
        return tuple(law for law in self.simulation.robot.config.law if law in told)

    @property
    def unwritten(self) -> tuple[tuple[str, str], ...]:
        """Laws, and where, that would take away more than the spring of their joint has."""
        return tuple((law.effect, law.at) for law in self._laws if law.table not in self.laws)

    def _share(self, law: LevelLaw) -> float:
        place = law.effect, law.at
        return sum(c.probability for c in self.verdict.candidates if place in c.places)

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """What is there and too small to matter, or not sure enough, in words."""
        told = [e for e in self.verdict.effects if not e.counts and e.gain_nats > LEAST]
        why = {True: "Too small to matter", False: "Not sure enough to be a finding"}
        return tuple(
            f"{why[e.change < self.search.floor]} (it changes |H| by "
            f"{significant(100 * e.change)} %): {self._established(e, e.probability).text}"
            for e in told
        )

    def _established(self, named: NamedEffect, probability: float) -> Established:
        effect = named.operator
        values = self.robot.values(effect)
        text = effect.words(values).replace(effect.at, effect.at.split("#")[0])
        parameters = effect.parameters(values)
        return Established(*effect.name, probability, named.change, parameters, text)


def explain(
    recorded: Dataset, simulation: Simulation, progress: ProgressCallback = no_progress
) -> Diagnosis:
    """What `simulation` lacks, by recordings.

    Raises InputError where nothing of the FRFs lies in robot.toml's band, or where the robot would
    not stand at their poses.
    """
    progress("looking at the signals", 0.02)
    window = None
    if not recorded.window_rate_1_s:
        window = screen_window([hit for visit in recorded.visits for hit in visit.hits])
    if window is not None:
        recorded = recorded.corrected(recorded.visits, window.parameters["rate"][0])
    robot = simulation.robot
    search = searching(recorded.ended_frfs, recorded.q, simulation, _order(recorded))
    stated = search.prior.stated()
    if not FrfMisfit(stated, search.data(1), search.tolerances).possible(stated.mean):
        raise InputError(TOO_SOFT)
    screened = tuple(f for f in (window, screen_tone(recorded)) if f is not None)
    from_signals = [(f.effect, f.at) for f in screened]
    matters = robot.config.diagnose.matters
    recorded, search, explored, levels = _explored(recorded, search, simulation, progress)
    fits, aside = (explored.plain, most_probable(explored.settled)), set_aside(recorded.q)
    progress("judging", 0.9)
    held_out, left = _held_out(search, fits, aside) if aside else (None, 0.0)
    verdict = judged(explored, matters, between(recorded.q), from_signals, levels, left)
    return Diagnosis(
        recorded,
        search,
        explored,
        verdict,
        screened,
        levels,
        _agreement(fits, fits),
        aside,
        held_out,
    )


def _explored(
    recorded: Dataset, search: Search, simulation: Simulation, progress: ProgressCallback
) -> tuple[Dataset, Search, ExploredStructures, Levels | None]:
    """What explains the recordings, and what force levels tell of joints that are not linear.

    Then the recordings are returned, and searched, as they are without that: a linear fit follows
    what a law has on average, from pose to pose, by effects that are not there.
    """

    def told(search: Search) -> Search:
        return replace(search, on_step=lambda text: progress(f"fitting: {text}", 0.5))

    search = told(search)
    begun, straight, matters = [search.plain()], recorded, simulation.robot.config.diagnose.matters
    levels = level_laws(recorded, begun[0], 0) if recorded.visits else None
    # A joint's law, where hits of different force differ, comes first: it bends what is linear. Any
    # linear fit tells it that leaves no more than what need not be explained.
    for _ in range(ROUNDS if levels and levels.seen.size >= matters else 0):
        best = most_probable(begun)
        if size_of(best) > search.floor:
            begun = list(replace(search, thorough=False).explored(begun).settled)
            best = most_probable(begun)
        progress("comparing hits of different force", 0.85)
        seen = level_laws(recorded, best)
        levels = seen if levels is None or seen.laws or not levels.laws else levels
        if not seen.laws or recorded.most_heard is not recorded:
            break
        there = RobotPosterior.of(best).simulation
        straight = straightened(recorded, with_laws(there, seen.laws, recorded))
        search = told(searching(straight.ended_frfs, straight.q, simulation, _order(straight)))
        begun = search.plain(), search.recovered(best.tried.record)
    found = search.explored(begun)
    if levels and levels.laws:
        levels = replace(levels, left=level_laws(straight, most_probable(found.settled), 0).seen)
    return straight, search, found, levels


def _words(law: LevelLaw) -> str:
    """What to do about a joint's law."""
    said = {
        "friction": f"{law.at} rubs: check its lubrication, seals and brake.",
        "backlash": f"{law.at} has play: check its gear and bearings.",
        "nonlinear_stiffness": f"The stiffness of {law.at} depends on amplitude: check the "
        "gear's preload and what it is mounted on.",
    }
    share = significant(100 * law.share)
    return f"{said[law.effect]} FRFs of hits of different force differ by {share} %."


def searching(
    frfs: Sequence[Frf], q: np.ndarray, simulation: Simulation, order: np.ndarray | None = None
) -> Search:
    """A search of the whole library, in which nothing is told that does not matter."""
    robot = simulation.robot
    prior = RobotPrior(EffectLibrary.of(simulation, PRIORS, diagnosed(simulation)), bearings=True)
    return Search(
        prior,
        tuple(frfs),
        np.atleast_2d(q),
        robot.config.band_hz,
        Tolerances.of(robot.config, robot.joints.slides),
        order=order,
        floor=robot.config.diagnose.matters,
        thorough=True,
    )


def _order(recorded: Dataset) -> np.ndarray:
    """How much of the campaign was over, 0 to 1, when each pose was hit first."""
    first: dict[str, float] = {}
    for visit in recorded.visits:
        first.setdefault(visit.pose, visit.order)
    order = np.array([first.get(pose, 0) for pose in recorded.poses], dtype=float)
    return (order - order.min()) / max(float(np.ptp(order)), 1.0)


def between(q: np.ndarray) -> np.ndarray:
    """Poses half-way between each of q (n, dof) in rad and the one nearest to it."""
    if len(q) < 2:
        return q
    span = np.maximum(np.ptp(q, axis=0), 1e-9)
    apart = np.linalg.norm((q[:, None] - q[None]) / span, axis=2) + 1e9 * np.eye(len(q))
    pairs = {tuple(sorted((i, int(k)))) for i, k in enumerate(np.argmin(apart, axis=1))}
    made = [(q[i] + q[k]) / 2 for i, k in sorted(pairs)]
    return np.array(made)[:MOST_BETWEEN]


def _agreement(
    seen: tuple[StructureFit, StructureFit], there: tuple[StructureFit, StructureFit]
) -> ThreefoldSimilarity:
    """At the data of `there`, of the structures as fitted in `seen`, and as stated."""
    data = there[0].misfit.data
    plain = FrfMisfit(seen[0].structure.prior.stated(data.sensors), data, seen[0].misfit.tolerances)
    found = [similarity_of(data.measured, plain.motion(plain.structure.mean, None).accelerance)]
    for fit in seen:
        misfit = replace(fit.misfit, data=data)
        for name in ("matrices", "jacobians", "poses"):
            vars(misfit).pop(name, None)
        h = misfit.through_chain(fit.at.x, misfit.motion(fit.at.x, None).accelerance)
        found.append(similarity_of(data.measured, h))
    return ThreefoldSimilarity(found[0], found[1], found[2])


def _held_out(
    search: Search, fits: tuple[StructureFit, StructureFit], aside: tuple[int, ...]
) -> tuple[ThreefoldSimilarity, float]:
    """Of fits that never saw the poses set aside, and what share of FRFs the last of them misses
    there; the structure was chosen with all."""
    data = search.data(SEARCHED)
    kept = np.array([i for i in range(len(data.q)) if i not in aside])
    again = []
    for fit in fits:
        misfit = FrfMisfit(
            fit.structure, data.at(kept), search.tolerances, fit.misfit.rho, search.floor
        )
        again.append(settled(misfit, misfit(fit.at.x, fit.at.own[kept])))
    there = replace(again[0].misfit, data=data.at(np.array(aside)))
    shown = StructureFit(there, again[0].at, 0.0)
    expected = ExpectedFrfs(RobotPosterior.of(again[1]), search.band_hz)
    left = max(expected.discrepancy(data.at(np.array([pose]))) for pose in aside)
    return _agreement((again[0], again[1]), (shown, shown)), left
