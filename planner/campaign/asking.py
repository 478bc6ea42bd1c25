"""What the engineer is asked of a pose's new hits before they are believed, one thing at a time."""

from dataclasses import dataclass

from planner.campaign.chain_question import chain_question
from planner.campaign.events import MeasuredMode, Question
from planner.campaign.model import Model
from planner.campaign.question import question, repeated
from planner.campaign.readback import readback_question
from planner.campaign.state import CampaignState
from planner.frf.frf import Frf


@dataclass(frozen=True, eq=False)
class NewHits:
    """Hits that are said to be of a pose: the tool's FRF and the modes, by them alone."""

    pose: str
    joints_deg: tuple[float, ...]
    frf: Frf | None
    modes: tuple[MeasuredMode, ...]


def asked_of(model: Model, state: CampaignState, new: NewHits) -> Question | None:
    """Whether the robot has moved at all, then the chain: its faults look like another pose, too.

    `model` and `state` are those before the import; None: nothing is asked.
    """
    said = new.pose, new.joints_deg
    known = state.measurements.get(new.pose)
    if known is not None and known.question is not None:  # answered
        return None
    return (
        repeated(model, *said, new.modes)
        or chain_question(model, state, *said, new.frf)
        or readback_question(model, state, *said, new.modes)
        or question(model, state, *said, new.modes)
    )
