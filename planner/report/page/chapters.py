"""Chapters of the report that are words and tables."""

from collections.abc import Iterable

import numpy as np

from planner.campaign.config import CampaignConfig
from planner.campaign.log_words import act
from planner.campaign.state import Measurement, taken_back
from planner.check.remark import CheckRemark
from planner.recording.joints import JointUnits
from planner.recording.points import SENSOR, TCP
from planner.report.page.facts import Facts
from planner.report.page.html import (
    Markup,
    bullets,
    joined,
    paragraphs,
    section,
    table,
    tag,
    words_table,
)
from planner.report.proposals import target_sentence
from planner.report.text import number
from planner.report.text import with_sd as pm
from planner.robot.link_bodies import guessed_masses
from planner.version import __version__
from planner.words import command, local_time, significant


def asked(facts: Facts) -> Markup:
    """What was asked: robot, workspace, modes, target; what a check of the robot found."""
    cell = facts.campaign.cell
    config, robot, links = cell.config, cell.robot, cell.examined.links
    mass = sum(link.mass for link in links if link.joint)
    rows = [
        ("Robot", f"{robot.name}: {len(robot.joint_names)} joints, {mass:.4g} kg move"),
        *([("Masses", guessed_masses(links))] if guessed_masses(links) else []),
        ("Simulation", _simulation(config, len(robot.config.compliance))),
        ("Hit point and sensor", f"{robot.config.tcp_frame}, {robot.config.sensor_frame}"),
        *_points(facts),
        *_workspace(config, robot.joints),
        ("Modes", f"the {config.modes.count} lowest in {_range(config.modes.band_hz)} Hz"),
        ("Poses chosen by", config.acquisition.name),
        ("Target", _target(config)),
    ]
    words = tag("table", *(tag("tr", tag("th", a), tag("td", b)) for a, b in rows), class_="words")
    return section("What was asked", words, findings(cell.examined.remarks), id_="asked")


def _points(facts: Facts) -> list[tuple[str, str]]:
    """Sensors and hit points beside the tool's that recordings name."""
    hits = [hit for m in facts.state.recorded for hit in m.hits]
    named = dict.fromkeys(
        name for hit in hits for name in (hit.hit_point, *hit.response_points)
        if name and name not in (TCP, SENSOR)
    )  # fmt: skip
    return [("Other points", ", ".join(named))] if named else []


def _range(values: Iterable[float]) -> str:
    return " to ".join(f"{v:g}" for v in values)


def _simulation(config: CampaignConfig, springs: int) -> str:
    kind = config.fidelity.simulation
    said = {
        "updated": "identified again from the recordings as they come",
        "frozen": "as robot.toml states it",
        "none": "not used",
    }[kind]
    return said if kind == "none" else f"{springs} elastic degrees of freedom, {said}"


def _workspace(config: CampaignConfig, joints: JointUnits) -> list[tuple[str, str]]:
    w = config.workspace
    if w.joints_deg is not None:
        rows = zip(joints.names, w.joints_deg, joints.slides, strict=True)
        said = (f"{name} {_range(r)}{' mm' if slide else '°'}" for name, r, slide in rows)
        return [("Workspace", "; ".join(said))]
    axes = ", ".join(f"{v:g}" for v in w.tool_axis or ())
    pairs = zip("xyz", w.position_m or [], strict=True)
    place = "; ".join(f"{name} {_range(r)} m" for name, r in pairs)
    turn = f", turned by {_range(w.rotation_deg)}° about it" if w.rotation_deg else ""
    return [("Workspace", f"{place}; tool axis ({axes}){turn}")]


def _target(config: CampaignConfig) -> str:
    s = config.stop
    return (
        f"frequencies over the workspace to {s.frequency_sd_percent:g} % (RMSE) with "
        f"{100 * s.probability:g} % probability, after {s.measurements_min} to "
        f"{s.measurements_max} poses"
    )


def findings(remarks: Iterable[CheckRemark]) -> Markup:
    """What a check of the robot warns of."""
    told = [r for r in remarks if r.severity != "note"]
    if not told:
        return tag("p", "A check of the robot's description finds nothing wrong.", class_="soft")
    classes = {"error": "error", "warning": "warn"}
    return joined(tag("p", r.sentence, class_=classes[r.severity]) for r in told)


def measured(facts: Facts) -> Markup:
    """What was measured and refused, and why."""
    state = facts.state
    header = ("pose", "hits used", "refused", "natural frequencies (Hz)", "damping ratios (%)",
              "time")  # fmt: skip
    rows = [_pose(m, m.pose in state.starred) for m in state.measured]
    parts: list[object] = [tag("p", "Nothing has been measured yet.")]
    if rows:
        parts = [table(header, rows), _stood(facts)]
    refused = [(r.pose, r.file, r.reason) for r in facts.status.refused]
    if refused:
        parts += [tag("h3", f"Refused, kept and not used: {len(refused)}"),
                  words_table(("pose", "file", "why"), refused)]  # fmt: skip
    held = [(h.measured.pose, h.question.question.text) for h in facts.status.held]
    if held:
        parts += [
            tag("h3", "Held until a question is answered"),
            words_table(("pose", "asked"), held),
        ]
    skipped = [(s.pose, s.reason or "–") for s in facts.status.skipped]
    if skipped:
        parts += [tag("h3", "Not measured"), words_table(("pose", "why"), skipped)]
    said = [(m.pose, text) for m in state.recorded for text in m.remarks]
    if said:
        parts += [tag("h3", "Remarks on recordings"), words_table(("pose", "remark"), said)]
    return section("What was measured, and what was refused", *parts, id_="measured")


