"""Answer of `import`: which hits were accepted, the modes they give, and what changed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType
from rich.text import Text

from planner.campaign.events import Question
from planner.errors import RefusedFile
from planner.report.answer import Done, plain
from planner.report.modes import mode_keys
from planner.report.predictions import ExpectedMode
from planner.report.text import SIMULATED, remarks, table, with_sd
from planner.words import command, counted, significant

if TYPE_CHECKING:
    from planner.campaign.imported_files import KnownFile
    from planner.campaign.importing import ImportReport
    from planner.campaign.model import Model


def _cells(mode: Mapping[str, Any], other: str) -> tuple[str, ...]:
    """A row of the table; `other` where the mode is none that is predicted."""
    expected = mode["expected"]
    return (
        other if mode["label"] is None else str(mode["label"]),
        with_sd(mode["frequency_hz"], mode["frequency_sd_hz"], ".3f"),
        with_sd(expected.frequency_hz, expected.sd_hz) if expected else "–",
        with_sd(100 * mode["damping_ratio"], 100 * mode["damping_sd"]),
    )


def asked_of(pose: str, question: Question | None) -> dict[str, Any] | None:
    """In JSON: the pose whose hits are held, then the question's own keys."""
    return None if question is None else {"pose": pose, **plain(question)}


@dataclass(frozen=True, eq=False)
class PoseImport:
    """What one pose's hits gave; hits by what a later `model` has learned, where one is given."""

    report: "ImportReport"
    model: "Model | None" = None

    @property
    def keys(self) -> dict[str, Any]:
        """Sds (count,) in % are over the workspace; "expected" of held hits at the stated pose.

        "copies" are those already imported that are other files of the same data.
        """
        report, measurement = self.report, self.report.measurement
        return {
            "pose": report.pose, "accepted": [hit.file for hit in report.accepted],
            "refused": self.refused, "already_imported": [one.file for one in report.already],
            "modes": self.modes, "refit_seconds": report.refit_seconds,
            "frequency_sd_percent_before": report.model_before.frequency_sd_percent,
            "frequency_sd_percent": report.model.frequency_sd_percent,
            "remarks": report.remarks, "amplitude": measurement.amplitude if measurement else None,
            "simulated": self.simulated, "hit_errors": report.hit_errors(self.model),
            "question": asked_of(report.pose, report.question),
            "expected": self.expected if report.question else (), "copies": self.copies,
        }  # fmt: skip

    @property
    def refused(self) -> tuple[RefusedFile, ...]:
        """Hits that are not used, those left out among them."""
        hits = (*self.report.refused, *self.report.left_out)
        return tuple(RefusedFile(hit.file, hit.reason) for hit in hits)

    @property
    def simulated(self) -> bool:
        """Whether its recordings are."""
        return bool(self.report.measurement and self.report.measurement.simulated)

    @property
    def copies(self) -> "list[KnownFile]":
        """Files that have the data of others that are in use."""
        return [one for one in self.report.already if one.copied]

    @cached_property
    def expected(self) -> tuple[ExpectedMode, ...]:
        """What the model before expected of the modes at the pose, in their order."""
        report = self.report
        if report.measurement is None:
            return ()
        joints = report.model.cell.robot.joints
        stated = joints.internal([report.measurement.joints_deg])
        stood = next((p.q[None] for p in report.model.labelled if p.pose == report.pose), stated)
        return ExpectedMode.all_of(report.model_before.predict(stood), 0)

    @cached_property
    def modes(self) -> list[dict[str, Any]]:
        """Those of the pose with label and expectation; unlikely ones only where labelled."""
        report, modes = self.report, []
        if report.measurement is None:
            return modes
        from planner.campaign.labels import found_modes  # and Pinocchio, where a model was fitted

        found = found_modes(report.pose, report.model, report.model_before)
        known = {one.mode.frequency_hz: one for one in found if one.mode}
        for mode in report.measurement.modes:
            one = known.get(mode.frequency_hz)
            if one is None and not mode.likely:
                continue
            label, sure, then = (one.label, one.probability, one.then) if one else (None,) * 3
            expected = None if then is None else self.expected[then - 1]
            said = {"label": label, "label_probability": sure, "expected": expected}
            modes.append(mode_keys(mode, **said))
        return modes

    def parts(self) -> list[RenderableType]:
        """Modes beside what was expected, remarks, and the change of the model, if there is any."""
        report, already = self.report, len(self.report.already)
        pose, asked = report.pose, report.question
        new = report.accepted or self.refused or asked
        if already and not new:  # all of it is in use
            before = self._copied() or f"{counted(already, 'file')} imported before as {pose}"
            return [Text(f"{before}; nothing changed.")]
        told = (*report.remarks, f"{self._copied()}.") if self.copies else report.remarks
        if not (report.accepted or self.modes or asked):
            known = f", {already} known before" if already else ""
            said = (
                f"Pose {pose}: no hit accepted, {len(self.refused)} refused{known}; nothing "
                f"changed, and the pose is still to be measured."
            )
            return [Text(said), *remarks(told)]
        made = table(
            f"Pose {pose}: {self._counts()}, {already} known before",
            *("mode", "frequency (Hz)", "expected (Hz)", "damping (%)"),
            rows=(_cells(mode, "–" if asked else "other") for mode in self.modes),
        )
        if asked:
            there = ", ".join(with_sd(mode.frequency_hz, mode.sd_hz) for mode in self.expected)
            held = "  The model has not changed: these hits are used once you confirm them."
            said = Text(f"  Expected at {pose}: {there} Hz.")
            return [made, said, *remarks(told), Text(held)]
        sds = (one.frequency_sd_percent for one in (report.model_before, report.model))
        change = [f"{significant(a)} → {significant(b)} %" for a, b in zip(*sds, strict=True)]
        count, refit = len(change), f"refit {report.refit_seconds:.2f} s"
        said = Text(f"  sd of the frequencies of modes 1 to {count}: {', '.join(change)} ({refit})")
        others = Text(f"  other: measured too, none of the {count} modes that are predicted")
        beside = [] if all(mode["label"] for mode in self.modes) else [others]
        return [made, *beside, *remarks(told), said]

    def _copied(self) -> str:
        """Which files have the data of others; "": none."""
        if not self.copies:
            return ""
        one, more = self.copies[0], len(self.copies) - 1
        are = "is a copy" if more == 1 else "are copies"
        others = f" ({counted(more, 'more file')} {are}, too)" if more else ""
        return (
            f"{one.file} has the same data as {one.first}, imported as {self.report.pose}{others}"
        )

    def _counts(self) -> str:
        """How many hits are used, held by the question, and refused."""
        asked = self.report.question
        held = sum(asked.text.startswith(f.reason) for f in self.refused) if asked else 0
        waiting = f", {held} held until the question is answered" if held else ""
        used = counted(len(self.report.accepted), "hit")
        return f"{used} accepted, {len(self.refused) - held} refused{waiting}"


