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
    equivalent_slopes,
    level_data,
    own_parameter,
    strongest_slopes,
)
from planner.diagnosis.laws.level_refits import base, bases
from planner.diagnosis.laws.open_misses import OpenMisses
from planner.diagnosis.laws.starting_values import hanging_starts, starts
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.linear.problem import Problem, tolerances_of
from planner.diagnosis.screens import repeats, several_joints
from planner.diagnosis.screens.implausible_springs import strayed
from planner.diagnosis.screens.tone import screen_tone
from planner.diagnosis.screens.weighed_laws import (
    WeighedLaw,
    law_finding,
    levels_of,
    shares_of_laws,
    weighed_laws,
)
from planner.diagnosis.thresholds import (
    BY_CHANCE,
    CLEAR,
    LAW_BY_CHANCE,
    LAW_EXPLAINS,
    LAW_HOPEFUL,
    LAW_OF_ITS_OWN,
    LAW_SURELY,
    LINEARISED,
    ONE_JOINT,
    PLACED,
    PROPORTIONAL,
    SURE_OF_JOINT,
    UNKNOWN,
)
from planner.dynamics.simulation import Simulation
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
OTHERWISE = (0.5, 0.7, 0.85, 1.2, 1.5, 2.0)  # times the share of the weight that a gear bears
TOLERANCE = 1e-5  # of the objective, that a last round must gain


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
    looks = (_Compared.by(recorded, *base) for base in bases(recorded, nominal))
    first = next(looks)
    if not len(first.found.count) or disproportion(first.found) < PROPORTIONAL:
        return ()
    by_chance = repeats.chance(recorded, first.misses)
    as_repeats = by_chance is not None and by_chance > LAW_BY_CHANCE
    if as_repeats and not placed(first.found):
        return ()  # repeats at one level differ as much as levels do
    single = single or as_repeats
    if several := () if single else _several(recorded, nominal, first.found, tell):
        return several
    least = LAW_SURELY if as_repeats else None
    findings, clear = _named(recorded, first, tell, least, held=True)
    for look in looks:
        if clear or (single and findings[0].effect != UNKNOWN):
            break
        named, clear = _named(recorded, look, tell, least)
        findings = max(findings, named, key=_rank)
    if findings[0].effect != UNKNOWN:
        return findings
    if by_chance is None:
        return tuple(replace(f, wants=repeats.wanted(recorded)) for f in findings)
    return findings if by_chance <= BY_CHANCE else ()  # what no law describes may be chance


@dataclass(frozen=True, eq=False)
class _Compared:
    """Force levels compared by a linear fit, which tells what misses of hits leave open."""

    problem: Problem
    misses: OpenMisses
    found: Equivalent

    @classmethod
    def by(cls, recorded: Dataset, problem: Problem, plain: Fit) -> "_Compared":
        misses = OpenMisses.told(plain, recorded, tolerances_of(problem.simulation))
        return cls(problem, misses, equivalent(recorded, system_of(plain), misses))


def _several(
    recorded: Dataset, nominal: Simulation, found: Equivalent, tell: Tell
) -> tuple[Finding, ...]:
    """One law at several joints, where no single joint explains the levels."""
    if not found.delta.shape[1] or equivalent_share(found) >= ONE_JOINT:
        return ()
    tell("fitting one law at all joints to the hits", 0.2)
    return several_joints.screen(recorded, nominal)


def _rank(findings: tuple[Finding, ...]) -> tuple[bool, float]:
    """A law before none, then what has more evidence."""
    return findings[0].effect != UNKNOWN, findings[0].log_evidence


def _named(
    recorded: Dataset,
    look: _Compared,
    tell: Tell,
    least: float | None = None,
    *,
    held: bool = False,
) -> tuple[tuple[Finding, ...], bool]:
    """Which joint's law makes the levels differ, or `unknown`; whether no other comes close.

    `least` is the share of the differences that a law has to explain, if it is not the usual one.
    `held`: gears that the weight holds at one flank of their gap are looked at too.
    """
    misses, found = look.misses, look.found
    plain = misses.plain
    if not found.delta.shape[1]:
        return (_unknown(found, "no joint has a spring about its own axis"),), False
    system, share, of_one = system_of(plain), equivalent_share(found), placed(found)
    weighed = weigh(recorded, misses, system, found, tell) if share > LINEARISED or of_one else ()
    least = least or (LAW_OF_ITS_OWN if of_one else LAW_EXPLAINS)
    if held and (not weighed or weighed[0].explained < least):
        hanging = weigh(recorded, misses, system, found, tell, hanging=True)
        if hanging and (not weighed or hanging[0].explained > weighed[0].explained):
            same = hanging[0].candidate.law.effect, hanging[0].at
            others = (w for w in weighed if (w.candidate.law.effect, w.at) != same)
            weighed = (hanging[0], *others)
    if not weighed:
        return (_unknown(found, "even with a stiffness of its own for every hit"),), False
    best = weighed[0]
    if best.log_evidence > CLEAR and best.explained > least:
        there, shares = shares_of_laws(weighed)
        best, c = there[0], there[0].candidate
        sd = np.sqrt(np.diagonal(c.covariance(best.temper))[: len(c.law.x)])
        candidates = tuple(w.candidate for w in there)
        laws = Laws(look.problem, plain, candidates, shares, best.temper, _hardest(recorded))
        far = strayed(plain, c.law.x, sd, best.at, best.per_value)
        close = [w for w in weighed if w.explained > LAW_SURELY]
        finding = law_finding(there, laws)
        if of_one:  # surely this joint, of whatever shape its law is
            finding = replace(finding, sure=max(finding.sure, SURE_OF_JOINT))
        return (finding, *far), len(close) == 1
    law = best.candidate.law.effect.replace("_", " ")
    how = f"the best, {law} at {best.at}, explains {100 * best.explained:.0f} %"
    return (_unknown(found, how),), False


