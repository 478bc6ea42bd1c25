"""Effects that a diagnosis is sure of, each with its place, parameters and a sentence."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from planner.design.next_hit import in_words
from planner.robot.place_names import with_names
from planner.words import probable

if TYPE_CHECKING:
    from planner.diagnosis.diagnose import Diagnosis, Established
    from planner.diagnosis.verdict import Candidate


@dataclass(frozen=True)
class ParameterValue:
    """A parameter of an effect with its standard deviation and unit."""

    value: float
    sd: float
    unit: str


@dataclass(frozen=True)
class EstablishedEffect:
    """An effect at its place, the probability that it is there, and its parameters by name.

    `change_percent` is by how much of |H| FRFs change when it is left out and the rest refitted;
    None of what signals alone tell.
    """

    effect: str
    at: str | None
    probability: float
    change_percent: float | None
    parameters: Mapping[str, ParameterValue]
    text: str


def established_effects(
    found: "Diagnosis", undecided: "Sequence[Candidate]", names: Mapping[str, str]
) -> tuple[EstablishedEffect, ...]:
    """Those of signals and of fits; `names` are the robot's own of places, see `place_names`."""
    others = "; ".join(in_words(c.places, c.probability) for c in undecided[1:])
    rest = f" These recordings cannot tell it from: {others}." if others else ""
    return tuple(_of(e, "" if e.change is None else rest, names) for e in found.findings)


def _of(e: "Established", rest: str, names: Mapping[str, str]) -> EstablishedEffect:
    parameters = {name: ParameterValue(*value) for name, value in e.parameters.items()}
    text = with_names(f"{e.text} ({probable(e.probability)}){rest}", names)
    percent = None if e.change is None else 100 * e.change
    return EstablishedEffect(e.effect, e.at, e.probability, percent, parameters, text)
