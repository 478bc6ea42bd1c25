"""The screen for what depends on the force level: nonlinear joints, and what no joint explains."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from planner.dataset.dataset import Dataset
from planner.dataset.level_columns import Column
from planner.diagnosis.finding import Finding
from planner.diagnosis.laws.equivalent_stiffness import Equivalent, System, equivalent, system_of
from planner.diagnosis.laws.fit_in_time import BATCH_DAMPING, LawProblem, advance
from planner.diagnosis.laws.law_at_joints import LawMisfit, Laws
from planner.diagnosis.laws.level_data import (
    LevelData,
    equivalent_slopes,
    level_data,
    own_parameter,
    strongest_slopes,
)
from planner.diagnosis.laws.level_refits import base
from planner.diagnosis.laws.open_misses import OpenMisses
from planner.diagnosis.laws.starting_values import starts
from planner.diagnosis.laws.torque_laws import behaviour
from planner.diagnosis.linear.drift_fit import problem_of
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.linear.problem import tolerances_of
from planner.diagnosis.screens import repeats, several_joints
from planner.diagnosis.screens.implausible_springs import strayed
from planner.diagnosis.screens.tone import screen_tone
from planner.diagnosis.thresholds import (
    ALIKE,
    BY_CHANCE,
    CLEAR,
    INDEPENDENT,
    LAW_EXPLAINS,
    LAW_HOPEFUL,
    LAW_INEXACT,
    LAW_UNEXPLAINED,
    LINEARISED,
    ONE_JOINT,
    PROPORTIONAL,
    UNKNOWN,
)
from planner.dynamics.simulation import Simulation
from planner.inference.evidence import occam, temper, unexplained_shares
from planner.inference.least_squares import Damping, Iterate
from planner.inference.parallel import side_by_side
from planner.progress import Tell, quietly

ALSO = 2.5  # joints whose equivalent stiffness explains nearly as much are fitted too
JOINTS = 2
STARTS = 2  # of each law at a joint, that are followed
ROUNDS, MORE, LAST, AGAIN = 3, 6, 4, 2
HOPELESS = 10.0  # times the best χ² after ROUNDS
# Poorly known directions may go far in the last rounds.
LAST_DAMPING = Damping(first=1e-7, least=1e-10, most=2e4, lighter=0.1, heavier=10.0)
TOLERANCE = 1e-5  # of the objective, that a last round must gain


@dataclass(frozen=True)
class LevelMisfit:
    """Σ weight |error|²: of a linear joint, what noise alone would leave, and the former's excess.

    A linear simulation says that levels do not differ; of the strongest only the noise is counted,
    because a linear fit could still follow them.
    """

    linear: float
    expected: float
    excess: float

    def explained(self, candidate: LawMisfit) -> float:
        """Share of the excess that a law takes away."""
        return 1 - max(candidate.chi2 - self.expected, 0.0) / self.excess


@dataclass(frozen=True, eq=False)
class WeighedLaw:
    """A law at a joint: its log evidence over a linear joint, and the share that it explains.

    `levels` is what it was to explain.
    """

    candidate: LawMisfit
    at: str
    log_evidence: float
    explained: float
    levels: LevelMisfit
    per_value: float
    parameters: dict[str, tuple[float, float, str]]
    temper: float


def screen(
    recorded: Dataset, nominal: Simulation, *, single: bool = False, tell: Tell = quietly
) -> tuple[Finding, ...]:
    """Nonlinear joints; `unknown` where the level matters and no joint's law explains it.

    Without repeats `unknown` says what it wants. `single`: a law of several joints is not looked
    for. Of several sensors and hit points, the ones most heard tell.
    """
    recorded = recorded.most_heard
    if len(recorded.level_n) < 2:
        return ()
    tone = screen_tone(recorded)
    if tone is not None:
        return (tone,)
    plain = base(recorded, nominal)
    misses = OpenMisses.told(plain, recorded, tolerances_of(nominal))
    system = system_of(plain)
    found = equivalent(recorded, system, misses)
    if not len(found.count) or disproportion(found) < PROPORTIONAL:
        return ()
    by_chance = repeats.chance(recorded, misses)
    if by_chance is not None and by_chance > BY_CHANCE:
        return ()  # repeats at one level differ as much as levels do
    findings = _named(recorded, nominal, found, misses, single, tell)
    if by_chance is None:
        wanted = repeats.wanted(recorded)
        return tuple(replace(f, wants=wanted if f.effect == UNKNOWN else "") for f in findings)
    return findings


def _named(
    recorded: Dataset,
    nominal: Simulation,
    found: Equivalent,
    misses: OpenMisses,
    single: bool,
    tell: Tell,
) -> tuple[Finding, ...]:
    """Which joints' laws make the levels differ, or `unknown`."""
    plain = misses.plain
    system, share = system_of(plain), equivalent_share(found)
    if share < ONE_JOINT and not single:
        tell("fitting one law at all joints to the hits", 0.2)
    several = several_joints.screen(recorded, nominal) if share < ONE_JOINT and not single else ()
    if several:
        return several
    if share < LINEARISED:
        return (_unknown(found, "even with a stiffness of its own for every hit"),)
    weighed = weigh(recorded, misses, system, found, tell)
    best = weighed[0]
    if best.log_evidence > CLEAR and best.explained > LAW_EXPLAINS:
        there, shares = _shares(weighed)
        best, c = there[0], there[0].candidate
        sd = np.sqrt(np.diagonal(c.covariance(best.temper))[: len(c.law.x)])
        candidates = tuple(w.candidate for w in there)
        problem, hit = problem_of(recorded, nominal), _hardest(recorded)
        laws = Laws(problem, plain, candidates, shares, best.temper, hit)
        return (
            _finding(there, laws),
            *strayed(plain, c.law.x, sd, best.at, best.per_value),
        )
    law = best.candidate.law.effect.replace("_", " ")
    return (
        _unknown(found, f"the best, {law} at {best.at}, explains {100 * best.explained:.0f} %"),
    )


