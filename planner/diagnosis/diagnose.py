"""The whole diagnosis in its order: chain, time and force levels; effects; both; a judgement."""

from dataclasses import dataclass, replace

from planner.dataset.recorded import Recorded
from planner.dataset.visits import Recorded as Visits
from planner.dataset.windowed import corrected
from planner.diagnosis.finding import Finding
from planner.diagnosis.held_out_check import JudgedDiagnosis, judge
from planner.diagnosis.law_beside_linear import beside, leaves_room, of_levels
from planner.diagnosis.linear_diagnosis import beside_another, diagnose
from planner.diagnosis.revoked_artefacts import taken_back
from planner.diagnosis.screens.screen import screen
from planner.diagnosis.thresholds import ARTEFACTS
from planner.diagnosis.verdict import Together, linear_effects_apply, together
from planner.dynamics.simulation import Simulation
from planner.progress import Tell, within


@dataclass(frozen=True, eq=False)
class Explained:
    """`recorded` as it was used, without artefacts; what explains it, judged; all candidates."""

    recorded: Recorded
    judged: JudgedDiagnosis
    whole: Together


def explain(
    recorded: Recorded, visits: Visits | None, simulation: Simulation, tell: Tell
) -> Explained:
    """What `simulation` lacks; `visits` are the hits themselves, None where there are only FRFs."""
    tell("looking at the measuring chain, the order in time and the force levels", 0.02)
    recorded, visits, findings = _screened(recorded, visits, simulation, within(tell, 0.02, 0.2))
    linear = linear_effects_apply(findings)
    found = diagnose(
        recorded.frfs,
        recorded.q,
        simulation,
        effects=None if linear or leaves_room(findings) else (),
        bent=bool(of_levels(findings)),
        tell=within(tell, 0.2, 0.85),
    )
    if any(f.effect in ARTEFACTS for f in findings):
        found = beside_another(found)
    tell("looking for a nonlinear joint beside it", 0.85)
    closer = within(tell, 0.85, 0.95)
    both = beside(visits, findings, found, closer) if visits is not None else None
    if both is not None:
        findings, found = both
    elif not linear:
        found = replace(found, best=found.refitted)
    tell("judging at poses set aside", 0.95)
    judged = judge(found)
    counts = linear or both is not None
    if counts:
        kept, found = taken_back(findings, judged.diagnosis)
        if len(kept) < len(findings):
            said = "What explains them takes a correction back: there was no such artefact."
            recorded = replace(recorded, remarks=(*recorded.remarks, said))
        findings, judged = kept, replace(judged, diagnosis=found)
    whole = together(findings, judged.diagnosis, counts)
    return Explained(recorded, judged, whole)


def _screened(
    recorded: Recorded, visits: Visits | None, simulation: Simulation, tell: Tell
) -> tuple[Recorded, Visits | None, tuple[Finding, ...]]:
    """Recordings and hits corrected for artefacts, and what the hits themselves say."""
    if visits is None:
        return recorded, None, ()
    found = screen(visits, simulation, tell)
    artefacts = [f.effect.replace("_", " ") for f in found.findings if f.effect in ARTEFACTS]
    if artefacts:
        said = f"The recordings were corrected for: {', '.join(artefacts)}."
        remarks = (*recorded.remarks, said)
        recorded = replace(corrected(recorded, found.clean), remarks=remarks)
    return recorded, found.clean, found.findings
