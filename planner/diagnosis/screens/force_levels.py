"""The screen for what depends on the force level: nonlinear joints, and what no joint explains."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.dataset.dataset import Dataset
from planner.dataset.level_columns import Column
from planner.diagnosis.finding import Finding
from planner.diagnosis.laws.equivalent_stiffness import Equivalent, equivalent, system_of
from planner.diagnosis.laws.law_at_joints import Laws
from planner.diagnosis.laws.level_refits import Refit, base, bases, refits
from planner.diagnosis.screens import repeats, several_joints
from planner.diagnosis.screens.compared_levels import (
    ComparedLevels,
    disproportion,
    equivalent_share,
    excess,
    off_the_average,
    placed,
)
from planner.diagnosis.screens.fitted_laws import weigh, weigh_held
from planner.diagnosis.screens.implausible_springs import strayed
from planner.diagnosis.screens.tone import screen_tone
from planner.diagnosis.screens.weighed_laws import (
    WeighedLaw,
    law_finding,
    shares_of_laws,
)
from planner.diagnosis.thresholds import (
    BY_CHANCE,
    CLEAR,
    LAW_BY_CHANCE,
    LAW_EXPLAINS,
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
from planner.errors import InputError
from planner.progress import Tell, quietly


def screen(
    recorded: Dataset, nominal: Simulation, *, single: bool = False, tell: Tell = quietly
) -> tuple[Finding, ...]:
    """Nonlinear joints; `unknown` where the level matters and no joint's law explains it.

    It is slight where averages over the levels are off by less than matters. Without repeats
    `unknown` says what it wants. `single`: a law of several joints is not looked for. Of several
    sensors and hit points, the ones most heard tell.
    """
    recorded = recorded.most_heard
    if len(recorded.level_n) < 2:
        return ()
    tone = screen_tone(recorded)
    if tone is not None:
        return (tone,)
    looks = (ComparedLevels.by(recorded, *base) for base in bases(recorded, nominal))
    first = next(looks)
    if not len(first.found.count) or disproportion(first.found) < PROPORTIONAL:
        return ()
    by_chance = repeats.chance(recorded, first.misses)
    as_repeats = by_chance is not None and by_chance > LAW_BY_CHANCE
    if as_repeats and not placed(first.found) and not first.rattles:
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
        wanted = repeats.wanted(recorded)
        return tuple(f if f.slight else replace(f, wants=wanted) for f in findings)
    return findings if by_chance <= BY_CHANCE else ()  # what no law describes may be chance


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
    look: ComparedLevels,
    tell: Tell,
    least: float | None = None,
    *,
    held: bool = False,
) -> tuple[tuple[Finding, ...], bool]:
    """Which joint's law makes the levels differ, or `unknown`; whether no other comes close.

    `least` is the share of the differences that a law has to explain, if it is not the usual one.
    `held`: gears that their weight holds at one end of the gap are looked at too.
    """
    misses, found = look.misses, look.found
    plain = misses.plain
    if not found.delta.shape[1]:
        return (_unknown(look, "no joint has a spring about its own axis"),), False
    weighed = _weighed(recorded, look, tell, held=held)
    surely = _surely_at(look, weighed)
    of_one = bool(surely)
    least = least or (LAW_OF_ITS_OWN if of_one else LAW_EXPLAINS)
    if of_one:
        weighed = tuple(w for w in weighed if w.at == surely)
    if not weighed:
        return (_unknown(look, "even with a stiffness of its own for every hit"),), False
    there, shares = shares_of_laws(weighed)
    best = there[0]
    # Where it is surely this joint, what a linear fit lacks elsewhere says nothing of its law, and
    # only the differences between levels count, less what the law's own numbers cost.
    evidence = best.gain if of_one else min(best.log_evidence, best.gain)
    if evidence > CLEAR and best.explained > least:
        c = best.candidate
        sd = np.sqrt(np.diagonal(c.covariance(best.temper))[: len(c.law.x)])
        candidates = tuple(w.candidate for w in there)
        laws = Laws(look.problem, plain, candidates, shares, best.temper, _hardest(recorded))
        far = strayed(plain, c.law.x, sd, best.at, best.per_value)
        close = [w for w in weighed if w.explained > LAW_SURELY]
        finding = law_finding(there, laws)
        if of_one:  # surely this joint, of whatever shape its law is
            sure = max(finding.sure, SURE_OF_JOINT)
            known = max(finding.log_evidence, evidence)
            finding = replace(finding, sure=sure, log_evidence=known)
        return (finding, *far), len(close) == 1
    law = best.candidate.law.effect.replace("_", " ")
    how = f"the best, {law} at {best.at}, explains {100 * best.explained:.0f} %"
    return (_unknown(look, how),), False


def _surely_at(look: ComparedLevels, weighed: Sequence[WeighedLaw]) -> str:
    """The joint that surely is not linear, of whatever shape its law is; "" where none is.

    That whose own stiffness for every hit leaves least. Or that whose law leaves less than all
    others' and than stiffnesses do: strongly bent laws are nothing like a stiffness, which changes
    while a hit rings.
    """
    found = look.found
    if placed(found):
        return system_of(look.misses.plain).ports[int(np.argmin(found.chi2.sum(axis=0)))]
    if not look.rattles or not weighed:
        return ""
    first = max(weighed, key=lambda w: w.explained)
    others = (w.explained for w in weighed if w.at != first.at)
    next_best = max(0.0, equivalent_share(found), *others)
    clearly = 1 - first.explained < PLACED * (1 - next_best)
    return first.at if clearly and next_best < LAW_SURELY else ""


def _weighed(
    recorded: Dataset, look: ComparedLevels, tell: Tell, *, held: bool
) -> tuple[WeighedLaw, ...]:
    """All laws, and with `held`, where none explains all, play of a gear that bears weight."""
    misses, found = look.misses, look.found
    system, weighed = system_of(misses.plain), ()
    if equivalent_share(found) > LINEARISED or placed(found) or look.rattles:
        seen = _refits(recorded, look) if look.rattles else ()
        weighed = weigh(recorded, misses, system, found, tell, seen)
    if not held or (weighed and weighed[0].explained > LAW_SURELY):
        return weighed
    there = weigh_held(recorded, misses, system, found, tell, everywhere=look.rattles)
    if look.rattles:
        return _best_of_each((*there, *weighed))
    first = [h for h in there[:1] if not weighed or _rather_held(h, weighed[0])]
    return _best_of_each((*first, *weighed)) if first else weighed


def _rather_held(held: WeighedLaw, free: WeighedLaw) -> bool:
    """Whether a gear that bears weight explains more; where a law does, of the same joint alone."""
    enough = free.explained > LAW_EXPLAINS
    return held.explained > free.explained and (held.at == free.at or not enough)


def _best_of_each(laws: Sequence[WeighedLaw]) -> tuple[WeighedLaw, ...]:
    """Each law of each joint once, where it explains most; first what explains most of all."""
    best: dict[tuple[str, str], WeighedLaw] = {}
    for law in sorted(laws, key=lambda w: -w.explained):
        best.setdefault((law.candidate.law.effect, law.at), law)
    return tuple(best.values())


def _refits(recorded: Dataset, look: ComparedLevels) -> tuple[Refit, ...]:
    """Of each force level, where each has lines enough for that."""
    try:
        return refits(recorded, look.problem.simulation)
    except InputError:
        return ()


def not_by_misses(recorded: Dataset, nominal: Simulation) -> tuple[Finding, ...]:
    """`unknown`, where hits differ by more than misses leave open; misses beyond any hand are none.

    As long as physics is missing, misses of hits seem to be larger than they are: that alone says
    nothing.
    """
    recorded = recorded.most_heard
    first = ComparedLevels.by(recorded, *next(bases(recorded, nominal)))
    if disproportion(first.found) < PROPORTIONAL:
        return ()
    text = (
        "Hits along one axis of a pose differ by more than any hand's misses explain, and not by "
        "their force alone. Look for play, loose parts, or contact with the surroundings."
    )
    return (Finding(UNKNOWN, None, excess(first.found) / 2, {}, text),)


def differ(recorded: Dataset, nominal: Simulation) -> bool:
    """Whether FRFs of different force levels differ by more than noise, hits being exact."""
    recorded = recorded.most_heard
    if len(recorded.level_n) < 2:
        return False
    found = equivalent(recorded, system_of(base(recorded, nominal)))
    return bool(len(found.count)) and disproportion(found) >= PROPORTIONAL


def _unknown(look: ComparedLevels, how: str) -> Finding:
    off = 100 * off_the_average(look.found)
    slight = off < 100 * look.levels_matter
    text = (
        "The response is not proportional to the force, and neither a single joint nor one law at "
        f"several joints describes how: {how}. "
    ) + (
        f"FRFs of single force levels are off their average by {off:.1f} % of |H| (rms) at most: "
        f"too little to matter, which begins at {100 * look.levels_matter:g} % here."
        if slight
        else "Look for contact with the surroundings, loose parts or clearance."
    )
    return Finding(UNKNOWN, None, excess(look.found) / 2, {}, text, slight=slight)


def _hardest(recorded: Dataset) -> Column:
    return max((c for group in recorded.columns for c in group), key=lambda c: c.peak_n)