def differ(recorded: Dataset, nominal: Simulation) -> bool:
    """Whether FRFs of different force levels differ by more than noise, hits being exact."""
    recorded = recorded.most_heard
    if len(recorded.level_n) < 2:
        return False
    found = equivalent(recorded, system_of(base(recorded, nominal)))
    return bool(len(found.count)) and disproportion(found) >= PROPORTIONAL


def _unknown(found: Equivalent, how: str) -> Finding:
    text = (
        "The response is not proportional to the force, and neither a single joint nor one law at "
        f"several joints describes how: {how}. Look for contact with the surroundings, loose "
        "parts or clearance."
    )
    return Finding("unknown", None, _excess(found) / 2, {}, text)


def equivalent_share(found: Equivalent) -> float:
    """Share of the levels' differences that a stiffness of its own a hit explains, best joint."""
    left = float(found.chi2.sum(axis=0).min() - found.count.sum())
    return 1 - max(left, 0.0) / max(_excess(found), 1e-9)


def disproportion(found: Equivalent) -> float:
    """χ² per value of the differences between force levels, 1 if the structure is linear."""
    return float(found.before.sum() / max(found.count.sum(), 1))


def _excess(found: Equivalent) -> float:
    return float(found.before.sum() - found.count.sum())


def weigh(
    recorded: Dataset, misses: OpenMisses, system: System, found: Equivalent, tell: Tell = quietly
) -> tuple[WeighedLaw, ...]:
    """Every law at the joints that come into question, fitted in time, most probable first."""
    plain = misses.plain
    data = level_data(recorded, plain, misses)
    problem = LawProblem(data, plain, data.hits, strongest_slopes(data, plain))
    left = found.chi2.sum(axis=0)
    order = np.argsort(left)[:JOINTS]
    ports = [int(j) for j in order if left[j] < ALSO * left[order[0]]]
    begin = []
    for port in ports:
        own = own_parameter(plain, int(system.blocks[port]))
        laws = starts(found, system, port, plain.x, own)
        begin += [problem.start(law, BATCH_DAMPING) for law in laws]
    tell("fitting every law at single joints to the hits", 0.5)
    begun = _best_of_each(advance(problem, begin, 0), STARTS)
    rough = _best_of_each(advance(problem, begun, ROUNDS), 1)
    best = min(fit.at.chi2 for fit in rough)
    tell("following the best laws", 0.6)
    kept = advance(problem, [f for f in rough if f.at.chi2 < HOPELESS * best], MORE)
    ends, levels = [fit.at for fit in kept], _levels(data)
    first = min(ends, key=lambda c: c.value)
    # Laws are weighed one against the other: those half-way would be wronged.
    told = [c for c in ends if c is first or levels.explained(c) > LAW_HOPEFUL]
    tell("fitting the best laws to the end", 0.8)
    last = side_by_side(partial(_followed, problem, found), told)
    rest = (c for c in ends if all(c is not t for t in told))
    return _weighed(data, plain, system, [*last, *rest])