def not_by_misses(recorded: Dataset, nominal: Simulation) -> tuple[Finding, ...]:
    """`unknown`, where hits differ by more than misses leave open; misses beyond any hand are none.

    As long as physics is missing, misses of hits seem to be larger than they are: that alone says
    nothing.
    """
    recorded = recorded.most_heard
    first = _Compared.by(recorded, *next(bases(recorded, nominal)))
    if disproportion(first.found) < PROPORTIONAL:
        return ()
    text = (
        "Hits along one axis of a pose differ by more than any hand's misses explain, and not by "
        "their force alone. Look for play, loose parts, or contact with the surroundings."
    )
    return (Finding(UNKNOWN, None, _excess(first.found) / 2, {}, text),)


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


def placed(found: Equivalent) -> bool:
    """Whether a stiffness of its own a hit explains clearly more at one joint than at any other."""
    if not found.delta.shape[1]:
        return False
    first, *others = np.sort(found.chi2.sum(axis=0))
    return bool(first < PLACED * min(float(found.before.sum()), *others))


def disproportion(found: Equivalent) -> float:
    """χ² per value of the differences between force levels, 1 if the structure is linear."""
    return float(found.before.sum() / max(found.count.sum(), 1))


def _excess(found: Equivalent) -> float:
    return float(found.before.sum() - found.count.sum())


def weigh(
    recorded: Dataset,
    misses: OpenMisses,
    system: System,
    found: Equivalent,
    tell: Tell = quietly,
    *,
    hanging: bool = False,
) -> tuple[WeighedLaw, ...]:
    """Every law at the joints that come into question, fitted in time, most probable first.

    With `hanging` only backlash of the likeliest joint, which its weight holds at one flank of the
    gap: none where it has no weight to bear.
    """
    plain = misses.plain
    data = level_data(recorded, plain, misses)
    problem = LawProblem(data, plain, data.hits, strongest_slopes(data, plain))
    left = found.chi2.sum(axis=0)
    order = np.argsort(left)[:JOINTS]
    ports = [int(j) for j in order if left[j] < ALSO * left[order[0]]]
    begin = []
    if hanging:
        sag = plain.misfit.setting.simulation.elastic.sag(recorded.q)
        laws = hanging_starts(found, system, ports[0], plain.x, sag[:, system.blocks[ports[0]]])
        begin, ports = [problem.start(law, BATCH_DAMPING) for law in laws], []
        if not begin:
            return ()
    for port in ports:
        own = own_parameter(plain, int(system.blocks[port]))
        laws = starts(found, system, port, plain.x, own)
        begin += [problem.start(law, BATCH_DAMPING) for law in laws]
    tell("fitting every law at single joints to the hits", 0.5)
    begun = _best_of_each(advance(problem, begin, 0), STARTS)
    rough = _held_otherwise(problem, _best_of_each(advance(problem, begun, ROUNDS), 1))
    best = min(fit.at.chi2 for fit in rough)
    tell("following the best laws", 0.6)
    kept = advance(problem, [f for f in rough if f.at.chi2 < HOPELESS * best], MORE)
    kept = _held_otherwise(problem, kept)
    ends, levels = [fit.at for fit in kept], levels_of(data, system)
    first = min(ends, key=lambda c: c.value)
    # Laws are weighed one against the other: those half-way would be wronged.
    told = [c for c in ends if c is first or levels.explained(c) > LAW_HOPEFUL]
    tell("fitting the best laws to the end", 0.8)
    last = side_by_side(partial(_followed, problem, found), told)
    rest = (c for c in ends if all(c is not t for t in told))
    return weighed_laws(data, system, [*last, *rest])


def _held_otherwise(
    problem: LawProblem, fits: Sequence[Iterate[LawMisfit]]
) -> list[Iterate[LawMisfit]]:
    """Fits, or those of joints of which gears bear another share of the weight, where it fits."""
    out = []
    for fit in fits:
        law = fit.at.law
        held = [replace(law, rest=law.rest * f) for f in OTHERWISE] if law.rest is not None else []
        begin = [problem.start(one, BATCH_DAMPING) for one in held]
        out.append(min([fit, *advance(problem, begin, 1)], key=lambda one: one.at.value))
    return out


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


def _hardest(recorded: Dataset) -> Column:
    return max((c for group in recorded.columns for c in group), key=lambda c: c.peak_n)
