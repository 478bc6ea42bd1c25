"""A nonlinear joint beside a linear effect: looked for where neither explains enough alone.

The nonlinear joint bends the averaged FRFs, so that no linear effect reaches their noise; and what
the simulation lacks spoils the fit of any law to the hits. Each is therefore asked again with what
the other has told.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from planner.dataset.dataset import Dataset
from planner.diagnosis.finding import Finding
from planner.diagnosis.linear.search import ENOUGH
from planner.diagnosis.linear_diagnosis import Candidate, Diagnosis
from planner.diagnosis.screens import force_levels
from planner.diagnosis.write_explained import write_explained
from planner.dynamics.simulation import Simulation
from planner.progress import Tell, quietly
from planner.robot.robot import Robot

PAYS = 1.5  # factor by which a linear effect has to lower the misfit of averaged FRFs
CRUDE = 3.0  # χ² per value from which a law leaves room for something beside it
# What a joint's own law looks like on average: but not as closely as what is really there.
OWN = "joint_stiffness", "angle_dependent_stiffness"
BETTER = 1.5  # factor by which the linear effect then has to lower it


def of_levels(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """What the force levels tell: laws of joints, or that nothing known explains them."""
    return tuple(f for f in findings if f.effect in (*force_levels.LAWS, "unknown"))


def leaves_room(findings: Sequence[Finding]) -> bool:
    """Whether a joint's law was found, and so crude a fit that something may be beside it.

    Laws of several joints are not fitted closely enough to tell.
    """
    laws = [f for f in findings if f.effect in force_levels.LAWS]
    return len(laws) == 1 and laws[0].misfit > CRUDE


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
    with tempfile.TemporaryDirectory() as folder:
        robot = found.problem.simulation.robot
        path = write_explained(Path(folder), robot, found, linear)
        again = force_levels.screen(recorded, Simulation(Robot.load(path)), single=True, tell=tell)
    law = next((f for f in again if f.effect in force_levels.LAWS), None)
    if law is None or law.misfit * BETTER > min(f.misfit for f in before):
        return None
    kept = [f for f in findings if f not in before and f.effect != "joint_stiffness"]
    # Springs make up for what averages tell wrongly of the linear effect.
    again = [f for f in again if f.effect != "joint_stiffness"]
    there = [c for c in possible if _numbers(c) <= _numbers(linear)]
    total = sum(c.probability for c in there)
    ranked = tuple(replace(c, probability=c.probability / total) for c in there if total)
    ranked = ranked or (replace(linear, probability=1.0),)
    return (*kept, *again), replace(found, candidates=ranked, verdict="explained", best=linear.fit)


def _simplest(found: Diagnosis, possible: Sequence[Candidate]) -> Candidate | None:
    """The fewest linear effects with the fewest numbers: more of them imitate what bends.

    Of alike ones the likeliest.
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
    """Of effects, and of numbers that they may choose."""
    assert candidate.fit is not None
    simulation = candidate.fit.misfit.setting.simulation
    chosen = (len(e.quantities) + len(e.springs(simulation)) for e in candidate.effects)
    return len(candidate.effects), sum(chosen)


def _at_the_noise(candidate: Candidate) -> bool:
    return candidate.fit is not None and candidate.fit.per_value <= ENOUGH


def _physical(candidate: Candidate) -> bool:
    """Whether it is an effect of the robot, neither nothing nor unknown nor an artefact."""
    return bool(candidate.effects) and all(e.at and not e.artefact for e in candidate.effects)
