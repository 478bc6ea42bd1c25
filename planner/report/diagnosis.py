"""Answer of `diagnose`: the verdict, what was found, where, and how well it explains."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from planner.design.discrimination import LIKELY, ExtraSensor, NextHit, in_words
from planner.diagnosis.diagnose import Established, ThreefoldSimilarity
from planner.diagnosis.mismatch import MismatchPlaces, MismatchShares, Residuals, TwoMisfits
from planner.dynamics.at_force import change_at_force
from planner.effects.effect import Operator
from planner.errors import InputError, RefusedFile, writing
from planner.fit.departures import departures_text, masses_text
from planner.fit.posterior import RobotPosterior
from planner.measurement.agreement import Similarity, fit_similarity
from planner.report.answer import NOT_IN_JSON, Answer, encoded, plain
from planner.report.text import command_line, ending, remarks, table
from planner.robot.config import ParameterTable
from planner.robot.place_names import place_names, with_names
from planner.words import listed, probable

if TYPE_CHECKING:
    from planner.diagnosis.diagnose import Diagnosis
    from planner.diagnosis.odd_pose import OddPose
    from planner.diagnosis.verdict import Candidate
    from planner.robot.robot import Robot

SHOWN = 6  # candidates in the table
VERDICTS = {
    "consistent": "The simulation explains the recordings once its own parameters are refitted.",
    "explained": "The simulation alone does not explain the recordings; with this it does:",
    "unexplained": "Something makes the robot differ from the simulation, and none of the effects "
    "that planner knows describes it.",
}


@dataclass(frozen=True)
class EstablishedEffect:
    """An effect at its place, the probability that it is there, and its parameters by name.

    `change_percent` is by how much of |H| FRFs change when it is left out and the rest refitted;
    None of what signals alone tell.
    """

    effect: str
    at: str | None
    probability: float
    change_percent: float | None
    parameters: Mapping[str, ParameterTable]
    text: str


def established_effects(
    found: "Diagnosis", undecided: "Sequence[Candidate]", names: Mapping[str, str]
) -> tuple[EstablishedEffect, ...]:
    """Those of signals and of fits; `names` are the robot's own of places, see `place_names`."""

    def rest(e: Established) -> str:
        without = [c for c in undecided[1:] if (e.effect, e.at) not in c.places]
        if e.change is None or not without:
            return ""
        others = "; ".join(in_words(c.places, c.probability) for c in without)
        return f" These recordings cannot tell it from: {others}."

    return tuple(
        EstablishedEffect(
            e.effect, e.at, e.probability, None if e.change is None else 100 * e.change,
            {name: ParameterTable(*value) for name, value in e.parameters.items()},
            with_names(f"{e.text} (probability {probable(e.probability)}){rest(e)}", names),
        )
        for e in found.findings
    )  # fmt: skip


def at_places(places: Sequence[tuple[str, str | None]]) -> tuple[dict[str, str | None], ...]:
    """Effects of the library with their places; "none" and "unknown" are nowhere (None)."""
    return tuple({"effect": effect, "at": at} for effect, at in places)


def ranked(places: Sequence[tuple[str, str | None]], probability: float) -> dict[str, Any]:
    """Effects that are there together; "effect" and "at" are all their names in one."""
    names, at = [name for name, _ in places], [at for _, at in places if at]
    both = {"effect": " + ".join(names), "at": " + ".join(at) or None}
    return both | {"probability": probability, "effects": at_places(places)}


