"""Answer of `import`: which hits were accepted, the modes they give, and what changed."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from planner.campaign.events import Question
from planner.campaign.hit_errors import HitErrorEstimate
from planner.modal.modes import Homogeneity
from planner.report.answer import Answer, RefusedFile, plain
from planner.report.modes import ModeAnswer
from planner.report.predictions import ExpectedMode
from planner.report.text import SIMULATED, remarks, table, with_sd
from planner.words import command, counted, significant

ANSWERS = "confirm", "withdraw"  # to a question of held hits

if TYPE_CHECKING:
    from planner.campaign.imported_files import KnownFile
    from planner.campaign.importing import ImportReport
    from planner.campaign.model import Model


NOT_USED = "  Nothing changed: these hits are used once you say that they are right."


def _cells(mode: ModeAnswer, other: str) -> tuple[str, ...]:
    """A row of the table; `other` where the mode is none that is predicted."""
    expected = mode.expected
    known = isinstance(expected, ExpectedMode)
    return (
        other if mode.label is None else str(mode.label),
        with_sd(mode.frequency_hz, mode.frequency_sd_hz, ".3f"),
        with_sd(expected.frequency_hz, expected.sd_hz) if known else with_sd(None, None),
        with_sd(100 * mode.damping_ratio, 100 * mode.damping_sd),
    )


def asked_of(pose: str, question: Question | None) -> dict[str, Any] | None:
    """In JSON: the pose whose hits are held, then the question's own keys."""
    return None if question is None else {"pose": pose, **plain(question)}


@dataclass(frozen=True, eq=False)
class PoseImport(Answer):
    """What one pose's hits gave; sds (count,) in % are over the workspace, before and after."""

    pose: str
    accepted: tuple[str, ...]
    refused: tuple[RefusedFile, ...]
    already_imported: tuple[str, ...]
    modes: tuple[ModeAnswer, ...]
    refit_seconds: float
    frequency_sd_percent_before: np.ndarray
    frequency_sd_percent: np.ndarray
    remarks: tuple[str, ...]
    amplitude: Homogeneity | None
    simulated: bool
    hit_errors: tuple[HitErrorEstimate, ...] = ()
    question: Question | None = None
    expected: tuple[ExpectedMode, ...] = ()  # of held hits at the pose that is stated
    copies: "tuple[KnownFile, ...]" = ()  # of those already imported, other files of the same data

    @classmethod
    def of(cls, report: "ImportReport", model: "Model | None" = None) -> "PoseImport":
        """Of what the campaign says of one pose; hits by a later `model` where one is given."""
        measurement = report.measurement
        return cls(
            pose=report.pose,
            accepted=tuple(hit.file for hit in report.accepted),
            refused=tuple(
                RefusedFile(hit.file, hit.reason) for hit in (*report.refused, *report.left_out)
            ),
            already_imported=tuple(one.file for one in report.already),
            copies=tuple(one for one in report.already if one.copied),
            modes=_labelled_modes(report),
            refit_seconds=report.refit_seconds,
            frequency_sd_percent_before=report.model_before.frequency_sd_percent,
            frequency_sd_percent=report.model.frequency_sd_percent,
            remarks=report.remarks,
            amplitude=measurement.amplitude if measurement else None,
            simulated=bool(measurement and measurement.simulated),
            hit_errors=report.hit_errors(model),
            question=report.question,
            expected=_expected(report) if report.question else (),
        )

    def to_json(self) -> dict[str, Any]:
        """With the pose of the question."""
        return super().to_json() | {"question": asked_of(self.pose, self.question)}

    def parts(self) -> list[RenderableType]:
        """Modes beside what was expected, remarks, and the change of the model, if there is any."""
        if self.known:
            files = counted(len(self.already_imported), "file")
            before = self._copied() or f"{files} imported before as {self.pose}"
            return [Text(f"{before}; nothing changed.")]
        told = (*self.remarks, f"{self._copied()}.") if self.copies else self.remarks
        if self.unhit:
            already = len(self.already_imported)
            known = f", {already} known before" if already else ""
            said = (
                f"Pose {self.pose}: no hit accepted, {len(self.refused)} refused{known}; nothing "
                f"changed, and the pose is still to be measured."
            )
            return [Text(said), *remarks(told)]
        made = table(
            f"Pose {self.pose}: {self._counts()}, {len(self.already_imported)} known before",
            *("mode", "frequency (Hz)", "expected (Hz)", "damping (%)"),
            rows=(_cells(mode, "–" if self.question else "other") for mode in self.modes),
        )
        if self.question:
            there = ", ".join(with_sd(mode.frequency_hz, mode.sd_hz) for mode in self.expected)
            said = Text(f"  Expected at {self.pose}: {there} Hz.")
            return [made, said, *remarks(told), Text(NOT_USED)]
        both = zip(self.frequency_sd_percent_before, self.frequency_sd_percent, strict=True)
        change = ", ".join(
            f"{significant(before)} → {significant(after)} %" for before, after in both
        )
        count = len(self.frequency_sd_percent)
        refit = f"refit {self.refit_seconds:.2f} s"
        said = Text(f"  sd of the frequencies of modes 1 to {count}: {change} ({refit})")
        others = Text(f"  other: measured too, none of the {count} modes that are predicted")
        beside = [] if all(mode.label for mode in self.modes) else [others]
        return [made, *beside, *remarks(told), said]

    def _copied(self) -> str:
        """Which files have the data of others; "": none."""
        if not self.copies:
            return ""
        one, more = self.copies[0], len(self.copies) - 1
        are = "is a copy" if more == 1 else "are copies"
        others = f" ({counted(more, 'more file')} {are}, too)" if more else ""
        return f"{one.file} has the same data as {one.first}, imported as {self.pose}{others}"

    def _counts(self) -> str:
        """How many hits are used, held by the question, and refused."""
        asked = self.question.text if self.question else ""
        held = sum(asked.startswith(file.reason) for file in self.refused) if asked else 0
        waiting = f", {held} held until the question is answered" if held else ""
        used = counted(len(self.accepted), "hit")
        return f"{used} accepted, {len(self.refused) - held} refused{waiting}"

    @property
    def known(self) -> bool:
        """Whether all of it is in use already."""
        new = self.accepted or self.refused or self.question
        return bool(self.already_imported) and not new

    @property
    def unhit(self) -> bool:
        """Whether nothing came of it: no hit was accepted, nor is one held."""
        return not (self.accepted or self.modes or self.question)


