"""An explanation judged where it was not fitted: one that predicts worse explains nothing."""

from dataclasses import dataclass, replace

from planner.diagnosis.linear.predict import ThreefoldSimilarity, agreement, held_out
from planner.diagnosis.linear_diagnosis import Candidate, Diagnosis
from planner.diagnosis.thresholds import HELD_OUT_DOUBTED, HELD_OUT_WORSE


@dataclass(frozen=True, eq=False)
class JudgedDiagnosis:
    """A diagnosis, and how its simulations agree with FRFs: as fitted, and at poses set aside."""

    diagnosis: Diagnosis
    fitted: ThreefoldSimilarity
    aside: tuple[int, ...]
    held_out: ThreefoldSimilarity | None


def judge(found: Diagnosis) -> JudgedDiagnosis:
    """Judge the best explanation at poses set aside; if it fails there it is given up.

    "unknown" then takes its probability, and the refitted simulation its place.
    """
    aside, judged = held_out(found.problem, found.refitted, found.best)
    if judged is not None and judged.explained.frac < judged.refitted.frac - HELD_OUT_WORSE:
        found = _given_up(found)
        judged = replace(judged, explained=judged.refitted)
    return JudgedDiagnosis(
        found, agreement(found.problem, found.refitted, found.best), aside, judged
    )


def _given_up(found: Diagnosis) -> Diagnosis:
    def doubted(candidate: Candidate) -> Candidate:
        return replace(candidate, probability=HELD_OUT_DOUBTED * candidate.probability)

    unknown = [c for c in found.candidates if c.fit is None]
    others = [doubted(c) for c in found.candidates if c.fit is not None]
    rest = 1.0 - sum(c.probability for c in others)
    ranked = (replace(unknown[0], probability=rest) if unknown else Candidate((), rest, None),)
    return replace(found, verdict="unexplained", candidates=(*ranked, *others), best=found.refitted)
