"""Answer of `status`: what was measured, what is open, how sure the model is; a kept diagnosis."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
from rich.console import Group, RenderableType
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.campaign.model_status import decision_status, found_without, left_out
from planner.campaign.state import Measurement
from planner.errors import InputError
from planner.report.answer import Done
from planner.report.imports import asked_of
from planner.report.pictures import Pictures
from planner.report.proposals import forecast_json, standing, unanswered
from planner.report.springs import (
    COLUMNS,
    MASS_COLUMNS,
    NOT_KNOWN,
    mass_cells,
    refitted_masses,
    refitted_springs,
    spring_cells,
)
from planner.report.text import ending, sds_over_workspace, table
from planner.words import by_reason, counted, listed, local_time, significant

if TYPE_CHECKING:
    from planner.campaign.model import Model
    from planner.campaign.state import CampaignState

KEPT = "diagnosis.json"  # as `diagnose --out` writes it


def _of_model(model: "Model") -> dict[str, Any]:
    """What `status` says of the model; sds (count,) in % are over the workspace, mode by mode.

    "decision" is there where the campaign is for a cut, "springs" where the simulation learns,
    "masses" of links where the recordings tell them; "waits_for" lacks until the target is reached;
    "frf_sd_percent" is of predicted FRFs, and of their common scale; "not_predicted" are modes that
    every pose shows beside those predicted.
    """
    cell = model.cell
    return {
        "robot": cell.robot.name, "joint_names": tuple(cell.robot.joint_names),
        "frequency_sd_percent": model.frequency_sd_percent,
        "target_frequency_sd_percent": cell.config.stop.frequency_sd_percent,
        "done": bool(model.done), "forecast": model.forecast, "remarks": model.remarks,
        "leave_one_out": left_out(model), "decision": decision_status(model),
        "joint_units": cell.robot.joints.declared, "springs": refitted_springs(model),
        "masses": refitted_masses(model), "waits_for": model.waits_for,
        "frf_sd_percent": model.frf_sd_percent, "not_predicted": model.not_predicted,
    }  # fmt: skip


def status(
    campaign: Campaign, diagnosis: Path | None = None, pictures: Pictures | None = None,
    models: Sequence[Mapping[str, Any]] | None = None,
) -> Done:  # fmt: skip
    """Answer of `status`, of a campaign as it is now beside a kept `diagnosis` (default: its own).

    "used" of the measured poses are those that the model rests on, hits of "held" ones are not used
    until a question is answered. "torn_bytes" are of a last line of the log that a crash has torn.
    "decision" is there where the campaign is for a cut, `models` where they were compared.
    """
    state, directory = campaign.state, campaign.directory
    believed = campaign.of_model("status", dict, _of_model)
    kept = diagnosis or diagnosis_of(directory)
    beside = two_answers(believed["springs"], read_diagnosis(kept)) if kept else ""

    def draw():
        if not believed["leave_one_out"]["values"]:
            return {}
        from planner.report.campaign_plots import left_out_figure

        title = "Each measured pose, predicted without it"
        return {"leave_one_out": left_out_figure(*found_without(campaign.model), title)}

    written = (pictures or Pictures()).write(draw, directory.name, simulated=state.simulated)
    keys = believed | {
        "remarks": (*believed["remarks"], *filter(None, (beside,))),
        "forecast": forecast_json(believed["forecast"]),
        "decision": believed["decision"] or msgspec.UNSET,
        "campaign": str(directory), "simulated": state.simulated,
        "measurements": [_pose(m, m.pose in state.starred) for m in state.measured],
        "open": [state.proposals[pose] for pose in state.open],
        "skipped": [{"pose": pose, "reason": why} for pose, why in state.skipped.items()],
        "refused": _still_refused(state),
        "log": {"entries": state.events, "torn_bytes": campaign.torn_bytes},
        "stored_but_not_imported": campaign.orphans(),
        "held": [_pose(m, m.pose in state.starred) | {"question": asked_of(m.pose, m.question)}
                 for m in state.held.values() if m.question],
        "used": len(state.used), "models": msgspec.UNSET if models is None else models, **written,
    }  # fmt: skip
    return Done(keys, Group(*_tables(keys), Text("\n".join(_lines(believed, keys))), *ending(keys)))


def _tables(keys: Mapping[str, Any]) -> list[RenderableType]:
    """Measured poses, springs, and models."""
    measured = table(
        f"{keys['campaign']}: {_counts(keys['measurements'], keys['used'])}",
        *("pose", "hits", "refused", "frequencies (Hz)", "time"),
        rows=map(_cells, keys["measurements"]),
    )
    parts: list[RenderableType] = [measured]
    if keys["springs"]:
        title = "Stiffnesses of the simulation, refitted to all recordings"
        rows = map(spring_cells, keys["springs"])
        parts += [table(title, *COLUMNS, rows=rows), Text(f"  {NOT_KNOWN}")]
    if keys["masses"]:
        title = "Masses that the recordings tell, of each link with what is mounted on it"
        parts.append(table(title, *MASS_COLUMNS, rows=map(mass_cells, keys["masses"])))
    return parts + ([] if keys["models"] is msgspec.UNSET else models_text(keys["models"]))


def _pose(m: Measurement, starred: bool) -> dict[str, Any]:
    """How many hits of a measured pose are in use and refused, frequencies of its modes."""
    return {
        "pose": m.pose, "joints_deg": m.joints_deg, "hits": len(m.accepted),
        "refused": len(m.refused),
        "frequency_hz": [mode.frequency_hz for mode in m.modes if mode.likely],
        "withdrawn": m.withdrawn, "starred": starred, "simulated": m.simulated, "time": m.time,
        "remarks": m.remarks,
    }  # fmt: skip


def _cells(pose: Mapping[str, Any]) -> tuple[str, ...]:
    """A row of the table."""
    mark = (" ★" if pose["starred"] else "") + (" withdrawn" if pose["withdrawn"] else "")
    found = "  ".join(f"{f:.2f}" for f in pose["frequency_hz"]) or "none"
    counts = str(pose["hits"]), str(pose["refused"])
    return pose["pose"] + mark, *counts, found, local_time(pose["time"])


def _counts(measured: Sequence[Mapping[str, Any]], used: int) -> str:
    """How many poses the model uses, as report and predict count them, and others."""
    away = sum(pose["withdrawn"] for pose in measured)
    without = len(measured) - used - away
    more = f", {away} withdrawn" if away else ""
    more += f", {without} without modes" if without else ""
    return f"{counted(used, 'pose')} measured{more}"


def _lines(believed: Mapping[str, Any], keys: Mapping[str, Any]) -> list[str]:
    held = ", ".join(h["pose"] for h in keys["held"])
    waiting = f"; hit, and waiting for your answer: {held}" if held else ""
    lines = [
        "open: " + (", ".join(p.pose for p in keys["open"]) or "none") + waiting,
        "skipped: " + (", ".join(s["pose"] for s in keys["skipped"]) or "none"),
        sds_over_workspace(keys["frequency_sd_percent"], keys["target_frequency_sd_percent"]),
        standing(believed["forecast"], keys["waits_for"], keys["not_predicted"]),
        f"log: {counted(keys['log']['entries'], 'entry', 'entries')}",
    ]
    if keys["frf_sd_percent"]:
        whole, scale = map(significant, keys["frf_sd_percent"])
        lines.insert(3, f"sd of predicted FRFs over the workspace: {whole} %; {scale} % of it "
                        f"a factor common to all (gains and masses)")  # fmt: skip
    if keys["log"]["torn_bytes"]:
        lines.append("The log's last line was torn by a crash; the next act sets it aside.")
    if keys["stored_but_not_imported"]:
        lines.append(
            f"{counted(len(keys['stored_but_not_imported']), 'recording')} stored, but the "
            f"program stopped before the import: import again."
        )
    lines += [unanswered(h["question"]["text"]) for h in keys["held"]]
    lines += [believed["decision"]["text"]] if believed["decision"] else []
    lines += [*keys["remarks"], *keys["leave_one_out"]["text"]]
    told = by_reason((r["file"], r["reason"]) for r in keys["refused"])
    return lines + [f"refused {one}" for one in told]


def _still_refused(state: "CampaignState") -> list[dict[str, str]]:
    """Refused hits of which no corrected file was accepted since."""
    told = [(m.pose, hit) for m in state.recorded for hit in m.refused]
    known = {m.pose: m for m in state.recorded}
    told += [
        (pose, hit)
        for pose, hit in state.refused.values()
        if pose not in known or not known[pose].replaced(hit)
    ]
    return [{"pose": pose, "file": hit.file, "reason": hit.reason} for pose, hit in told]


def models_text(rows: Sequence[Mapping[str, Any]]) -> list[RenderableType]:
    """Models side by side, and which one predicts poses left out best."""
    if not rows:
        return [Text("Models can be compared once two poses are measured.")]
    columns = "model", "RMSE (%)", "in 95 %", "log density", "log evidence", "fit (s)"
    made = table("Natural frequencies of each pose, predicted from the others alone", *columns)
    for row in rows:
        evidence = "" if row["log_evidence"] is None else f"{row['log_evidence']:.1f}"
        made.add_row(
            row["model"] + (" ★" if row["campaign"] else ""), significant(row["rmse_percent"]),
            f"{100 * row['coverage95']:.0f} %", f"{row['log_density']:.1f}", evidence,
            significant(row["seconds"]),
        )  # fmt: skip
    best, used = rows[0], next((row for row in rows if row["campaign"]), rows[0])
    powers = (best["log_density"] - used["log_density"]) / math.log(10)
    said = f"Likeliest for poses left out: {best['model']}, {best['about']}."
    if best is not used:
        said += f" The campaign's own (★) is less likely by {powers:.1f} powers of ten."
    return [made, Text(said)]


def model_beside(campaign: Campaign, found: Mapping[str, Any]) -> str:
    """What to say where the campaign's model and a diagnosis of it, as JSON, give two answers."""
    return two_answers(campaign.of_model("status", dict, _of_model)["springs"], found)


