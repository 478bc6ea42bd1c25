"""Answer of `next`: where to measure, and what to expect there."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.campaign.events import Proposal
from planner.design.stopping import Forecast
from planner.recording.joints import JointUnits
from planner.report.answer import Answer, plain
from planner.report.predictions import ExpectedMode
from planner.report.text import command_line, table
from planner.words import counted

if TYPE_CHECKING:
    from planner.design.parameter_sensitivity import BetterPlaces


@dataclass(frozen=True)
class ProposedPose(Answer):
    """A proposal, and the modes that the model expects there."""

    proposal: Proposal
    expected: tuple[ExpectedMode, ...]
    room: tuple[str, ...] = ()  # which way +x, +y and +z of the tool point there

    def to_json(self) -> dict[str, Any]:
        """The proposal's own keys, "expected", and "axes_in_the_room"."""
        more = {"expected": plain(self.expected), "axes_in_the_room": list(self.room)}
        return {**plain(self.proposal), **more}

    def parts(self, joints: JointUnits, hits_per_axis: int) -> list[RenderableType]:
        """Angles, place and expected modes as text."""
        proposal = self.proposal
        values = (f"{value:.3f}" for value in proposal.joints_deg)
        angles = table(f"Pose {proposal.pose}", *joints.headings, rows=[values])
        columns = "mode", "frequency (Hz, ± 1 sd)", "damping (%)"
        rows = ((str(k), *mode.cells) for k, mode in enumerate(self.expected, 1))
        expected = table("expected there", *columns, rows=rows)
        x, y, z = proposal.position_m
        times = counted(hits_per_axis, "hit")
        hits = f"{times} along each of {', '.join(proposal.hits)} of the tcp frame"
        place = f"tool at x {x:.3f} m, y {y:.3f} m, z {z:.3f} m; {hits}; {proposal.reason}"
        ways = ", ".join(f"+{axis} {way}" for axis, way in zip("xyz", self.room, strict=False))
        seen = [Text(f"There, seen from the base: {ways}")] if ways else []
        return [angles, Text(place), *seen, expected]


@dataclass(frozen=True, eq=False)
class ProposalsReport(Answer):
    """Answer of `next`; `places` is where to put a sensor, or to hit, at the first pose."""

    proposals: tuple[ProposedPose, ...]
    campaign: Campaign
    places: "BetterPlaces | None"

    @property
    def remarks(self) -> tuple[str, ...]:
        """Of the robot, and what waits for an answer."""
        waiting = (
            unanswered(m.question.text) for m in self.campaign.state.held.values() if m.question
        )
        return *self.campaign.cell.remarks, *waiting

    def to_json(self) -> dict[str, Any]:
        """With the forecast's sentence."""
        model, joints = self.campaign.model, self.campaign.cell.robot.joints
        return plain({
            "proposals": self.proposals, "joint_names": joints.names,
            "forecast": forecast_json(model.forecast), "repeat": model.repeat(),
            "remarks": self.remarks, "places": self.places, "joint_units": joints.declared,
            "done": bool(model.done), "waits_for": model.waits_for,
        })  # fmt: skip

    def text(self) -> Group:
        """Each pose, then what one more measurement is worth."""
        cell, model = self.campaign.cell, self.campaign.model
        each, joints = cell.config.cost.hits_per_axis, cell.robot.joints
        parts = [part for one in self.proposals for part in one.parts(joints, each)]
        repeat, lacks = model.repeat(), (model.waits_for, model.not_predicted)
        places = self.places.sentence if self.places else ""
        said = standing(model.forecast, *lacks, repeat.text if repeat else ""), places
        remarks = [Text(remark, style="yellow") for remark in self.remarks]
        return Group(*parts, Text(" ".join(filter(None, said))), *remarks, *self._then())

    def _then(self) -> list[Text]:
        """Where the recordings go, and the command that takes them in."""
        pose = self.proposals[0].proposal.pose
        where = Text(
            f"Export the hits of {pose} into a folder of their own, say exports/{pose}, under any "
            f"names; where files do not say the axis that was hit, a recordings.csv beside them "
            f"does (columns pose, hit, file). Then:"
        )
        act = "planner", "import", self.campaign.directory, f"exports/{pose}", "--pose", pose
        return [where, command_line("  ", *act)]


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


def proposals(campaign: Campaign, found: tuple[Proposal, ...]) -> ProposalsReport:
    """Of the poses that `Campaign.next` gave."""
    # Status needs none of what these import.
    from planner.campaign.proposals import places_for
    from planner.robot.place_names import axes_in_the_room

    robot = campaign.cell.robot
    q = robot.joints.internal([p.joints_deg for p in found])
    expected = campaign.model.predict(q)
    poses = tuple(
        ProposedPose(p, ExpectedMode.all_of(expected, i), axes_in_the_room(robot, q[i]))
        for i, p in enumerate(found)
    )
    return ProposalsReport(poses, campaign, places_for(campaign.model, campaign.state, found[0]))
