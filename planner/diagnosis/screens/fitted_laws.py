"""Laws of single joints, fitted to the hits of all force levels, many roughly and few closely."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from planner.dataset.dataset import Dataset
from planner.diagnosis.laws.equivalent_stiffness import Equivalent, System
from planner.diagnosis.laws.fit_in_time import BATCH_DAMPING, LawProblem, advance
from planner.diagnosis.laws.law_at_joints import LawAtJoints, LawMisfit
from planner.diagnosis.laws.level_data import (
    equivalent_slopes,
    level_data,
    own_parameter,
    strongest_slopes,
)
from planner.diagnosis.laws.level_refits import Refit, starts_by_level
from planner.diagnosis.laws.open_misses import OpenMisses
from planner.diagnosis.laws.starting_values import held_starts, starts
from planner.diagnosis.screens.weighed_laws import WeighedLaw, levels_of, weighed_laws
from planner.diagnosis.thresholds import LAW_HOPEFUL
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


def weigh(
    recorded: Dataset,
    misses: OpenMisses,
    system: System,
    found: Equivalent,
    tell: Tell = quietly,
    seen: Sequence[Refit] = (),
) -> tuple[WeighedLaw, ...]:
    """Every law at the joints that come into question, fitted in time, most probable first.

    Fits begin where hits by themselves say, and at all joints where `seen` refits of levels do.
    """
    plain, problem = misses.plain, _problem(recorded, misses)
    left = found.chi2.sum(axis=0)
    order = np.argsort(left)[:JOINTS]
    begin: list[LawAtJoints] = []
    for port in (int(j) for j in order if left[j] < ALSO * left[order[0]]):
        own = own_parameter(plain, int(system.blocks[port]))
        begin += starts(found, system, port, plain.x, own)
    for port in range(len(system.ports) if seen else 0):  # hits by themselves don't say which
        own = own_parameter(plain, int(system.blocks[port]))
        begin += starts_by_level(seen, system, port, plain.x, own)
    return _fitted(problem, begin, system, found, tell)


def weigh_held(
    recorded: Dataset,
    misses: OpenMisses,
    system: System,
    found: Equivalent,
    tell: Tell = quietly,
    *,
    everywhere: bool = False,
) -> tuple[WeighedLaw, ...]:
    """Backlash of the likeliest joint, which its weight holds at one end of the gap.

    Nothing where it has no weight to bear. `everywhere`: of all joints, where equivalent
    stiffnesses do not tell which.
    """
    plain = misses.plain
    order = np.argsort(found.chi2.sum(axis=0)).tolist()
    sag = plain.misfit.setting.simulation.elastic.sag(recorded.visit_q)[:, system.blocks]
    begin: list[LawAtJoints] = []
    for port in order if everywhere else order[:1]:
        begin += held_starts(found, system, port, plain.x, sag[:, port])
    return _fitted(_problem(recorded, misses), begin, system, found, tell) if begin else ()


def _problem(recorded: Dataset, misses: OpenMisses) -> LawProblem:
    data = level_data(recorded, misses.plain, misses)
    return LawProblem(data, misses.plain, data.hits, strongest_slopes(data, misses.plain))


def _fitted(
    problem: LawProblem,
    laws: Sequence[LawAtJoints],
    system: System,
    found: Equivalent,
    tell: Tell,
) -> tuple[WeighedLaw, ...]:
    """Laws from where they begin, the best of each joint and kind to the end."""
    tell("fitting every law at single joints to the hits", 0.5)
    begin = [problem.start(law, BATCH_DAMPING) for law in laws]
    begun = _best_of_each(advance(problem, begin, 0), STARTS)
    rough = _held_otherwise(problem, _best_of_each(advance(problem, begun, ROUNDS), 1))
    best = min(fit.at.chi2 for fit in rough)
    tell("following the best laws", 0.6)
    kept = advance(problem, [f for f in rough if f.at.chi2 < HOPELESS * best], MORE)
    kept = _held_otherwise(problem, kept)
    ends, levels = [fit.at for fit in kept], levels_of(problem.data, system)
    first = min(ends, key=lambda c: c.value)
    # Laws are weighed one against the other: those half-way would be wronged.
    told = [c for c in ends if c is first or levels.explained(c) > LAW_HOPEFUL]
    tell("fitting the best laws to the end", 0.8)
    last = side_by_side(partial(_followed, problem, found), told)
    rest = (c for c in ends if all(c is not t for t in told))
    return weighed_laws(problem.data, system, [*last, *rest])


def _held_otherwise(
    problem: LawProblem, fits: Sequence[Iterate[LawMisfit]]
) -> list[Iterate[LawMisfit]]:
    """Fits, or those of joints of which gears bear another share of the weight, where it fits."""
    out = []
    for fit in fits:
        law = fit.at.law
        shares = {min(law.borne * factor, 1.0) for factor in OTHERWISE} - {law.borne}
        begin = [problem.start(replace(law, borne=share), BATCH_DAMPING) for share in shares]
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
