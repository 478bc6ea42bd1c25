"""Effects that a diagnosis is sure of, each with its place, parameters and a sentence."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from planner.design.next_hit import in_words
from planner.report.place_names import with_names
from planner.words import probable

if TYPE_CHECKING:
    from planner.diagnosis.diagnose import Explained
    from planner.diagnosis.finding import Finding
    from planner.diagnosis.linear.drift_fit import DriftFits
    from planner.diagnosis.linear_diagnosis import Candidate, Diagnosis


@dataclass(frozen=True)
class ParameterValue:
    """A parameter of an effect with its standard deviation and unit."""

    value: float
    sd: float
    unit: str


@dataclass(frozen=True)
class EstablishedEffect:
    """An effect at its place, the probability that it is there, and its parameters by name."""

    effect: str
    at: str | None
    probability: float
    parameters: Mapping[str, ParameterValue]
    text: str


def established_effects(
    explained: "Explained", names: Mapping[str, str]
) -> tuple[EstablishedEffect, ...]:
    """Those of screens and of fits; `names` are the robot's own of places, see `place_names`."""
    whole = explained.whole
    found = tuple(_of_screen(finding, p) for finding, p in whole.established)
    if whole.linear:
        found += _of_fits(explained.judged.diagnosis)
    return tuple(replace(one, text=with_names(one.text, names)) for one in found)


def drift_of(explained: "Explained") -> "DriftFits | None":
    """The fits behind a drift that is established."""
    return next((f.drift_fits for f, _ in explained.whole.established if f.drift_fits), None)


def _of_fits(found: "Diagnosis") -> tuple[EstablishedEffect, ...]:
    """The effects of the best candidate, where there is one better than "none" and "unknown"."""
    if found.verdict != "explained":
        return ()
    first = found.candidates[0]
    assert first.fit is not None
    entries = []
    for effect in first.effects:
        values = first.fit.parameters(found.temper, effect)
        there = (c.probability for c in found.candidates if (effect.name, effect.at) in c.places)
        text = _text(found, first, effect.text(values))
        entries.append(
            EstablishedEffect(
                effect.name, effect.at, min(1.0, sum(there)), _parameters(values), text
            )
        )
    return tuple(entries)


def _of_screen(finding: "Finding", probability: float) -> EstablishedEffect:
    text = f"{finding.text} ({probable(probability)})"
    values = _parameters(finding.parameters)
    return EstablishedEffect(finding.effect, finding.at, probability, values, text)


def _parameters(values: Mapping[str, tuple[float, float, str]]) -> dict[str, ParameterValue]:
    return {name: ParameterValue(*value) for name, value in values.items()}


def _text(found: "Diagnosis", first: "Candidate", text: str) -> str:
    others = [c for c in found.undecided if c is not first]
    said = f"{text} ({probable(first.probability)})"
    if not others:
        return said
    names = "; ".join(in_words(c.places, c.probability) for c in others)
    return f"{said} These recordings cannot tell it from: {names}."