def _stood(facts: Facts) -> Markup:
    """Where the robot stood: as read back, or as proposed where nobody read it back."""
    joints, proposed = facts.campaign.cell.robot.joints, facts.state.proposals
    rows, setpoints = [], 0
    for m in facts.state.measured:
        setpoint = m.pose in proposed and proposed[m.pose].joints_deg == m.joints_deg
        setpoints += setpoint
        source = "setpoint" if setpoint else "readback"
        rows.append((m.pose, *(f"{v:.2f}" for v in m.joints_deg), source))
    said = "Joints as read back; where nothing was read back, the setpoint of the proposal"
    if setpoints == len(rows):
        said = "Joints as proposed: nothing was read back"
    return table(("pose", *joints.headings, "from"), rows, said)


def _pose(m: Measurement, starred: bool) -> list[object]:
    modes = [mode for mode in m.modes if mode.likely]
    mark = (" ★" if starred else "") + (" (withdrawn)" if m.withdrawn else "")
    return [
        m.pose + mark, str(len(m.accepted)), str(len(m.hits) - len(m.accepted)),
        [pm(x.frequency_hz, x.frequency_sd_hz, ".3f") for x in modes],
        [number(100 * x.damping_ratio) for x in modes],
        local_time(m.time),
    ]  # fmt: skip


def decisions(facts: Facts) -> Markup:
    """The log, entry by entry."""
    undone = taken_back(facts.campaign.entries)
    rows = []
    for entry in facts.campaign.entries:
        mark = " (taken back)" if entry.seq in undone else ""
        rows.append((str(entry.seq), local_time(entry.time), act(entry) + mark))
    return section("Log of decisions", words_table(("entry", "time", "what"), rows), id_="log")


def reproduce(facts: Facts) -> Markup:
    """How to get the same numbers again."""
    campaign = facts.campaign
    folder = command(campaign.directory.name)
    commands = "\n".join(
        (
            f"# with planner {__version__}:",
            f"planner replay {folder}      # every step again from the log: identical?",
            f"planner status {folder}      # the numbers of this report",
            f"planner report {folder}      # this report",
        )
    )
    configured = facts.state.configured
    files = sorted(configured.robot.items()) if configured else []
    rows = [(f"robot/{name}", digest) for name, digest in files]
    rows += [(f"{m.pose}: {h.file}", h.sha256) for m in facts.state.recorded for h in m.hits]
    listing = tag(
        "details",
        tag("summary", f"SHA-256 of {len(rows)} files that these numbers come from"),
        words_table(("file", "SHA-256"), rows),
    )
    config = tag("pre", (campaign.directory / "campaign.toml").read_text("utf-8", "replace"))
    text = (
        "A campaign is its folder: the append-only log, campaign.toml, the robot folder and the "
        "recordings under their content hash. With it anybody can compute all of this again."
    )
    shown = tag("details", tag("summary", "campaign.toml"), config)
    return section(
        "How to reproduce it", tag("p", text), tag("pre", commands), shown, listing, id_="again"
    )


def meaning() -> Markup:
    """What the numbers mean, and how far to trust them."""
    points = (
        "“± ” is one standard deviation; “2 sd” bands hold about 95 % of what would be measured "
        "if the model is right. Held-out quality says whether it is.",
        "Measured frequencies carry the sd of their modal analysis. Predicted ones carry what a "
        "new visit to the pose would show, the scatter from visit to visit included; the sds over "
        "the workspace leave that scatter out, for no further pose lowers it.",
        "Outside the workspace the model extrapolates: its bands are not to be trusted there.",
        "Bands of FRFs hold what parameters leave open and the errors at poses left out. They are "
        "calibrated in the band of the counted modes; above the highest counted mode they rest on "
        "the simulation alone.",
        "Nothing is averaged away: a hit that was refused is in the table with its reason.",
    )
    return section("How to read the numbers", bullets(points), id_="meaning")


def remarks(facts: Facts) -> Markup:
    """What the model itself warns of."""
    return joined(tag("p", text, class_="warn") for text in facts.status.remarks)


def forecast(facts: Facts) -> Markup:
    """Whether the target is reached."""
    if not facts.used:
        return paragraphs("Nothing is measured yet: all that is said is the simulation's.")
    return paragraphs(f"{facts.status.forecast.text} {target_sentence(facts.status.waits_for)}")


def mode_rows(facts: Facts) -> list[tuple[str, ...]]:
    """Mode by mode over the workspace: range of frequencies, sd now."""
    found = facts.model.workspace_prediction
    rows = []
    for k in range(found.frequency_hz.shape[1]):
        f, z = found.frequency_hz[:, k], 100 * found.damping_ratio[:, k]
        sd = facts.sd_percent[:, k]
        rows.append(
            (f"mode {k + 1}", f"{f.min():.2f} to {f.max():.2f}",
             significant(np.sqrt(np.mean(sd**2))), significant(sd.max()),
             f"{z.min():.2f} to {z.max():.2f}")
        )  # fmt: skip
    return rows
