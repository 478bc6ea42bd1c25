"""The report of a campaign: one HTML file, from the template `report.html`."""

import time
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from planner.campaign.campaign import Campaign
from planner.campaign.config import CampaignConfig
from planner.campaign.model_status import found_without
from planner.campaign.state import CampaignState, Measurement, taken_back
from planner.campaign.undo import in_words
from planner.design.stopping import percent
from planner.errors import InputError
from planner.recording.joints import JointUnits
from planner.recording.points import SENSOR, TCP
from planner.report.answer import Done
from planner.report.campaign_plots import frf_pictures, left_out_figure, map_pictures
from planner.report.html import rendered, write_page
from planner.report.proposals import standing
from planner.report.springs import COLUMNS, NOT_KNOWN, spring_cells
from planner.report.status import chapter, diagnosis_of, status
from planner.report.text import SIMULATED, number, with_sd
from planner.robot.link_bodies import guessed_masses
from planner.words import command, counted, local_time

if TYPE_CHECKING:
    from planner.campaign.cell import Cell

Rows = list[Sequence[object]]
# Links to chapters of the report, by the chapters' ids.
CHAPTERS = {
    "asked": "asked", "measured": "measured", "quality": "quality", "maps": "maps",
    "frfs": "FRFs", "learned": "simulation", "diagnosis": "diagnosis", "log": "log",
    "again": "reproduce", "meaning": "reading",
}  # fmt: skip
USES = {
    "updated": "identified again from the recordings as they come",
    "frozen": "as robot.toml states it",
    "none": "not used",
}
CLASSES = {"error": "error", "warning": "warn"}


def write_report(campaign: Campaign, out: Path | None, diagnosis: Path | None) -> Done:
    """Write the report, by default report.html in the campaign's folder; InputError if it fails.

    `diagnosis` names what `planner diagnose --out` has written.
    """
    started = time.perf_counter()
    kept = diagnosis_of(campaign.directory, diagnosis)
    file = (out or campaign.directory / "report.html").absolute()
    if file.is_dir():
        raise InputError(f"{file} is a folder; name a file for the report.")
    if not file.parent.is_dir():
        raise InputError(f"{file.parent} does not exist; make that folder, or name another.")
    write_page(page(campaign, kept), file)
    size, used, simulated = file.stat().st_size, len(campaign.state.used), campaign.state.simulated
    keys = {
        "report": str(file), "bytes": size, "measurements": used, "simulated": simulated,
        "diagnosis": str(kept) if kept else None, "seconds": time.perf_counter() - started,
    }  # fmt: skip
    return Done(keys, f"Report of {counted(used, 'pose')} ({size / 1e6:.1f} MB): {file}")


def page(campaign: Campaign, kept_diagnosis: Path | None = None) -> str:
    """The report; `kept_diagnosis` is the answer of a diagnosis in JSON."""
    state, cell, model = campaign.state, campaign.cell, campaign.model
    now, forecast = status(campaign, kept_diagnosis).keys, model.forecast
    found = chapter(kept_diagnosis) if kept_diagnosis else None
    without = {"diagnosis"} if found is None else set()
    without |= set() if now["springs"] else {"learned"}
    folder = campaign.directory
    nothing = "Nothing is measured yet: all that is said is the simulation's."
    return rendered(
        "report.html",
        title=f"{folder.name}: report",
        name=folder.name,
        now=datetime.now(UTC).isoformat(timespec="minutes")[:16].replace("T", " "),
        status=now,
        simulated=SIMULATED.plain,
        state=state,
        rmse=percent(forecast.rmse_percent) if forecast.measurements else "–",
        chapters=[(id_, text) for id_, text in CHAPTERS.items() if id_ not in without],
        asked=_asked(cell, state),
        findings=[(CLASSES[r.severity], r.sentence) for r in cell.examined.remarks
                  if r.severity in CLASSES],
        **_measured(campaign, state, now),
        forecast=standing(forecast, model.waits_for, model.not_predicted)
        if state.used
        else nothing,
        over_workspace=model.workspace_prediction,
        left_out=left_out_figure(*found_without(model))
        if now["leave_one_out"]["values"]
        else None,
        **map_pictures(campaign),
        **frf_pictures(campaign, now["leave_one_out"]["worst"]),
        springs=list(map(spring_cells, now["springs"])),
        spring_columns=COLUMNS,
        springs_say=NOT_KNOWN,
        diagnosis=found,
        entries=campaign.entries,
        undone=taken_back(campaign.entries),
        act=in_words,
        folder=command(folder.name),
        config=(folder / "campaign.toml").read_text("utf-8", "replace"),
    )  # fmt: skip


