"""What the session shows, as rich renderables; units in every column."""

import numpy as np
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.text import Text

from planner.campaign.events import HitRecord, Question
from planner.campaign.importing import ImportReport
from planner.campaign.labels import found_modes
from planner.campaign.model import Model
from planner.report.text import SIMULATED, plain_table, sds_over_workspace, with_sd
from planner.session.pose_screen import PosePage, remedy_first
from planner.words import counted, short_name, significant

HELP = """\
a     accept: import the good hits, refit, go on
r, R  refuse bad hits, or all
k     skip this pose, and those near it if you type what is in the way
b, h  late hits: b, they are from the pose named; h, from this one
h     hits in doubt: they are right
s     star this pose, for a second look later (★ in status and report)
u, U  undo the last act; redo it
q     quit; all is on disk: the same command goes on from here
+x, +y, +z: the tcp's axes, seen from the base; hits against them count, too
±     one standard deviation (sd)"""
NONE_BAD = "No hit is bad: press r again, or R, to refuse all that wait."
NOTHING_NEW = "Nothing to import yet: no new recording is whole and usable."
FULLY, SHORTLY = 2, 4  # refusals that are said in full, and those of which is said what to do


def import_panel(report: ImportReport, simulated: bool) -> RenderableType:
    """What came out against what was expected."""
    table = plain_table(
        "mode", "measured (Hz)", "expected (Hz)", "off by (sd)", "damping (%)", "number sure (%)"
    )
    for one in found_modes(report.pose, report.model, report.model_before):
        expected, mode = with_sd(one.expected_hz, one.sd_hz), one.mode
        certain = "bold yellow" if one.probability < 0.9 else ""
        sure = Text(f"{100 * one.probability:.0f}", style=certain)
        if mode is None:
            table.add_row(str(one.label), "not found", expected, "–", "–", sure)
            continue
        off = Text(f"{one.off:+z.1f}", style="bold yellow" if abs(one.off) > 3 else "")
        measured = with_sd(mode.frequency_hz, mode.frequency_sd_hz, ".3f")
        damping = with_sd(100 * mode.damping_ratio, 100 * mode.damping_sd)
        table.add_row(str(one.label), measured, expected, off, damping, sure)
    parts: list[RenderableType] = [table, *_missed(report)]
    parts += [Text(_refused(hit), style="red") for hit in report.refused]
    parts += [Text(remark, style="yellow") for remark in report.remarks]
    target = report.model.cell.config.stop.frequency_sd_percent
    parts.append(Text(sds_over_workspace(report.model.frequency_sd_percent, target)))
    parts += [SIMULATED] if simulated else []
    title = f"Pose {report.pose}: {_in(report)}"
    return Panel(Group(*parts), title=title, title_align="left", expand=False)


def refusals(report: ImportReport) -> str:
    """Why hits were refused; of more than fit under a page what to do alone."""
    hits = report.refused
    if len(hits) <= FULLY:
        return "\n".join(_refused(hit) for hit in hits)
    said = [f"refused {short_name(hit.file)}: {remedy_first(hit.reason)[0]}" for hit in hits]
    more = len(said) - SHORTLY
    return "\n".join(said[:SHORTLY] + ([f"and {more} more: planner status"] if more > 0 else []))


def _refused(hit: HitRecord) -> str:
    return f"refused {short_name(hit.file)}: {' '.join(remedy_first(hit.reason))}".strip()


def _missed(report: ImportReport) -> list[RenderableType]:
    """Hit by hit, how it missed, and what the hits so far have in common."""
    hits = report.hit_errors()
    if not hits:
        return []
    rows = plain_table("hit", "tilt of its direction", "beside the point")
    for column in rows.columns[1:]:  # a number and its sd stay on one line, names may break
        column.no_wrap = True
    for hit in hits:
        rows.add_row(*hit.cells)
    habits = report.model.systematic_hit_errors
    return [Text(""), rows, *(Text(habit, style="bold") for habit in habits)]


def question_panel(question: Question, pose: str, other: str) -> RenderableType:
    """What is asked of held hits, and the keys; `other` is the open pose they may be from."""
    keys = f"[a] yes, use them at {pose}  [r] no, refuse them  "
    keys += f"[o] no, they are from {other}  " if other else ""
    text = Text(question.text, style="bold red")
    more = "They are kept, and not used until you answer."
    if question.about == "earlier":
        more += (
            f" Where the angles of {question.fits} are wrong: [q], planner withdraw DIR "
            f"{question.fits}, import its files once more as another pose with right angles, and "
            f"go on with watch."
        )
    if question.about == "readback":
        more += " Where recordings.csv is wrong: correct it, then [u], and the hits are read again."
    parts = Group(text, Text(more), Text(f"{keys}[u] undo the import  [q] quit", style="dim"))
    return Panel(parts, title=f"Pose {pose}: a question", title_align="left", expand=False)


def _in(report: ImportReport) -> str:
    return f"{counted(len(report.accepted), 'hit')} in, {len(report.refused)} refused"


def not_now(key: str) -> str:
    """What is said of a key that does nothing here; those that do are on the page."""
    shown = key if key.isprintable() else "Enter" if key in "\r\n" else repr(key)
    return f"{shown} does nothing now; the keys that do are those above in [brackets]."


def incomplete(page: PosePage) -> str:
    """What is missing where a pose is accepted too early."""
    counts = ", ".join(f"{a} {page.counts[a]}/{page.per_axis}" for a in page.proposal.hits)
    return f"Hits are missing ({counts}): hit on, or press a again to accept the pose as it is."


def result_line(report: ImportReport) -> str:
    """What came out, and how far at most it is off what was expected; the panel has each mode."""
    said = f"{report.pose}: {_in(report)}"
    every = found_modes(report.pose, report.model, report.model_before)
    if not every:
        return f"{said}; no modes"
    found = [one for one in every if one.mode is not None]
    said += f"; {', '.join(f'{one.mode.frequency_hz:.2f}' for one in found if one.mode)} Hz"
    if not found:
        return said
    off = max((abs(one.off) for one in found if np.isfinite(one.off)), default=np.nan)
    missing = len(every) - len(found)
    lacks = f", {counted(missing, 'mode')} not found" if missing else ""
    return f"{said}, within {off:.1f} sd of what was expected{lacks}"


def against_expected(pose: str, model: Model, before: Model | None) -> str:
    """The modes of a pose, and what a model expected `before` it was hit, where that is known."""
    each = []
    for one in found_modes(pose, model, before):
        mode = one.mode
        said = f"mode {one.label} not found" if mode is None else f"{mode.frequency_hz:.2f} Hz"
        if before is not None:
            off = "" if mode is None else f", {one.off:+z.1f} sd"
            said += f" (expected {one.expected_hz:.2f}{off})"
        each.append(said)
    return ", ".join(each) or "no modes"


def progress_line(model: Model, minutes: float) -> str:
    """How far the campaign is, at so many minutes a pose; then what one more would bring."""
    overall = float(np.sqrt(np.mean(model.frequency_sd_percent**2)))
    said = f"frequency sd over the workspace {significant(overall)} %; {minutes:.1f} min per pose; "
    if not model.waits_for:
        return f"{said}target reached"
    return f"{said}what lacks: {model.waits_for}. {model.forecast.outlook}".strip()