def imported(
    reports: "Sequence[ImportReport]", directory: Path, simulated: bool
) -> tuple[Done, list[RefusedFile], list[str]]:
    """Answer of `import`, all that was refused, and what is asked, with commands that answer it.

    A pose after the other in recording order; the top-level keys speak of the last, "hit_errors"
    of all, by what all of them taught. "habits": what all hits of the campaign have in common, told
    once some are new. `simulated`: whether the campaign has simulated recordings.
    """
    model = reports[-1].model
    poses = [PoseImport(report, model) for report in reports]
    habits = model.systematic_hit_errors if any(one.accepted for one in reports) else ()
    each = [pose.keys for pose in poses]
    hits = [hit for keys in each for hit in keys["hit_errors"]]
    parts = [part for pose in poses for part in pose.parts()]
    parts += [Text(f"  {habit}") for habit in habits]
    parts += [SIMULATED] if simulated or any(pose.simulated for pose in poses) else []
    answer = Done({**each[-1], "hit_errors": hits, "habits": habits, "poses": each}, Group(*parts))
    asked = [how_to_answer(directory, r.pose, r.question) for r in reports if r.question]
    return answer, [file for pose in poses for file in pose.refused], asked


def how_to_answer(directory: Path | str, pose: str, asked: Question) -> str:
    """What is asked of held hits, and the commands that answer it, in one line."""
    confirm, withdraw = (
        command("planner", act, directory, pose) for act in ("confirm", "withdraw")
    )
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
            f"{asked.text} The new hits of {pose} are held, not used. Where files or angles of "
            f"{before} are wrong: {ask}, correct them, import its files "
            f"once more as another pose ({again}), {also}; if they are right, and those of "
            f"{'the new hits' if asked.fits == pose else pose} are wrong: {withdraw}."
        )
    if asked.disagree or asked.about:
        return (
            f"{asked.text} The new hits of {pose} are held, not used. If they are right: "
            f"{confirm}. If files or recordings.csv are wrong: correct them and import again "
            f"(--pose {pose}). To refuse all: {withdraw}. As if never "
            f"imported: {command('planner', 'undo', directory)}."
        )
    there = command(asked.fits or "OTHER")
    return (
        f"{asked.text} The new hits of {pose} are held, not used. If it is: {confirm}; if it is at "
        f"{there}: {confirm} --at {there}; else: {withdraw}."
    )
