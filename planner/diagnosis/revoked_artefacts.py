"""Artefacts that recordings were corrected for, and that the explanation then puts back.

They are looked for before any physics is known, and what the simulation lacks can look like one:
corrected recordings are explained by the physics together with the opposite artefact.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.finding import Finding
from planner.diagnosis.linear_diagnosis import Candidate, Diagnosis
from planner.diagnosis.thresholds import REVOKED_LEFT, REVOKING


def taken_back(
    findings: Sequence[Finding], found: Diagnosis
) -> tuple[tuple[Finding, ...], Diagnosis]:
    """What was found without artefacts that the best explanation undoes, and it without them."""
    undone = [f for f in findings if _undone(f, found)]
    places = {(f.effect, f.at) for f in undone}
    kept = tuple(f for f in findings if f not in undone)
    if not undone:
        return kept, found
    return kept, replace(found, candidates=tuple(_without(places, c) for c in found.candidates))


def _without(places: set[tuple[str, str | None]], candidate: Candidate) -> Candidate:
    if candidate.fit is None:
        return candidate
    rest = tuple(e for e in candidate.effects if (e.name, e.at) not in places)
    return replace(candidate, effects=rest or (Effect(""),))


def _undone(finding: Finding, found: Diagnosis) -> bool:
    place = finding.effect, finding.at
    first = found.candidates[0]
    part = next((e for e in first.effects if (e.name, e.at) == place), None)
    if part is None or first.fit is None:
        return False
    if sum(c.probability for c in found.candidates if place in c.places) < REVOKING:
        return False
    again = first.fit.parameters(found.temper, part)
    there, back = _size(finding.parameters), _size(again)
    return there is not None and back is not None and abs(there + back) < REVOKED_LEFT * abs(there)


def _size(parameters: dict[str, tuple[float, float, str]]) -> float | None:
    """Of a delay in s or, as a logarithm, of a gain; of anything else nothing is said."""
    if "delay" in parameters:
        return parameters["delay"][0]
    return float(np.log(parameters["gain"][0])) if "gain" in parameters else None
