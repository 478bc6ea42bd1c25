"""Answer of `diagnose`: the verdict, what was found, where, and how well it explains."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from planner.design.extra_sensor import ExtraSensor
from planner.design.next_hit import NextHit, in_words
from planner.diagnosis.thresholds import TIED, UNKNOWN
from planner.report.agreement import HeldOutSimilarities, ThreeSimilarities
from planner.report.answer import NOT_IN_JSON, Answer, RefusedFile, encoded, plain
from planner.report.established_effects import EstablishedEffect, drift_of, established_effects
from planner.report.mismatch import MismatchPlaces, MismatchShares, TwoMisfits
from planner.report.place_names import place_names, with_names
from planner.report.text import (
    SIMULATED,
    SIMULATED_TITLE,
    command_line,
    drawn,
    remarks,
    table,
)
from planner.words import probable

if TYPE_CHECKING:
    from planner.diagnosis.diagnose import Explained
    from planner.diagnosis.linear_diagnosis import Diagnosis
    from planner.diagnosis.odd_pose import OddPose
    from planner.diagnosis.verdict import Ranked

SHOWN = 6  # candidates in the table
VERDICTS = {
    "consistent": "The simulation explains the recordings once its own parameters are refitted.",
    "explained": "The simulation lacks something, and this explains the recordings:",
    "unexplained": "Something makes the robot differ from the simulation, and none of the effects "
    "that planner knows describes it.",
}


@dataclass(frozen=True)
class EffectAtPlace:
    """An effect of the library; "none" and "unknown" are nowhere (None)."""

    effect: str
    at: str | None


@dataclass(frozen=True)
class RankedExplanation:
    """Effects that are there together; `effect` and `at` are all their names in one."""

    effect: str
    at: str | None
    probability: float
    effects: tuple[EffectAtPlace, ...]

    @classmethod
    def of(
        cls, places: Sequence[tuple[str, str | None]], probability: float
    ) -> "RankedExplanation":
        """Of the effects' names and places."""
        names, at = [name for name, _ in places], [at for _, at in places if at]
        each = tuple(EffectAtPlace(*place) for place in places)
        return cls(" + ".join(names), " + ".join(at) or None, probability, each)