def _followed(problem: LawProblem, found: Equivalent, at: LawMisfit) -> LawMisfit:
    """To the end, with derivatives of the differences too."""
    for _ in range(AGAIN):
        law = at.law
        slopes = equivalent_slopes(problem.data, problem.plain, found, int(law.ports[0]), law.x)
        closer = replace(problem, linear=slopes)
        at = advance(closer, [closer.start(law, LAST_DAMPING)], LAST, TOLERANCE)[0].at
    return at


def _best_of_each(fits: Sequence[Iterate[LawMisfit]], most: int) -> list[Iterate[LawMisfit]]:
    """The best of each port and law."""
    out: list[Iterate[LawMisfit]] = []
    kinds: list[tuple[int, str]] = []
    for fit in sorted(fits, key=lambda fit: fit.at.value):
        kind = int(fit.at.law.ports[0]), fit.at.law.effect
        if kinds.count(kind) < most:
            out.append(fit)
            kinds.append(kind)
    return out


def _weighed(
    data: LevelData, plain: Fit, system: System, kept: Sequence[LawMisfit]
) -> tuple[WeighedLaw, ...]:
    count = 2 * int(np.count_nonzero(data.weight))
    t = temper(min(2 * c.chi2 for c in kept) / count, ALIKE)
    levels = _levels(data)
    out = []
    for c in kept:
        evidence = (levels.linear - c.chi2) / t - _volume(c, t)
        explained = levels.explained(c)
        at, per_value = system.ports[c.law.ports[0]], 2 * c.chi2 / count
        parameters = _parameters(c, t)
        out.append(WeighedLaw(c, at, evidence, explained, levels, per_value, parameters, t))
    return tuple(sorted(out, key=lambda w: -w.log_evidence))


def _levels(data: LevelData) -> LevelMisfit:
    weaker = data.weaker[:, 0, 0]
    differing = float(np.sum(data.chi2(data.compared(data.h))[weaker]))
    strongest = float(np.count_nonzero(data.weight[~weaker]))
    values = float(np.count_nonzero(data.weight[weaker]))
    excess = max(differing - values, 1e-9)
    return LevelMisfit(differing + strongest, strongest + values, excess)


def _volume(candidate: LawMisfit, temper: float) -> float:
    """What ν costs: ln of how much narrower the data make it than the prior, and its distance."""
    mean, sd = candidate.law.law_prior()
    spread = np.sqrt(np.diagonal(candidate.covariance(temper))[-2:])
    return occam((candidate.law.nu.ravel() - mean) / sd, spread, sd)


def _parameters(candidate: LawMisfit, temper: float) -> dict[str, tuple[float, float, str]]:
    law = candidate.law
    return law.parameters(0, candidate.covariance(temper)[-2:, -2:], LAW_INEXACT)


def _shares(weighed: Sequence[WeighedLaw]) -> tuple[list[WeighedLaw], tuple[float, ...]]:
    """The laws at the joint of the best, and the shares that all that is not explained gives."""
    at, levels = weighed[0].at, weighed[0].levels
    there = sorted((w for w in weighed if w.at == at), key=lambda w: w.candidate.chi2)
    chi2 = np.array([w.candidate.chi2 for w in there])
    # Below what noise is expected to leave, the best law is as good as any: others count from it.
    beyond = chi2 - min(levels.expected, chi2[0])
    left = np.maximum(beyond, max(LAW_UNEXPLAINED * levels.excess, INDEPENDENT / 2))
    return there, tuple(unexplained_shares(left, INDEPENDENT).tolist())


def _hardest(recorded: Dataset) -> Column:
    return max((c for group in recorded.columns for c in group), key=lambda c: c.peak_n)


def _finding(there: Sequence[WeighedLaw], laws: Laws) -> Finding:
    best = there[0]
    others = zip(there[1:], laws.probability[1:], strict=True)
    rivals = {w.candidate.law.effect: share for w, share in others}
    (first, (k, k_sd, unit)), (second, (a, a_sd, other)) = best.parameters.items()
    name = best.candidate.law.effect
    text = (
        f"{best.at.replace('_', ' ').capitalize()} {behaviour(name, k)} "
        f"({first.replace('_', ' ')} {k:.3g} ± {k_sd:.1g} {unit}, {second.replace('_', ' ')} "
        f"{a:.3g} ± {a_sd:.1g} {other}); it explains {100 * best.explained:.0f} % of how FRFs "
        "change with the force."
    )
    return Finding(
        name, best.at, best.log_evidence, best.parameters, text, best.per_value, best.explained,
        tuple(rivals.items()), laws,
    )  # fmt: skip
