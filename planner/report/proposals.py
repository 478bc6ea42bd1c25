"""Answer of `next`: where to measure, and what to expect there."""

from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.campaign.events import Proposal
from planner.design.stopping import Forecast
from planner.recording.joints import JointUnits
from planner.report.answer import Done, plain
from planner.report.predictions import ExpectedMode
from planner.report.text import command_line, table
from planner.words import counted


def standing(forecast: Forecast, waits_for: str, not_predicted: str = "", again: str = "") -> str:
    """Whether the target is reached, how far frequencies are off, and what going on would bring.

    `waits_for` is what lacks until the target is reached; `again` asks to hit a pose again;
    `not_predicted` is said of modes beside those that the target is about.
    """
    if waits_for:
        lacks = f"The target is not reached yet; what lacks: {waits_for}."
        return " ".join(filter(None, (forecast.text, lacks, again)))
    more = again or forecast.outlook
    more = more and f"If you go on, {more[0].lower()}{more[1:]}"
    reached = "The target is reached: no more poses are needed."
    return " ".join(filter(None, (reached, not_predicted, forecast.known, more)))


def unanswered(question: str) -> str:
    """Of hits that are held until it is answered."""
    return f"Held, not used: {question} Answer with planner confirm, or withdraw."


def forecast_json(forecast: Forecast) -> dict[str, Any]:
    """Its numbers and its sentence."""
    return {**plain(forecast), "text": forecast.text}


def proposals(campaign: Campaign, found: tuple[Proposal, ...]) -> Done:
    """Answer of `next`, of the poses that `Campaign.next` gave: what to expect there.

    "places" is where to put a sensor, or to hit, at the first pose; each pose's "axes_in_the_room"
    are the ways +x, +y and +z of the tool point there.
    """
    # Status needs none of what these import.
    from planner.campaign.proposals import places_for
    from planner.robot.place_names import axes_in_the_room

    cell, model = campaign.cell, campaign.model
    robot, joints, forecast = cell.robot, cell.robot.joints, model.forecast
    held = [unanswered(m.question.text) for m in campaign.state.held.values() if m.question]
    repeat = None if held else model.repeat()  # what was hit is asked about first
    q = joints.internal([p.joints_deg for p in found])
    expected = model.predict(q)
    places = places_for(model, campaign.state, found[0])
    told = (*held, *cell.remarks)
    each, parts = [], list[RenderableType](Text(remark, style="yellow") for remark in told)
    for i, proposal in enumerate(found):
        modes, ways = ExpectedMode.all_of(expected, i), axes_in_the_room(robot, q[i])
        each.append({**plain(proposal), "expected": modes, "axes_in_the_room": ways})
        parts += _pose(proposal, modes, ways, joints, cell.config.cost.hits_per_axis)
    keys = {
        "proposals": each, "joint_names": joints.names, "forecast": forecast_json(forecast),
        "repeat": repeat, "remarks": told, "places": places, "joint_units": joints.declared,
        "done": bool(model.done), "waits_for": model.waits_for,
    }  # fmt: skip
    lacks = model.waits_for, model.not_predicted
    said = standing(forecast, *lacks, repeat["text"] if repeat else "")
    said = " ".join(filter(None, (said, places.sentence if places else "")))
    return Done(keys, Group(*parts, Text(said), *_then(campaign.directory, found[0].pose)))


def _pose(
    proposal: Proposal, modes: tuple[ExpectedMode, ...], ways: tuple[str, ...],
    joints: JointUnits, hits_per_axis: int,
) -> list[RenderableType]:  # fmt: skip
    """Angles, place and expected modes as text."""
    values = (f"{value:.3f}" for value in proposal.joints_deg)
    angles = table(f"Pose {proposal.pose}", *joints.headings, rows=[values])
    columns = "mode", "frequency (Hz, ± 1 sd)", "damping (%)"
    rows = ((str(k), *mode.cells) for k, mode in enumerate(modes, 1))
    expected = table("expected there", *columns, rows=rows)
    x, y, z = proposal.position_m
    times = counted(hits_per_axis, "hit")
    hits = f"{times} along each of {', '.join(proposal.hits)} of the tcp frame"
    place = f"tool at x {x:.3f} m, y {y:.3f} m, z {z:.3f} m; {hits}; {proposal.reason}"
    room = ", ".join(f"+{axis} {way}" for axis, way in zip("xyz", ways, strict=False))
    seen = [Text(f"There, seen from the base: {room}")] if ways else []
    return [angles, Text(place), *seen, expected]


def _then(directory: Path, pose: str) -> list[Text]:
    """Where the recordings go, and the command that takes them in."""
    where = Text(
        f"Export the hits of {pose} into a folder of their own, say exports/{pose}, under any "
        f"names; where files do not say which axis was hit, add a recordings.csv beside them "
        f"(columns pose, hit, file; hit is such as +x). Then:"
    )
    act = "planner", "import", directory, f"exports/{pose}", "--pose", pose
    return [where, command_line("  ", *act)]
