"""All figures of a proof."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from planner.diagnosis.thresholds import ARTEFACTS
from planner.proof.curves import CLEARLY_NATS, MEASURES, clearly, curve, nameable, share
from planner.proof.score import DETECTABLE, Scored, Shown, calibration_error
from planner.report.answer import plain


def summary(scored: Sequence[Scored]) -> dict[str, Any]:
    """All figures of a proof, as JSON has them."""
    groups = {g: [s for s in scored if s.group == g] for g in sorted({s.group for s in scored})}
    effects = nameable(scored)
    found = {
        "groups": {name: share([s.right for s in chosen]) for name, chosen in groups.items()},
        "curves": {measure: curve(effects, measure) for measure in MEASURES},
        "clearly": {measure: clearly(effects, measure) for measure in MEASURES},
        **_silence(scored, groups),
        **_of_what_matters(scored),
        "calibration_error": calibration_error(scored),
        "calibration_error_with_imperfections": calibration_error(scored, "holds"),
        "calibration_error_of_what_matters": calibration_error(scored, "fair"),
        "coverage90": share([inside for s in scored for inside in _inside(s)]),
    }
    return plain(found) | _fits(scored)


def _silence(scored: Sequence[Scored], groups: dict[str, list[Scored]]) -> dict[str, Any]:
    """What is said where there is nothing, too little, or nothing that has a name."""
    faint = [s for s in scored if s.shown and all(e.nats_open < DETECTABLE for e in s.shown)]
    outsiders = [s for s in groups.get("outsider", []) if s.shown[0].nats_open >= CLEARLY_NATS]
    artefacts = groups.get("artefact", [])
    return {
        "cases_with_false_names": share([bool(s.false_names) for s in scored]),
        "nulls_silent": share(
            [s.verdict == "consistent" and not s.named for s in groups.get("null", [])]
        ),
        "undetectable_abstained": share([not s.false_names for s in faint]),
        "outsiders_unknown": share(
            [s.verdict == "unexplained" and not s.false_names for s in outsiders]
        ),
        "artefacts_called_physics": share(
            [any(name not in ARTEFACTS for name, _ in s.false_names) for s in artefacts]
        ),
        "failed": share([s.verdict == "failed" for s in scored]),
    }


def _of_what_matters(scored: Sequence[Scored]) -> dict[str, Any]:
    """The same where refitting the robot would leave more than a diagnosis may leave unsaid."""

    def clear(one: Shown) -> bool:
        return one.nats_open >= CLEARLY_NATS and one.matters

    effects = [e for e in nameable(scored) if clear(e)]
    outsiders = [s for s in scored if s.group == "outsider" and clear(s.shown[0])]
    return {
        "named_that_matter": share([e.named for e in effects]),
        "in_set_that_matter": share([e.in_set for e in effects]),
        "outsiders_unknown_that_matter": share(
            [s.verdict == "unexplained" and not s.false_names for s in outsiders]
        ),
        "fair": share([s.fair for s in scored]),
    }


def _inside(scored: Scored) -> list[bool]:
    inside, known = scored.covered
    return [k < inside for k in range(known)]


def _fits(scored: Sequence[Scored]) -> dict[str, Any]:
    """Agreement at poses that were not used, and time; of what did not fail."""
    done = [s for s in scored if s.verdict != "failed"]
    frac = [s.frac for s in done if np.isfinite(s.frac)]
    own = np.array([s.own_held_out for s in done if np.all(np.isfinite(s.own_held_out))])
    seconds = [s.seconds for s in done]
    return {
        "held_out_frac_median": float(np.median(frac)) if frac else None,
        "own_held_out": {
            side: float(np.median(own[:, k])) if len(own) else None
            for k, side in enumerate(("refitted", "explained"))
        },
        "worst_change_by_explaining": float(np.min(own[:, 1] - own[:, 0])) if len(own) else None,
        "seconds_median": float(np.median(seconds)) if seconds else None,
        "seconds_most": float(np.max(seconds)) if seconds else None,
    }
