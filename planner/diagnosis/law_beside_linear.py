"""A nonlinear joint beside a linear effect: looked for where neither explains enough alone.

The nonlinear joint bends the averaged FRFs, so that no linear effect reaches their noise; and what
the simulation lacks spoils the fit of any law to the hits. Each is therefore asked again with what
the other has told.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.dataset.dataset import Dataset
from planner.diagnosis.finding import Finding
from planner.diagnosis.linear_diagnosis import Candidate, Diagnosis
from planner.diagnosis.screens import force_levels
from planner.diagnosis.thresholds import (
    AT_NOISE,
    LAW_BETTER,
    LAW_CRUDE,
    LAWS_OF_JOINTS,
    PAYS,
    UNKNOWN,
)
from planner.diagnosis.write_explained import possible_simulation
from planner.progress import Tell, quietly

# What a joint's own law looks like on average: but not as closely as what is really there.
OWN = "joint_stiffness", "angle_dependent_stiffness"


def of_levels(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """What the force levels tell: laws of joints, or that nothing known explains them."""
    return tuple(f for f in findings if f.effect in (*LAWS_OF_JOINTS, UNKNOWN))


def leaves_room(findings: Sequence[Finding]) -> bool:
    """Whether a joint's law was found, and so crude a fit that something may be beside it.

    Laws of several joints are not fitted closely enough to tell.
    """
    laws = [f for f in findings if f.effect in LAWS_OF_JOINTS]
    return len(laws) == 1 and laws[0].misfit > LAW_CRUDE


def beside(
    recorded: Dataset, findings: Sequence[Finding], found: Diagnosis, tell: Tell = quietly
) -> tuple[tuple[Finding, ...], Diagnosis] | None:
    """Findings of the levels once the best linear effect is known, and the diagnosis beside them.

    `findings` are those of the levels without it, "unknown" or a crude law; None where the linear
    effect does not help.
    """
    before = of_levels(findings)
    own = {(name, f.at) for f in before for name in OWN}
    possible = [
        c
        for c in found.candidates
        if _physical(c) and (not own.intersection(c.places) or _at_the_noise(c))
    ]
    linear = _simplest(found, possible)
    if not before or linear is None or linear.fit is None:
        return None
    pays = found.refitted.per_value > PAYS * linear.fit.per_value
    if not pays and found.verdict != "explained":
        return None
    tried = (_with_law(recorded, found, c, tell) for c in _with_parts(linear, possible))
    both = [b for b in tried if b is not None]
    least = min((b.law.misfit for b in both), default=np.inf)
    if not both or least * LAW_BETTER > min(f.misfit for f in before):
        return None
    chosen = min((b for b in both if b.law.misfit <= PAYS * least), key=lambda b: b.numbers)
    linear, again = chosen.linear, chosen.findings
    assert linear.fit is not None
    kept = [f for f in findings if f not in before and f.effect != "joint_stiffness"]
    # Springs make up for what averages tell wrongly of the linear effect.
    again = [f for f in again if f.effect != "joint_stiffness"]
    there = [c for c in possible if _numbers(c) <= _numbers(linear)]
    total = sum(c.probability for c in there)
    ranked = tuple(replace(c, probability=c.probability / total) for c in there if total)
    ranked = ranked or (replace(linear, probability=1.0),)
    return (*kept, *again), replace(found, candidates=ranked, verdict="explained", best=linear.fit)


@dataclass(frozen=True)
class _Both:
    """A linear explanation, and what the force levels tell beside it: the joint's `law` first."""

    linear: Candidate
    findings: tuple[Finding, ...]
    law: Finding

    @property
    def numbers(self) -> tuple[int, int]:
        """See `_numbers`."""
        return _numbers(self.linear)


def _with_law(recorded: Dataset, found: Diagnosis, linear: Candidate, tell: Tell) -> _Both | None:
    """None where no robot has what explains the averages, or the levels tell of no law then."""
    explained = possible_simulation(found, linear)
    if explained is None:
        return None
    again = force_levels.screen(recorded, explained, single=True, tell=tell)
    law = next((f for f in again if f.effect in LAWS_OF_JOINTS), None)
    return None if law is None else _Both(linear, again, law)


def _with_parts(whole: Candidate, possible: Sequence[Candidate]) -> list[Candidate]:
    """An explanation, and those by some of its effects: the others may stand for the law alone."""
    parts = [c for c in possible if c.fit is not None and set(c.places) < set(whole.places)]
    return [whole, *parts]


def _simplest(found: Diagnosis, possible: Sequence[Candidate]) -> Candidate | None:
    """The candidate with the fewest effects, then numbers, among those that fit nearly as well.

    More effects and numbers imitate what the nonlinear joint does to averaged FRFs. Among equally
    simple ones it is the likeliest.
    """
    lines = found.refitted.misfit.counts.sum()
    settled = [
        (c, c.fit.per_value)
        for c in possible
        if c.fit is not None and c.fit.misfit.counts.sum() == lines
    ]
    if not settled:
        return None
    least = min(misfit for _, misfit in settled)
    enough = [c for c, misfit in settled if misfit <= PAYS * least]
    return min(enough, key=_numbers)


def _numbers(candidate: Candidate) -> tuple[int, int]:
    """How many effects a candidate has, and how many free parameters those add."""
    assert candidate.fit is not None
    simulation = candidate.fit.misfit.setting.simulation
    chosen = (len(e.quantities) + len(e.springs(simulation)) for e in candidate.effects)
    return len(candidate.effects), sum(chosen)


def _at_the_noise(candidate: Candidate) -> bool:
    return candidate.fit is not None and candidate.fit.per_value <= AT_NOISE


def _physical(candidate: Candidate) -> bool:
    """Whether it is an effect of the robot, neither nothing nor unknown nor an artefact."""
    return bool(candidate.effects) and all(e.at and not e.artefact for e in candidate.effects)
