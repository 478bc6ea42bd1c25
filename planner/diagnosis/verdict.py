"""Screens and linear effects together: one verdict, one list of candidates.

Screens look at what averaged FRFs hide: the measuring chain, the order in time, the force levels.
Artefacts are corrected before physics is looked for. Where a joint is nonlinear, or drifts,
averaged FRFs cannot be those of any linear effect, and none is looked for.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.diagnosis.finding import Finding
from planner.diagnosis.linear_diagnosis import Candidate, Diagnosis, Place, verdict_of
from planner.diagnosis.thresholds import ARTEFACTS, SCREEN_PRIOR, SUREST_SCREEN, UNKNOWN
from planner.inference.evidence import probability as posterior


@dataclass(frozen=True)
class Ranked:
    """Effects at their places that are there together, none of them if empty."""

    places: tuple[Place, ...]
    probability: float


@dataclass(frozen=True, eq=False)
class Together:
    """Verdict, all candidates (most probable first, summing to 1), and what screens established."""

    verdict: str
    candidates: tuple[Ranked, ...]
    established: tuple[tuple[Finding, float], ...]  # with their probabilities
    linear: bool  # whether linear effects belong to the findings too


def linear_effects_apply(findings: Sequence[Finding]) -> bool:
    """Whether averaged FRFs, once artefacts are corrected, may be those of linear effects."""
    return all(f.effect in (*ARTEFACTS, UNKNOWN) for f in findings)


def probability(finding: Finding) -> float:
    """Of what a screen found, from its evidence."""
    return min(SUREST_SCREEN, finding.sure, posterior(finding.log_evidence, SCREEN_PRIOR))


def _ways(findings: Sequence[Finding]) -> tuple[tuple[tuple[Place, ...], float], ...]:
    """What was found, and the same with a rival in a finding's stead; shares sum to one."""
    ways: list[tuple[tuple[Place, ...], float]] = [((), 1.0)]
    for f in findings:
        others = sum(share for _, share in f.rivals)
        names = ((f.effect, 1.0 - others), *f.rivals)
        ways = [((*way, (name, f.at)), w * share) for way, w in ways for name, share in names]
    return tuple(ways)


def together(
    findings: Sequence[Finding], diagnosis: Diagnosis, linear: bool | None = None
) -> Together:
    """Combine; `diagnosis` is that of the corrected FRFs.

    `linear`: whether its effects count, by default where no screen found other physics.
    """
    known = [(f, probability(f)) for f in findings if f.effect != UNKNOWN]
    strange = max((probability(f) for f in findings if f.effect == UNKNOWN), default=0.0)
    linear = linear_effects_apply(findings) if linear is None else linear
    others = diagnosis.candidates if linear else ()
    share = float(np.prod([p for _, p in known])) * (1 - strange)
    ways = _ways([f for f, _ in known])
    own = {("joint_stiffness", f.at) for f, _ in known}
    ranked = {("none", None): 0.0, (UNKNOWN, None): 1 - share}
    out: dict[tuple[Place, ...], float] = {(key,): value for key, value in ranked.items()}
    for places, weight in _linear(others) or (((), 1.0),):
        unknown = places == ((UNKNOWN, None),)
        for way, part in ways:
            # What a screen corrected for leaves a little of the same behind, and a joint's own
            # spring is part of its law.
            rest = tuple(p for p in places if p not in way and p not in own)
            key = places if unknown else (way + rest) or (("none", None),)
            out[key] = out.get(key, 0.0) + share * weight * part
    ranked_all = [Ranked(places, p) for places, p in out.items()]
    candidates = sorted(ranked_all, key=lambda r: -r.probability)
    verdict = verdict_of(candidates[0].places)
    told = tuple((f, p * (1.0 - sum(share for _, share in f.rivals))) for f, p in known)
    return Together(verdict, tuple(candidates), told, linear)


def _linear(candidates: Sequence[Candidate]) -> tuple[tuple[tuple[Place, ...], float], ...]:
    def places(candidate: Candidate) -> tuple[Place, ...]:
        return tuple(p for p in candidate.places if p[0] != "none")

    return tuple((places(c), c.probability) for c in candidates)
