"""All that is looked for before and beside the linear effects: artefacts, drift, force levels."""

from dataclasses import dataclass

from planner.dataset.dataset import Dataset
from planner.diagnosis.finding import Finding
from planner.diagnosis.linear.problem import tolerances_of
from planner.diagnosis.screens import artefacts, drift, force_levels
from planner.diagnosis.screens.hit_errors import HitErrors, beyond_any_hand, taken_out
from planner.diagnosis.thresholds import UNKNOWN
from planner.dynamics.simulation import Simulation
from planner.progress import Tell, quietly


@dataclass(frozen=True, eq=False)
class Screened:
    """What was found, artefacts first, and the recordings without artefacts and misses of hits.

    `hit_errors` are empty where the hits of a pose agree without looking for their misses, and
    where something else that matters makes them differ: a joint that is not linear, or what is
    unknown.
    """

    findings: tuple[Finding, ...]
    clean: Dataset
    missed: Dataset  # as `clean`, with the misses of hits
    hit_errors: HitErrors = ()


def screen(
    recorded: Dataset, nominal: Simulation, tell: Tell = quietly, *, chain: bool = True
) -> Screened:
    """Find artefacts first, so that they are not called physics, then the rest in clean data.

    Without `chain`, gains, signs, axes and delays of the sensors are taken as they are.
    """
    found = artefacts.screen(recorded, nominal, chain=chain)
    clean = artefacts.correct(recorded, found)
    by_level, missed = force_levels.screen(clean, nominal, tell=tell), clean
    if any(f.effect != UNKNOWN for f in by_level):
        return Screened((*found, *by_level), clean, missed)
    apart, errors = clean, ()
    if by_level or force_levels.differ(clean, nominal):
        tell("estimating by how much each hit missed its axis and point", 0.3)
        apart, errors = taken_out(clean, nominal)
        slight = all(f.slight for f in by_level)
        if slight and beyond_any_hand(errors, tolerances_of(nominal)):
            by_level = force_levels.not_by_misses(clean, nominal) or by_level
    by_time = drift.screen(apart, nominal)
    if by_time:
        # Levels are hit one after the other: what changes with time looks as if it went with them.
        return Screened((*found, *by_time), apart, missed, errors)
    if all(f.slight for f in by_level):
        return Screened((*found, *by_level), apart, missed, errors)
    return Screened((*found, *by_level), clean, missed)
