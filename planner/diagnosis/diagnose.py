"""The whole diagnosis in its order: chain, time and force levels; effects; both; a judgement."""

from dataclasses import dataclass, replace

import numpy as np

from planner.dataset.dataset import Dataset
from planner.diagnosis.finding import Finding
from planner.diagnosis.held_out_check import JudgedDiagnosis, judge
from planner.diagnosis.hidden_inertias import hidden_inertias
from planner.diagnosis.law_beside_linear import beside, leaves_room, of_levels
from planner.diagnosis.linear_diagnosis import Diagnosis, beside_another, diagnose
from planner.diagnosis.misses_again import abstained, asked_again
from planner.diagnosis.odd_pose import OddPose, odd_pose
from planner.diagnosis.revoked_artefacts import taken_back
from planner.diagnosis.screens import force_levels
from planner.diagnosis.screens.drift import along_a_joint, returned
from planner.diagnosis.screens.hit_errors import describe
from planner.diagnosis.screens.screen import screen
from planner.diagnosis.thresholds import (
    ARTEFACTS,
    DRIFT_CRUDE,
    DRIFT_GAINS,
    ODDS_OF_NOTHING,
    PAYS,
    SECOND_EFFECT,
    UNKNOWN,
)
from planner.diagnosis.verdict import Together, linear_effects_apply, together
from planner.dynamics.simulation import Simulation
from planner.progress import Tell, within


@dataclass(frozen=True, eq=False)
class Explained:
    """`recorded` as it was used, without artefacts; what explains it, judged; all candidates.

    `odd` is the pose that is at odds with all others, where nothing explains the recordings.
    """

    recorded: Dataset
    judged: JudgedDiagnosis
    whole: Together
    odd: OddPose | None = None


def explain(
    recorded: Dataset, simulation: Simulation, tell: Tell, *, chain: bool = True
) -> Explained:
    """What `simulation` lacks; hits are screened unless a window is stated that they carry.

    Without `chain` its artefacts are left to the effects.
    """
    tell("looking at the measuring chain, the order in time and the force levels", 0.02)
    as_recorded, screened = recorded, bool(recorded.visits) and not recorded.window_rate_1_s
    looked = _looked_at(recorded, simulation, within(tell, 0.02, 0.6), screened, chain=chain)
    if looked.doubtful:
        other = _looked_at(recorded, simulation, within(tell, 0.6, 0.85), screened, chain=False)
        looked = other if other.better_than(looked) else looked
    recorded, missed, findings, found = looked.clean, looked.missed, looked.findings, looked.found
    linear = linear_effects_apply(findings)
    tell("looking for a nonlinear joint beside it", 0.85)
    closer = within(tell, 0.85, 0.95)
    again = asked_again(missed, findings, found, closer) if screened else None
    if again is not None:
        findings, recorded = again[0], replace(again[1], remarks=recorded.remarks)
        linear = linear_effects_apply(findings)
    both = beside(missed, findings, found, closer) if screened and again is None else None
    if both is not None:
        findings, found = both
    elif not linear:
        found = replace(found, best=found.refitted)
    findings, wanted = abstained(findings)
    recorded = replace(recorded, remarks=(*recorded.remarks, *wanted))
    tell("judging at poses set aside", 0.95)
    judged = judge(found)
    counts = linear or both is not None or again is not None
    if counts:
        kept, found = taken_back(findings, judged.diagnosis)
        if len(kept) < len(findings):
            nothing_else = not any(e.at for e in found.candidates[0].effects)
            if chain and screened and (nothing_else or _laws_of_levels(as_recorded, simulation)):
                return explain(as_recorded, simulation, within(tell, 0.95, 1.0), chain=False)
            said = "A correction was undone: by the explanation found there was no such artefact."
            recorded = replace(recorded, remarks=(*recorded.remarks, said))
        findings, judged = kept, replace(judged, diagnosis=found)
    whole = together(findings, judged.diagnosis, counts)
    if whole.verdict == "consistent":
        said = hidden_inertias(judged.diagnosis)
        recorded = replace(recorded, remarks=(*recorded.remarks, *said))
    odd = None
    if whole.verdict == "unexplained":
        tell("looking for a pose at odds with the others", 0.97)
        odd = odd_pose(judged.diagnosis, recorded.poses)
    return Explained(recorded, judged, whole, odd)