def _asked(cell: "Cell", state: CampaignState) -> Rows:
    """Robot, workspace, modes, target."""
    config, robot, links = cell.config, cell.robot, cell.examined.links
    mass = sum(link.mass for link in links if link.joint)
    hits = [hit for m in state.recorded for hit in m.hits]
    points = dict.fromkeys(
        name for hit in hits for name in (hit.hit_point, *hit.response_points)
        if name and name not in (TCP, SENSOR)
    )  # fmt: skip
    simulation, s = config.fidelity.simulation, config.stop
    springs, said = f"{len(robot.config.compliance)} elastic degrees of freedom", USES[simulation]
    target = (
        f"frequencies over the workspace to {s.frequency_sd_percent:g} % (RMSE) with "
        f"{100 * s.probability:g} % probability, after {s.measurements_min} to "
        f"{s.measurements_max} poses"
    )
    rows = [
        ("Robot", f"{robot.name}: {len(robot.joint_names)} joints, {mass:.4g} kg move"),
        ("Masses", guessed_masses(links)),
        ("Simulation", said if simulation == "none" else f"{springs}, {said}"),
        ("Hit point and sensor", f"{robot.config.tcp_frame}, {robot.config.sensor_frame}"),
        ("Other points", ", ".join(points)),
        ("Workspace", _workspace(config, robot.joints)),
        ("Modes", f"the {config.modes.count} lowest in {_range(config.modes.band_hz)} Hz"),
        ("Poses chosen by", config.acquisition.name),
        ("Target", target),
    ]
    return [row for row in rows if row[1]]


def _range(values: Iterable[float]) -> str:
    return " to ".join(dict.fromkeys(f"{v:g}" for v in values))


def _workspace(config: CampaignConfig, joints: JointUnits) -> str:
    w = config.workspace
    if w.joints_deg is not None:
        rows = zip(joints.names, w.joints_deg, joints.slides, strict=True)
        return "; ".join(f"{name} {_range(r)}{' mm' if slide else '°'}" for name, r, slide in rows)
    axes = ", ".join(f"{v:g}" for v in w.tool_axis or ())
    pairs = zip("xyz", w.position_m or [], strict=True)
    place = "; ".join(f"{name} {_range(r)} m" for name, r in pairs)
    turn = f", turned by {_range(w.rotation_deg)}° about it" if w.rotation_deg else ""
    return f"{place}; tool axis ({axes}){turn}"


def _measured(campaign: Campaign, state: CampaignState, now: Mapping[str, Any]) -> dict[str, Any]:
    """What was measured and refused, and why; where the robot stood."""
    stood, said = [], "Joints as proposed: nothing was read back"
    for m in state.measured:
        source, sent = "setpoint", state.proposals.get(m.pose)
        if sent is None or sent.joints_deg != m.joints_deg:
            source = "readback"
            said = "Joints as read back; where nothing was read back, the setpoint of the proposal"
        stood.append((m.pose, *(f"{v:.2f}" for v in m.joints_deg), source))
    return {
        "measured": [_pose(m, m.pose in state.starred) for m in state.measured],
        "joints": campaign.cell.robot.joints.headings,
        "stood": stood,
        "stood_says": said,
        "refused": [list(refused.values()) for refused in now["refused"]],
        "held": [(h["pose"], h["question"]["text"]) for h in now["held"]],
        "skipped": [(s["pose"], s["reason"] or "–") for s in now["skipped"]],
        "remarks": [(m.pose, text) for m in state.recorded for text in m.remarks],
    }


def _pose(m: Measurement, starred: bool) -> list[object]:
    modes = [mode for mode in m.modes if mode.likely]
    mark = (" ★" if starred else "") + (" (withdrawn)" if m.withdrawn else "")
    return [
        m.pose + mark, len(m.accepted), len(m.refused),
        [with_sd(x.frequency_hz, x.frequency_sd_hz, ".3f") for x in modes],
        [number(100 * x.damping_ratio) for x in modes],
        local_time(m.time),
    ]  # fmt: skip