@dataclass(frozen=True, eq=False)
class DiagnosisReport(Answer):
    """Answer of `diagnose`; `candidates` are most probable first and sum to 1.

    `undecided` are those that the recordings cannot tell apart; `sets` name, for what was found,
    the effects any one of which may stand in its place; `next_sensor` is where one more sensor
    would part what is tied, `odd_pose` is the one at odds with all others. `closest` are the
    effects of the best fit, `diagnosis` holds all of them.
    """

    verdict: str
    findings: tuple[EstablishedEffect, ...]
    candidates: tuple[dict[str, Any], ...]
    undecided: tuple[tuple[tuple[str, str | None], ...], ...]
    sets: tuple[tuple[dict[str, str | None], ...], ...]
    where: MismatchPlaces
    fit: ThreefoldSimilarity
    held_out: ThreefoldSimilarity
    misfit: TwoMisfits
    shares: MismatchShares
    refused: tuple[RefusedFile, ...]
    remarks: tuple[str, ...]
    simulated: bool
    place_names: Mapping[str, str]
    npz: str | None = None
    robot: str | None = None
    written: Similarity | None = None  # of that robot alone at the measured poses
    urdf: Path | None = field(default=None, metadata=NOT_IN_JSON)
    campaign_robot: Path | None = field(default=None, metadata=NOT_IN_JSON)
    plots: tuple[str, ...] = ()
    rrd: str | None = field(default=None, metadata=NOT_IN_JSON)
    closest: tuple[tuple[str, str | None], ...] = field(default=(), metadata=NOT_IN_JSON)
    next: NextHit | None = None
    next_sensor: ExtraSensor | None = None
    odd_pose: "OddPose | None" = None
    seconds: float = 0.0
    diagnosis: "Diagnosis | None" = field(default=None, repr=False, metadata=NOT_IN_JSON)

    @property
    def found(self) -> "Diagnosis":
        """What is behind the answer."""
        assert self.diagnosis is not None
        return self.diagnosis

    def predict(
        self, q: np.ndarray, frequency_hz: np.ndarray, peak_force_n: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean, complex, and sd (n, 3, 3, F) of accelerances in m/s²/N with what was found.

        At poses q (n, dof) in rad and lines (F,) in Hz; of hits of peak_force_n (n,), for which
        joints that are not linear are linearised, else (NaN) as the recordings have them.
        """
        mean, sd = self.found.robot.predicted(q, frequency_hz)
        if peak_force_n is None:
            return mean, sd
        return mean + change_at_force(self.found.simulation, q, peak_force_n, frequency_hz), sd

    def with_predictions(
        self, poses: Sequence[str], q: np.ndarray, npz: Path, peak_force_n: np.ndarray | None = None
    ) -> "DiagnosisReport":
        """The same once FRFs as of `predict` are in the npz file; InputError if that cannot be."""
        from planner.frf.synthesis import frequency_lines
        from planner.report.predictions import save_frfs

        search = self.found.search
        lines = frequency_lines(search.band_hz)
        mean, sd = self.predict(q, lines, peak_force_n)
        robot = search.prior.effect_library.stiff.robot
        save_frfs(npz, lines, mean, sd, poses, robot, q)
        return replace(self, npz=str(npz))

    def write(self, folder: Path) -> "DiagnosisReport":
        """Write robot with what was found, URDF and pictures; InputError where that fails."""
        from planner.dynamics.simulation import Simulation
        from planner.fit.result import as_identification
        from planner.fit.write_robot import write_robot
        from planner.report.frf_plots import diagnosis_figures
        from planner.report.pictures import Pictures
        from planner.robot.robot import Robot

        found = self.found
        robot = found.search.prior.effect_library.stiff.robot
        _make_room(folder, robot)
        linear = as_identification(found.robot)
        result = replace(linear, simulation=found.simulation)
        made = write_robot(folder / "robot.toml", linear.simulation.robot, result, found.laws)
        again, search = Simulation(Robot.load(made.robot_toml)), found.search
        alone = fit_similarity(again, search.frfs, search.q, search.band_hz)
        drawn = Pictures(folder).write(
            lambda: diagnosis_figures(found), robot.name, simulated=self.simulated
        )
        said = *self.remarks, *made.remarks, *_unwritten(found)
        written = replace(
            self, robot=str(made.robot_toml), urdf=made.urdf, written=alone, remarks=said, **drawn
        )
        (folder / "diagnosis.json").write_bytes(encoded(written))  # for planner report
        return written

    def text(self) -> Group:
        """Verdict, findings, where, candidates, agreement, and the hit that would tell more."""
        parts: list[RenderableType] = [Text(self.verdict_text, style="bold")]
        parts += [Text(f"  {finding.text}") for finding in self.findings]
        parts.append(Text(self.where.sentence))
        parts += [Text(self.odd_pose.sentence, style="bold")] if self.odd_pose else []
        heading = "What was considered (an effect can be part of several)"
        made = table(heading, "effect", "at", "probability")
        for c in self.candidates[:SHOWN]:
            at = with_names(c["at"] or "–", self.place_names)
            made.add_row(c["effect"].replace("_", " "), at, probable(c["probability"]))
        parts += [made, self._agreement(), Text(self.shares.sentence)]
        more = (self.next, self.next_sensor)
        parts += [Text(one.sentence, style="bold") for one in more if one]
        parts += remarks(self.remarks)
        parts += [Text(f"Predictions: {self.npz}")] if self.npz else []
        parts += self._robot_text()
        return Group(*parts, *ending(vars(self)))

    def to_json(self) -> dict[str, Any]:
        """With the verdict, and what is said of a pose, in words."""
        said = super().to_json() | {"verdict_text": self.verdict_text}
        if self.odd_pose is not None:
            said["odd_pose"] = plain(self.odd_pose) | {"text": self.odd_pose.sentence}
        return said

    @property
    def verdict_text(self) -> str:
        """The verdict in words; where nothing describes it all, what comes nearest too."""
        first = self.candidates[0] if self.candidates else None
        if self.verdict != "unexplained" or not self.closest or first is None:
            return VERDICTS[self.verdict]
        near = listed([f"{name.replace('_', ' ')} at {at}" for name, at in self.closest])
        near = with_names(near, self.place_names)
        agrees = self.fit.explained.frac
        return (
            f"No effects that planner knows explain the recordings (probability "
            f"{probable(first['probability'])}). Closest, together: {near}; with them the FRFs' "
            f"FRAC is {100 * agrees:.2f} %. They may be most of the cause, with something unknown "
            f"beside them. Before you repair anything, check "
            f"sensor, hammer and the stated poses, and look for what else touched or hung on the "
            f"robot."
        )

    def _robot_text(self) -> list[Text]:
        """Both files of the robot, and the commands that put them into the campaign."""
        if self.robot is None or self.urdf is None:
            return []
        alone = self.written.frac if self.written else None
        agrees = "" if alone is None else f" (FRAC {100 * alone:.2f} % as it is written)"
        both = f"{self.robot}{agrees}, which needs {self.urdf.name} beside it"
        if self.verdict == "unexplained":
            doubt = "what was found does not explain the recordings: no campaign should use it."
            return [Text(f"Robot with what comes closest: {both}; {doubt}")]
        said = [Text(f"Robot with what was found: {both}")]
        if self.campaign_robot is None:
            return said
        said.append(Text("To let the campaign use it from its next command on, copy both:"))
        into = (self.urdf, self.campaign_robot.parent), (self.robot, self.campaign_robot)
        return said + [command_line("  ", "cp", *files) for files in into]

    def _agreement(self) -> RenderableType:
        made = table(
            f"Agreement with measured FRFs, FRAC / Frobenius in % ({self.seconds:.0f} s)",
            *("poses", "as given", "refitted", "explained"),
        )
        aside = self.held_out
        rows = [("used", self.fit)]
        if isinstance(aside.poses, tuple) and aside.poses:
            rows.append((f"held out: {', '.join(aside.poses)}", aside))
        for name, of in rows:
            sides = (of.nominal, of.refitted, of.explained)
            made.add_row(name, *(f"{100 * s.frac:.2f} / {100 * s.frobenius:.2f}" for s in sides))
        return made


def _make_room(folder: Path, robot: "Robot") -> None:
    """Make place for a robot's files in `folder`: earlier ones go, those that were given stay."""
    files = folder.absolute() / "robot.toml", folder.absolute() / robot.urdf_path.name
    given = {robot.path.resolve(), robot.urdf_path.resolve()}
    if given & {file.resolve() for file in files}:
        raise InputError(f"--out {folder} holds the robot that was given; name another folder.")
    with writing(folder):
        for file in files:
            file.unlink(missing_ok=True)


def _unwritten(found: "Diagnosis") -> tuple[str, ...]:
    """A remark for each effect that robot.toml has no entry for."""
    structure, gone = found.best.structure, []
    for effect, own in zip(structure.effects, structure.own, strict=True):
        psi, values = found.best.at.x[own], found.robot.values(effect)
        written = effect.inertia(psi), effect.losses(psi), effect.tables(values), effect.springs
        if type(effect).impedance is not Operator.impedance and not any(written):
            gone.append(effect.name)
    names = (" at ".join(name).replace("_", " ") for name in (*gone, *found.unwritten))
    return tuple(
        f"robot.toml has no entry for {name}: the robot that was written does without it."
        for name in names
    )


def diagnosis_report(found: "Diagnosis", odd: "OddPose | None" = None) -> DiagnosisReport:
    """Of a diagnosis."""
    recorded, verdict = found.recorded, found.verdict
    robot = found.search.prior.effect_library.stiff.robot
    matters, names = robot.config.diagnose.matters, place_names(robot)
    place = Residuals.of(found.refitted, found.search.band_hz, matters)
    sides = (RobotPosterior.of(f).misfits(matters)[0] for f in (found.refitted, found.best))
    aside = tuple(recorded.poses[i] for i in found.aside)
    undecided = [c for c in verdict.candidates if c.probability > LIKELY]
    there = found.best.structure, found.best.at.x
    masses = departures_text(*there, found.robot.sd) or masses_text(*there)
    return DiagnosisReport(
        verdict=verdict.verdict,
        findings=established_effects(found, undecided, names),
        place_names=names,
        candidates=tuple(ranked(c.places, c.probability) for c in verdict.candidates),
        undecided=tuple(c.places for c in undecided) if len(undecided) > 1 else (),
        sets=tuple(map(at_places, verdict.sets)),
        where=MismatchPlaces.of(place, recorded.poses),
        fit=found.fitted,
        held_out=replace(found.held_out or ThreefoldSimilarity(), poses=aside),
        misfit=TwoMisfits(*sides),
        shares=MismatchShares.of(found),
        refused=tuple(RefusedFile(*entry) for entry in recorded.refused),
        remarks=tuple(filter(None, (*recorded.remarks, *found.remarks, masses))),
        simulated=recorded.simulated,
        odd_pose=odd,
        closest=tuple(e.place for e in verdict.effects if e.counts),
        diagnosis=found,
    )