def _laws_of_levels(recorded: Dataset, simulation: Simulation) -> bool:
    """Whether hits that were not corrected tell of a joint's law."""
    return any(f.effect != UNKNOWN for f in force_levels.screen(recorded, simulation, single=True))


@dataclass(frozen=True, eq=False)
class _Looked:
    """Recordings without artefacts and misses, and with the misses; what hits and FRFs say."""

    clean: Dataset
    missed: Dataset
    findings: tuple[Finding, ...]
    found: Diagnosis

    @property
    def of_chain(self) -> tuple[Finding, ...]:
        """Artefacts that only a simulation tells, not the force's own noise."""
        return tuple(
            f for f in self.findings if f.effect in ARTEFACTS and f.effect != "exponential_window"
        )

    @property
    def doubtful(self) -> bool:
        """Whether an artefact was told by a simulation that even then lacks what matters."""
        matters = self.found.problem.simulation.robot.config.diagnose.matters
        return (
            bool(self.of_chain)
            and linear_effects_apply(self.findings)
            and self.found.left > matters
        )

    def better_than(self, corrected: "_Looked") -> bool:
        """Whether recordings as they are say more than `corrected` ones, artefacts being rare."""
        rare = len(corrected.of_chain) * np.log(SECOND_EFFECT / ODDS_OF_NOTHING)
        return linear_effects_apply(self.findings) and (
            self.found.log_evidence > corrected.found.log_evidence + rare
        )


def _looked_at(
    recorded: Dataset, simulation: Simulation, tell: Tell, screened: bool, *, chain: bool = True
) -> _Looked:
    """What screens and FRFs say; without `chain` its artefacts are left to the effects."""
    findings, missed = (), recorded
    if screened:
        early = within(tell, 0.0, 0.2)
        recorded, missed, findings = _screened(recorded, simulation, early, chain)
    crude = [f for f in findings if f.effect == "drift" and _doubtful(f, recorded)]
    linear = linear_effects_apply([f for f in findings if f not in crude])
    found = diagnose(
        recorded.ended_frfs,
        recorded.q,
        simulation,
        effects=None if linear or leaves_room(findings) else (),
        bent=any(not f.slight for f in of_levels(findings)),
        tell=within(tell, 0.2, 1.0),
    )
    if found.verdict == "explained" and all(_rather(found, f) for f in crude):
        # Poses that were visited one after the other differ, and so do times.
        findings = tuple(f for f in findings if f not in crude)
    if any(f.effect in ARTEFACTS for f in findings):
        found = beside_another(found)
    return _Looked(recorded, missed, findings, found)


def _doubtful(drift: Finding, recorded: Dataset) -> bool:
    """Whether what goes with the pose may be what is told as drift."""
    swept = returned(recorded) is None and along_a_joint(recorded)
    return swept or drift.misfit > DRIFT_CRUDE or drift.gain < DRIFT_GAINS


def _rather(found: Diagnosis, drift: Finding) -> bool:
    """Whether linear effects explain clearly more than drift."""
    if drift.misfit > DRIFT_CRUDE:
        return drift.misfit > PAYS * found.best.per_value
    return found.refitted.per_value / found.best.per_value > PAYS * drift.gain


def _screened(
    recorded: Dataset, simulation: Simulation, tell: Tell, chain: bool
) -> tuple[Dataset, Dataset, tuple[Finding, ...]]:
    """Recordings corrected for artefacts and misses, for artefacts alone, and what hits say."""
    found = screen(recorded, simulation, tell, chain=chain)
    artefacts = [f.effect.replace("_", " ") for f in found.findings if f.effect in ARTEFACTS]
    said = [f"The recordings were corrected for: {', '.join(artefacts)}."] if artefacts else []
    if found.hit_errors:
        said.append(describe(found.hit_errors))
    if not said:
        return recorded, recorded, found.findings
    clean = replace(found.clean, remarks=(*recorded.remarks, *said))
    return clean, found.missed, found.findings