@dataclass(frozen=True)
class ImportedPoses(Answer):
    """Answer of `import`, one entry a pose in recording order.

    `habits`: what all hits of the campaign have in common, told once some are new.
    """

    poses: tuple[PoseImport, ...]
    habits: tuple[str, ...] = ()
    simulated: bool = False  # whether the campaign has simulated recordings

    @classmethod
    def of(cls, reports: "tuple[ImportReport, ...]", simulated: bool = False) -> "ImportedPoses":
        """Of what `Campaign.import_paths` gave; hits are told by what all of them taught."""
        model = reports[-1].model
        poses = tuple(PoseImport.of(report, model) for report in reports)
        common = model.systematic_hit_errors if any(pose.accepted for pose in poses) else ()
        return cls(poses, common, simulated or any(pose.simulated for pose in poses))

    @property
    def hit_errors(self) -> tuple[HitErrorEstimate, ...]:
        """Of all accepted hits."""
        return tuple(hit for pose in self.poses for hit in pose.hit_errors)

    def to_json(self) -> dict[str, Any]:
        """The top-level keys speak of the last pose, "hit_errors" of all; "poses" of each."""
        said = {"hit_errors": self.hit_errors, "habits": self.habits, "poses": self.poses}
        return {**self.poses[-1].to_json(), **{key: plain(value) for key, value in said.items()}}

    @property
    def refused(self) -> tuple[RefusedFile, ...]:
        """Of all poses."""
        return tuple(file for pose in self.poses for file in pose.refused)

    def to_be_answered(self, directory: Path) -> list[str]:
        """What is asked of held hits, with the commands that answer it, a line each."""
        held = ((pose.pose, pose.question) for pose in self.poses)
        return [how_to_answer(directory, pose, asked) for pose, asked in held if asked]

    def text(self) -> Group:
        """Pose by pose."""
        parts = [part for pose in self.poses for part in pose.parts()]
        parts += [Text(f"  {habit}") for habit in self.habits]
        return Group(*parts, SIMULATED) if self.simulated else Group(*parts)


def how_to_answer(directory: Path | str, pose: str, asked: Question) -> str:
    """What is asked of held hits, and the commands that answer it, in one line."""
    confirm, withdraw = (command("planner", act, directory, pose) for act in ANSWERS)
    if asked.about == "earlier":
        wrong = command("planner", "withdraw", directory, asked.fits)
        again = command("planner", "import", directory, "FOLDER", "--pose", f"{asked.fits}b")
        before, ask, also = asked.fits, wrong, f"then {confirm}"
        if asked.fits == pose:  # `withdraw` and `confirm` are of the new hits while these are held
            before = f"those of {pose} before"
            ask = f"{command('planner', 'undo', directory)}, {wrong}"
            own = command("planner", "import", directory, "FOLDER", "--pose", f"{pose}c")
            also = f"then import the new ones as one of their own ({own})"
        return (
            f"{asked.text} The new hits of {pose} are held, not used. Where the angles of "
            f"{before} are wrong: {ask}, correct them in recordings.csv, import its files "
            f"once more as another pose ({again}), {also}; if they are right, and those of "
            f"{'the new hits' if asked.fits == pose else pose} are wrong: {withdraw}."
        )
    if asked.disagree or asked.about:
        return (
            f"{asked.text} The new hits of {pose} are held, not used. If they are right: "
            f"{confirm}. If files or recordings.csv are wrong: correct them and import again "
            f"(--pose {pose}). To refuse all: {withdraw}. To undo the import: "
            f"{command('planner', 'undo', directory)}."
        )
    there = command(asked.fits or "OTHER")
    return (
        f"{asked.text} The new hits of {pose} are held, not used. If it is: {confirm}; if it is at "
        f"{there}: {confirm} --at {there}; else: {withdraw}."
    )


def _expected(report: "ImportReport") -> tuple[ExpectedMode, ...]:
    """What the model before expected of the modes at the pose, in their order."""
    if report.measurement is None:
        return ()
    joints = report.model.cell.robot.joints
    before = report.model_before.predict(joints.internal([report.measurement.joints_deg]))
    return tuple(ExpectedMode.all_of(before, 0))


def _labelled_modes(report: "ImportReport") -> tuple[ModeAnswer, ...]:
    """Modes of the pose with their label and expectation; unlikely ones only where labelled."""
    if report.measurement is None:
        return ()
    labelled = next((p for p in report.model.labelled if p.pose == report.pose), None)
    expected = _expected(report)
    labels = {m.frequency_hz: k for k, m in enumerate(labelled.modes) if m} if labelled else {}
    sure = labelled.probability if labelled else ()
    found = []
    for mode in report.measurement.modes:
        k = labels.get(mode.frequency_hz)
        known = (None, None, None) if k is None else (k + 1, float(sure[k]), expected[k])
        if k is not None or mode.likely:
            said = dict(zip(("label", "label_probability", "expected"), known, strict=True))
            found.append(ModeAnswer.of(mode, **said))
    return tuple(found)