def diagnosis_of(directory: Path, given: Path | None = None) -> Path | None:
    """Where the kept diagnosis is: the folder or file that was named, else the campaign's own."""
    if given is None:
        own = directory / "diagnosis" / KEPT
        return own if own.is_file() else None
    file = given / KEPT if given.is_dir() else given
    if not file.is_file():
        raise InputError(f"{file} does not exist; name what planner diagnose --out has written.")
    return file


def read_diagnosis(file: Path) -> dict[str, Any]:
    """The answer in JSON. Raises InputError where it is none."""
    try:
        found = json.loads(file.read_bytes())
        _ = found["verdict"], found["findings"], found["candidates"]
    except (ValueError, KeyError, TypeError, OSError):
        raise InputError(f"{file} is no answer of planner diagnose; name another.") from None
    return found


def two_answers(springs: Sequence[Mapping[str, Any]], found: Mapping[str, Any]) -> str:
    """Why the campaign's model has other springs than a diagnosis names; "" where it has not.

    `springs` are those of the model, `found` is the diagnosis' answer as JSON.
    """
    names = found.get("place_names") or {}
    # Springs that robot.toml states the model refits, too: they tell nothing apart.
    said = [one["at"] for one in found["findings"] if one["effect"] != "joint_stiffness"]
    told = {names.get(at, at) for at in said if at}
    added = {spring["joint"] for spring in springs if spring["stated"] is None} - told
    if not added or not told:
        return ""
    return (
        f"The campaign's model adds springs at {listed(sorted(added))}, which the diagnosis does "
        f"not name. The model predicts, and so lets every joint and the floor tilt "
        f"at once; the diagnosis adds only what the recordings cannot do without, and is what to "
        f"go by for repairs."
    )


def chapter(file: Path) -> dict[str, Any]:
    """The answer, and the first four of its pictures."""
    found = read_diagnosis(file)
    pictures = [Path(p) for p in found.get("plots", ())[:4]]
    return found | {"pictures": [p for p in pictures if p.is_file() and p.suffix == ".png"]}
