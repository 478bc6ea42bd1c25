"""Misses of hits told again by the simulation that explains the averages.

How a hit missed is told by what the simulation says of forces across its axis and of moments. As
long as physics is missing that is not right, and what is left looks as if the structure were not
linear. Once the averages are explained, the same hits are asked again.
"""

from planner.dataset.dataset import Dataset
from planner.diagnosis.finding import Finding
from planner.diagnosis.linear.problem import tolerances_of
from planner.diagnosis.linear_diagnosis import Diagnosis
from planner.diagnosis.screens import force_levels
from planner.diagnosis.screens.hit_errors import beyond_any_hand, taken_out
from planner.diagnosis.thresholds import AT_NOISE, UNKNOWN
from planner.diagnosis.write_explained import possible_simulation
from planner.progress import Tell, quietly


def asked_again(
    hits: Dataset, findings: tuple[Finding, ...], found: Diagnosis, tell: Tell = quietly
) -> tuple[tuple[Finding, ...], Dataset] | None:
    """Findings and recordings without misses, by the best explanation of the averages.

    `hits` are the recordings with their misses, `findings` those made without knowing that
    explanation. None where nothing unknown was found in the force levels, where the averages are
    not explained to their noise, or where the levels still differ by what matters.
    """
    first = found.candidates[0]
    if not any(f.effect == UNKNOWN for f in findings) or first.fit is None:
        return None
    if found.verdict != "explained" or first.fit.per_value > AT_NOISE:
        return None
    simulation = possible_simulation(found, first)
    if simulation is None:
        return None
    again = force_levels.screen(hits, simulation, single=True, tell=tell)
    if any(f.effect == UNKNOWN and not f.slight for f in again):
        return None
    apart, errors = taken_out(hits, simulation)
    if beyond_any_hand(errors, tolerances_of(simulation)):
        return None
    kept = tuple(f for f in findings if f.effect != UNKNOWN)
    return (*kept, *again), apart


def abstained(findings: tuple[Finding, ...]) -> tuple[tuple[Finding, ...], tuple[str, ...]]:
    """The findings that can be told and matter, and remarks: on what can't be told before more is
    measured, and on what is known of the unknown."""
    told = tuple(f for f in findings if not f.wants and not f.slight)
    said = (f.wants or (f.text if f.effect == UNKNOWN else "") for f in findings)
    return told, tuple(filter(None, said))
