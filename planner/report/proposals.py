"""Answer of `next`: where to measure, and what to expect there."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
from rich.console import Group, RenderableType
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.campaign.events import Proposal, Question
from planner.design.stopping import Forecast
from planner.recording.joints import JointUnits
from planner.report.answer import NOT_IN_JSON, Answer, plain
from planner.report.predictions import ExpectedMode
from planner.report.text import command_line, table
from planner.words import counted

if TYPE_CHECKING:
    from planner.campaign.model import RepeatedPose
    from planner.design.parameter_sensitivity import BetterPlaces


@dataclass(frozen=True)
class ProposedPose(Answer):
    """A proposal, and the modes that the model expects there."""

    proposal: Proposal
    expected: tuple[ExpectedMode, ...]
    room: tuple[str, ...] = ()  # which way +x, +y and +z of the tool point there
    hits_per_axis: int = field(default=1, metadata=NOT_IN_JSON)

    def to_json(self) -> dict[str, Any]:
        """The proposal's own keys, "expected", and "axes_in_the_room"."""
        more = {"expected": plain(self.expected), "axes_in_the_room": list(self.room)}
        return {**plain(self.proposal), **more}

    def parts(self, joints: JointUnits) -> list[RenderableType]:
        """Angles, place and expected modes as text."""
        proposal = self.proposal
        values = (f"{value:.3f}" for value in proposal.joints_deg)
        angles = table(f"Pose {proposal.pose}", *joints.headings, rows=[values])
        columns = "mode", "frequency (Hz, ± 1 sd)", "damping (%)"
        rows = ((str(k), *mode.cells) for k, mode in enumerate(self.expected, 1))
        expected = table("expected there", *columns, rows=rows)
        x, y, z = proposal.position_m
        times = counted(self.hits_per_axis, "hit")
        hits = f"{times} along each of {', '.join(proposal.hits)} of the tcp frame"
        place = f"tool at x {x:.3f} m, y {y:.3f} m, z {z:.3f} m; {hits}; {proposal.reason}"
        ways = ", ".join(f"+{axis} {way}" for axis, way in zip("xyz", self.room, strict=False))
        seen = [Text(f"There, seen from the base: {ways}")] if ways else []
        return [angles, Text(place), *seen, expected]


@dataclass(frozen=True)
class ProposalsReport(Answer):
    """Answer of `next`; `places` is where to put a sensor, or to hit, at the first pose."""

    proposals: tuple[ProposedPose, ...]
    joint_names: tuple[str, ...]
    forecast: Forecast
    repeat: "RepeatedPose | None"
    remarks: tuple[str, ...] = ()
    places: "BetterPlaces | None" = None
    joint_units: Any = msgspec.UNSET
    done: bool = False
    waits_for: str = ""
    campaign: Path | None = field(default=None, metadata=NOT_IN_JSON)

    @property
    def joints(self) -> JointUnits:
        """Their names and units."""
        return JointUnits.declared_as(self.joint_names, self.joint_units)

    def to_json(self) -> dict[str, Any]:
        """With the forecast's sentence."""
        return super().to_json() | {"forecast": forecast_json(self.forecast)}

    def text(self) -> Group:
        """Each pose, then what one more measurement is worth."""
        parts = [part for one in self.proposals for part in one.parts(self.joints)]
        again = self.repeat.text if self.repeat else ""
        places = self.places.sentence if self.places else ""
        said = standing(self.forecast, self.waits_for, again), places
        remarks = [Text(remark, style="yellow") for remark in self.remarks]
        return Group(*parts, Text(" ".join(filter(None, said))), *remarks, *self._then())

    def _then(self) -> list[Text]:
        """Where the recordings go, and the command that takes them in."""
        if self.campaign is None:
            return []
        pose = self.proposals[0].proposal.pose
        where = Text(
            f"Export the hits of {pose} into a folder of their own, say exports/{pose}, under any "
            f"names; where files do not say the axis that was hit, a recordings.csv beside them "
            f"does (columns pose, hit, file). Then:"
        )
        act = "planner", "import", self.campaign, f"exports/{pose}", "--pose", pose
        return [where, command_line("  ", *act)]


def standing(forecast: Forecast, waits_for: str, again: str = "") -> str:
    """Whether the target is reached, how far frequencies are off, and what going on would bring.

    `waits_for` is what lacks until the target is reached; `again` asks to hit a pose again.
    """
    if waits_for:
        lacks = f"The target is not reached yet; what lacks: {waits_for}."
        return " ".join(filter(None, (forecast.text, lacks, again)))
    more = again or forecast.outlook
    more = more and f"If you go on, {more[0].lower()}{more[1:]}"
    reached = "The target is reached: no more poses are needed."
    return " ".join(filter(None, (reached, forecast.known, more)))


def unanswered(question: Question) -> str:
    """Of hits that are held until it is answered."""
    return f"Held, not used: {question.text} Answer with planner confirm, or withdraw."


def forecast_json(forecast: Forecast) -> dict[str, Any]:
    """Its numbers and its sentence."""
    return {**plain(forecast), "text": forecast.text}


def proposals(campaign: Campaign, found: tuple[Proposal, ...]) -> ProposalsReport:
    """Of the poses that `Campaign.next` gave."""
    # Status needs none of what these import.
    from planner.campaign.proposals import places_for
    from planner.robot.place_names import axes_in_the_room

    robot, model = campaign.cell.robot, campaign.model
    each = campaign.cell.config.cost.hits_per_axis
    q = robot.joints.internal([p.joints_deg for p in found])
    expected = campaign.model.predict(q)
    return ProposalsReport(
        tuple(
            ProposedPose(p, ExpectedMode.all_of(expected, i), axes_in_the_room(robot, q[i]), each)
            for i, p in enumerate(found)
        ),
        tuple(campaign.cell.robot.joint_names),
        model.forecast,
        model.repeat(),
        (*campaign.cell.remarks, *map(unanswered, campaign.state.questions)),
        places=places_for(model, campaign.state, found[0]),
        joint_units=campaign.cell.robot.joints.declared,
        done=bool(model.done),
        waits_for=model.waits_for,
        campaign=campaign.directory,
    )