@dataclass(frozen=True, eq=False)
class DiagnosisReport(Answer):
    """Answer of `diagnose`; `candidates` are most probable first and sum to 1.

    `undecided` are those that the recordings cannot tell apart; `sets` name, for what was found,
    the effects any one of which may stand in its place; `next_sensor` is where one more sensor
    would part what is tied, `odd_pose` is the one at odds with all others. `explained` holds the
    fits.
    """

    verdict: str
    findings: tuple[EstablishedEffect, ...]
    candidates: tuple[RankedExplanation, ...]
    undecided: tuple[tuple[tuple[str, str | None], ...], ...]
    sets: tuple[tuple[EffectAtPlace, ...], ...]
    where: MismatchPlaces
    fit: ThreeSimilarities
    held_out: HeldOutSimilarities
    misfit: TwoMisfits
    shares: MismatchShares
    refused: tuple[RefusedFile, ...]
    remarks: tuple[str, ...]
    simulated: bool
    place_names: Mapping[str, str]
    npz: str | None = None
    robot: str | None = None
    urdf: Path | None = field(default=None, metadata=NOT_IN_JSON)
    campaign_robot: Path | None = field(default=None, metadata=NOT_IN_JSON)
    plots: tuple[str, ...] = ()
    next: NextHit | None = None
    next_sensor: ExtraSensor | None = None
    odd_pose: "OddPose | None" = None
    seconds: float = 0.0
    explained: "Explained | None" = field(default=None, repr=False, metadata=NOT_IN_JSON)

    @property
    def diagnosis(self) -> "Diagnosis":
        """The fits of linear effects behind the answer."""
        assert self.explained is not None
        return self.explained.judged.diagnosis

    def predict(self, q: np.ndarray, frequency_hz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """FRFs of the simulation with what was found, with their uncertainty.

        Args:
            q: Joint angles (n, dof) in rad.
            frequency_hz: Frequency lines (F,) in Hz.

        Returns:
            Mean (n, 3, 3, F), complex, and sd (n, 3, 3, F) of the accelerance in m/s²/N.
        """
        from planner.diagnosis.linear.predict import predicted

        found = self.diagnosis
        return predicted(found.problem, found.best, q, frequency_hz, found.temper)

    def with_predictions(self, poses: Sequence[str], q: np.ndarray, npz: Path) -> "DiagnosisReport":
        """The same once FRFs at poses q (n, dof) in rad (m) are in the npz file.

        Raises InputError where it cannot be written.
        """
        from planner.frf.synthesis import frequency_lines
        from planner.report.predictions import save_frfs

        lines = frequency_lines(self.diagnosis.problem.band_hz)
        mean, sd = self.predict(q, lines)
        joints = self.diagnosis.problem.simulation.robot.joints
        save_frfs(npz, lines, mean, sd, poses, joints, q)
        return replace(self, npz=str(npz))

    def write(self, folder: Path) -> "DiagnosisReport":
        """Write the robot with what was found, its URDF and pictures into a folder.

        Raises InputError where they cannot be written.
        """
        from planner.diagnosis.linear_diagnosis import Candidate, of_its_own
        from planner.diagnosis.write_explained import write_explained
        from planner.report.diagnosis_plots import diagnosis_figures
        from planner.report.plot_files import Pictures

        assert self.explained is not None
        found, robot = self.diagnosis, self.diagnosis.problem.simulation.robot
        parts = found.best.effect.parts()
        told = of_its_own(found.best, found.temper)
        places = {(e.name, e.at or None) for e in told}
        # As the answer has it, so that file and table agree.
        said = [(c, {(e.effect, e.at) for e in c.effects}) for c in self.candidates]
        share = sum(c.probability for c, its in said if its == (places or {("none", None)}))
        path = write_explained(folder, robot, found, Candidate(parts, share, found.best))
        mark = SIMULATED_TITLE if self.simulated else ""
        figures = diagnosis_figures(found, self.explained.recorded.poses, mark)
        plots = Pictures(folder).write(figures, robot.name)["plots"]
        urdf = path.parent / robot.urdf_path.name
        written = replace(self, robot=str(path), urdf=urdf, plots=plots)
        (folder / "diagnosis.json").write_bytes(encoded(written))  # for planner report
        return written

    def text(self) -> Group:
        """Verdict, findings, where, candidates, agreement, and the hit that would tell more."""
        parts: list[RenderableType] = [Text(self.verdict_text, style="bold")]
        parts += [Text(f"  {finding.text}") for finding in self.findings]
        parts.append(Text(self.where.sentence))
        parts += [Text(self.odd_pose.sentence, style="bold")] if self.odd_pose else []
        made = table("What was considered", "effect", "at", "probability")
        for c in self.candidates[:SHOWN]:
            at = with_names(c.at or "–", self.place_names)
            made.add_row(c.effect.replace("_", " "), at, probable(c.probability))
        parts += [made, self._agreement(), Text(self.shares.sentence)]
        more = (self.next, self.next_sensor)
        parts += [Text(one.sentence, style="bold") for one in more if one]
        parts += remarks(self.remarks)
        parts += [Text(f"Predictions: {self.npz}")] if self.npz else []
        parts += self._robot_text()
        parts += drawn(self.plots)
        return Group(*parts, SIMULATED) if self.simulated else Group(*parts)

    def to_json(self) -> dict[str, Any]:
        """With the verdict, and what is said of a pose, in words."""
        said = super().to_json() | {"verdict_text": self.verdict_text}
        if self.odd_pose is not None:
            said["odd_pose"] = plain(self.odd_pose) | {"text": self.odd_pose.sentence}
        return said

    @property
    def verdict_text(self) -> str:
        """The verdict in words; where nothing describes it all, what comes nearest too."""
        known = [c for c in self.candidates if c.effect not in (UNKNOWN, "none")]
        first = self.candidates[0] if self.candidates else None
        if self.verdict != "unexplained" or not known or first is None:
            return VERDICTS[self.verdict]
        near = in_words([(e.effect, e.at) for e in known[0].effects], known[0].probability)
        near = with_names(near, self.place_names)
        agrees = self.fit.explained.frac
        return (
            f"None of the effects that planner knows explains the recordings (probability "
            f"{probable(first.probability)}). Closest comes {near}: with it, simulated and "
            f"measured FRFs agree to {agrees:.4f} (FRAC; 1 is fully). That may be the larger part "
            f"of the cause, with something unknown beside it. Before you repair anything, check "
            f"sensor, hammer and the stated poses, and look for what else touched or hung on the "
            f"robot."
        )

    def _robot_text(self) -> list[Text]:
        """Both files of the robot, and the commands that put them into the campaign."""
        if self.robot is None or self.urdf is None:
            return []
        both = f"{self.robot}, which needs {self.urdf.name} beside it"
        said = [Text(f"Robot with what was found: {both}")]
        if self.campaign_robot is None:
            return said
        said.append(Text("To let the campaign use it from its next command on, copy both:"))
        into = (self.urdf, self.campaign_robot.parent), (self.robot, self.campaign_robot)
        return said + [command_line("  ", "cp", *files) for files in into]

    def _agreement(self) -> RenderableType:
        made = table(
            f"Agreement with measured FRFs, FRAC / Frobenius ({self.seconds:.0f} s)",
            *("poses", "as given", "refitted", "explained"),
        )
        aside = self.held_out
        rows: list[tuple[str, ThreeSimilarities | HeldOutSimilarities]] = [("used", self.fit)]
        if aside.poses:
            rows.append((f"held out: {', '.join(aside.poses)}", aside))
        for name, of in rows:
            sides = (of.nominal, of.refitted, of.explained)
            made.add_row(name, *(f"{s.frac:.4f} / {s.frobenius:.4f}" for s in sides))
        return made


def diagnosis_report(explained: "Explained") -> DiagnosisReport:
    """Of a diagnosis."""
    from planner.diagnosis.linear.predict import agreement
    from planner.diagnosis.residual_location import where

    recorded, judged, whole = explained.recorded, explained.judged, explained.whole
    found, fitted = judged.diagnosis, judged.fitted
    misfit = TwoMisfits(found.refitted.per_value, found.best.per_value)
    drift = None if found.best.effect.at else drift_of(explained)
    if drift is not None:
        fitted = agreement(drift.problem, drift.refitted, drift.best)
        misfit = TwoMisfits(drift.refitted.per_value, drift.best.per_value)
    place = where(found.problem, found.refitted)
    aside = tuple(recorded.poses[i] for i in judged.aside)
    names = place_names(found.problem.simulation.robot)
    return DiagnosisReport(
        verdict=whole.verdict,
        findings=established_effects(explained, names),
        place_names=names,
        candidates=tuple(RankedExplanation.of(c.places, c.probability) for c in whole.candidates),
        undecided=tuple(c.places for c in found.undecided),
        sets=alternatives(whole.candidates),
        where=MismatchPlaces(
            place.bands_hz(),
            tuple(dict.fromkeys(recorded.poses[i] for i in place.poses())),
            place.directions(),
        ),
        fit=ThreeSimilarities.of(fitted),
        held_out=HeldOutSimilarities.at(aside, judged.held_out),
        misfit=misfit,
        shares=MismatchShares.of(found, drift),
        refused=tuple(RefusedFile(*entry) for entry in recorded.refused),
        remarks=tuple(recorded.remarks),
        simulated=recorded.simulated,
        odd_pose=explained.odd,
        explained=explained,
    )


def alternatives(candidates: Sequence["Ranked"]) -> tuple[tuple[EffectAtPlace, ...], ...]:
    """Effects of the likeliest candidate with those that others, nearly as likely, have instead."""
    likely = [c.places for c in candidates if c.probability > TIED]
    if not likely:
        return ()
    out = []
    for place in likely[0]:
        rest = set(likely[0]) - {place}
        others = [set(places) - rest for places in likely[1:] if rest <= set(places)]
        instead = [next(iter(other)) for other in others if len(other) == 1]
        instead = [other for other in instead if other[0] not in ("none", UNKNOWN)]
        if instead and place[0] not in ("none", UNKNOWN):
            out.append(tuple(EffectAtPlace(*one) for one in (place, *instead)))
    return tuple(out)
