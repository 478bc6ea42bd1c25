"""An explanation judged where it was not fitted: one that predicts worse explains nothing."""

from dataclasses import dataclass, replace

from planner.diagnosis.linear.predict import ThreefoldSimilarity, agreement, held_out
from planner.diagnosis.linear_diagnosis import Candidate, Diagnosis
from planner.diagnosis.thresholds import (
    HELD_OUT_DOUBTED,
    HELD_OUT_GROWN,
    HELD_OUT_SHOWS,
    HELD_OUT_WORSE,
)

LESSER = 3  # parts of an explanation that are tried where the whole fails at poses set aside


@dataclass(frozen=True, eq=False)
class JudgedDiagnosis:
    """A diagnosis, and how its simulations agree with FRFs: as fitted, and at poses set aside."""

    diagnosis: Diagnosis
    fitted: ThreefoldSimilarity
    aside: tuple[int, ...]
    held_out: ThreefoldSimilarity | None


def judge(found: Diagnosis) -> JudgedDiagnosis:
    """Judge the best explanation at poses set aside; if it fails there it is given up.

    The likeliest part of it that does not fail takes its probability. If none is left "unknown"
    does, and the refitted simulation takes its place.
    """
    aside, judged = held_out(found.problem, found.refitted, found.best)
    # Refitting alone explains nothing that could be given up.
    if judged is not None and found.best.effect.at and _fails(judged):
        for lesser in _lesser(found)[:LESSER]:
            _, other = held_out(found.problem, found.refitted, lesser.best)
            if other is not None and not _fails(other):
                found, judged = lesser, other
                break
        else:
            found = _given_up(found)
            judged = replace(judged, explained=judged.refitted)
    return JudgedDiagnosis(
        found, agreement(found.problem, found.refitted, found.best), aside, judged
    )


def _fails(judged: ThreefoldSimilarity) -> bool:
    """Whether it predicts worse; where both predict well, by how much of the little that is off."""
    before, after = judged.refitted, judged.explained
    grown = 1 - after.frac > HELD_OUT_GROWN * (1 - before.frac)
    shows = before.frac - after.frac > HELD_OUT_SHOWS
    less_alike = before.frobenius - after.frobenius > HELD_OUT_SHOWS
    return after.frac < before.frac - HELD_OUT_WORSE or (grown and shows and less_alike)


def _lesser(found: Diagnosis) -> list[Diagnosis]:
    """The diagnosis with a part of its best explanation in that one's stead, likeliest first."""
    whole = next((c for c in found.candidates if c.fit is found.best), None)
    if whole is None:
        return []
    out = []
    for part in found.candidates:
        if part.fit is None or not part.effects[0].at or not set(part.places) < set(whole.places):
            continue
        taken = replace(part, probability=part.probability + whole.probability)
        emptied = replace(whole, probability=0.0)
        rest = [c for c in found.candidates if c is not part and c is not whole]
        ranked = tuple(sorted((taken, emptied, *rest), key=lambda c: -c.probability))
        if ranked[0] is taken and taken.fit is not None:
            out.append(replace(found, candidates=ranked, best=taken.fit))
    return out


def _given_up(found: Diagnosis) -> Diagnosis:
    def doubted(candidate: Candidate) -> Candidate:
        return replace(candidate, probability=HELD_OUT_DOUBTED * candidate.probability)

    unknown = [c for c in found.candidates if c.fit is None]
    others = [doubted(c) for c in found.candidates if c.fit is not None]
    rest = 1.0 - sum(c.probability for c in others)
    ranked = (replace(unknown[0], probability=rest) if unknown else Candidate((), rest, None),)
    return replace(found, verdict="unexplained", candidates=(*ranked, *others), best=found.refitted)
