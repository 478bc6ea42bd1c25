"""Answer of `diagnose`: the verdict, what was found, where, and how well it explains."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from planner.design.next_hit import NextHit, in_words
from planner.report.agreement import HeldOutSimilarities, ThreeSimilarities
from planner.report.answer import NOT_IN_JSON, Answer, RefusedFile
from planner.report.text import SIMULATED, SIMULATED_TITLE, drawn, remarks, table

if TYPE_CHECKING:
    from planner.diagnosis.diagnose import Explained
    from planner.diagnosis.finding import Finding
    from planner.diagnosis.linear_diagnosis import Candidate, Diagnosis

SHOWN = 6  # candidates in the table
VERDICTS = {
    "consistent": "The simulation explains the recordings once its own parameters are refitted.",
    "explained": "The simulation lacks something, and this explains the recordings:",
    "unexplained": "Something is there that no effect of the library describes.",
}


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


@dataclass(frozen=True)
class MismatchPlaces:
    """Where the refitted simulation misses the recordings clearly."""

    bands_hz: list[list[float]]
    poses: tuple[str, ...]
    directions: list[str]

    @property
    def sentence(self) -> str:
        """For the engineer."""
        if not self.bands_hz:
            return "Refitted, the simulation misses the recordings in no band clearly."
        bands = ", ".join(f"{low:.0f} to {high:.0f}" for low, high in self.bands_hz)
        return (
            f"Refitted without any effect, the simulation misses the recordings at {bands} Hz, at "
            f"poses {', '.join(self.poses) or '–'}, along {', '.join(self.directions) or '–'}."
        )


@dataclass(frozen=True)
class TwoMisfits:
    """χ² per value, 1 at the noise: of the refitted simulation, and with what explains it."""

    refitted: float
    explained: float


@dataclass(frozen=True, eq=False)
class DiagnosisReport(Answer):
    """Answer of `diagnose`; `candidates` are most probable first and sum to 1.

    `undecided` are those that the recordings cannot tell apart; `explained` holds the fits.
    """

    verdict: str
    findings: tuple[EstablishedEffect, ...]
    candidates: tuple[RankedExplanation, ...]
    undecided: tuple[tuple[tuple[str, str | None], ...], ...]
    where: MismatchPlaces
    fit: ThreeSimilarities
    held_out: HeldOutSimilarities
    misfit: TwoMisfits
    refused: tuple[RefusedFile, ...]
    remarks: tuple[str, ...]
    simulated: bool
    npz: str | None = None
    robot: str | None = None
    plots: tuple[str, ...] = ()
    next: NextHit | None = None
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

    def with_predictions(
        self, poses: Sequence[str], joints_deg: np.ndarray, npz: Path
    ) -> "DiagnosisReport":
        """The same once FRFs at poses with joint angles (n, dof) in degrees are in the npz file.

        Raises InputError where it cannot be written.
        """
        from planner.frf.frequency_lines import frequency_lines
        from planner.report.predictions import save_frfs

        lines = frequency_lines(self.diagnosis.problem.band_hz)
        mean, sd = self.predict(np.deg2rad(joints_deg), lines)
        save_frfs(npz, lines, mean, sd, poses, joints_deg)
        return replace(self, npz=str(npz))

    def write(self, folder: Path) -> "DiagnosisReport":
        """Write the robot with what was found, its URDF and pictures into a folder.

        Raises InputError where they cannot be written.
        """
        from planner.diagnosis.linear_diagnosis import Candidate
        from planner.diagnosis.write_explained import write_explained
        from planner.report.diagnosis_plots import diagnosis_figures
        from planner.report.plot_files import Pictures

        assert self.explained is not None
        found, robot = self.diagnosis, self.diagnosis.problem.simulation.robot
        parts = found.best.effect.parts()
        places = {(e.name, e.at or None) for e in parts}
        share = sum(c.probability for c in found.candidates if set(c.places) == places)
        path = write_explained(folder, robot, found, Candidate(parts, share, found.best))
        mark = SIMULATED_TITLE if self.simulated else ""
        figures = diagnosis_figures(found, self.explained.recorded.poses, mark)
        plots = Pictures(folder).write(figures, robot.name)["plots"]
        return replace(self, robot=str(path), plots=plots)

    def text(self) -> Group:
        """Verdict, findings, where, candidates, agreement, and the hit that would tell more."""
        parts: list[RenderableType] = [Text(VERDICTS[self.verdict], style="bold")]
        parts += [Text(f"  {finding.text}") for finding in self.findings]
        parts.append(Text(self.where.sentence))
        made = table("What was considered", "effect", "at", "probability")
        for c in self.candidates[:SHOWN]:
            made.add_row(c.effect.replace("_", " "), c.at or "–", f"{100 * c.probability:.1f} %")
        parts += [made, self._agreement()]
        if self.next:
            parts.append(Text(self.next.sentence, style="bold"))
        parts += remarks(self.remarks)
        files = (("Predictions", self.npz), ("Robot with what was found", self.robot))
        parts += [Text(f"{what}: {path}") for what, path in files if path]
        parts += drawn(self.plots)
        return Group(*parts, SIMULATED) if self.simulated else Group(*parts)

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
    from planner.diagnosis.residual_location import where

    recorded, judged, whole = explained.recorded, explained.judged, explained.whole
    found = judged.diagnosis
    place = where(found.problem, found.refitted)
    aside = tuple(recorded.poses[i] for i in judged.aside)
    screened = tuple(_of_screen(finding, p) for finding, p in whole.established)
    return DiagnosisReport(
        verdict=whole.verdict,
        findings=screened + (_of_fits(found) if whole.linear else ()),
        candidates=tuple(RankedExplanation.of(c.places, c.probability) for c in whole.candidates),
        undecided=tuple(c.places for c in found.undecided),
        where=MismatchPlaces(
            place.bands_hz(), tuple(recorded.poses[i] for i in place.poses()), place.directions()
        ),
        fit=ThreeSimilarities.of(judged.fitted),
        held_out=HeldOutSimilarities.at(aside, judged.held_out),
        misfit=TwoMisfits(found.refitted.per_value, found.best.per_value),
        refused=tuple(RefusedFile(*entry) for entry in recorded.refused),
        remarks=tuple(recorded.remarks),
        simulated=recorded.simulated,
        explained=explained,
    )


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
    text = f"{finding.text} ({100 * probability:.0f} %)"
    values = _parameters(finding.parameters)
    return EstablishedEffect(finding.effect, finding.at, probability, values, text)


def _parameters(values: Mapping[str, tuple[float, float, str]]) -> dict[str, ParameterValue]:
    return {name: ParameterValue(*value) for name, value in values.items()}


def _text(found: "Diagnosis", first: "Candidate", text: str) -> str:
    others = [c for c in found.undecided if c is not first]
    said = f"{text} ({100 * first.probability:.0f} %)"
    if not others:
        return said
    names = "; ".join(in_words(c.places, c.probability) for c in others)
    return f"{said} These recordings cannot tell it from: {names}."
