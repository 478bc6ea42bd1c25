"""What the engineer is asked of a pose's new hits before they are believed, one thing at a time."""

from dataclasses import dataclass

from planner.campaign.chain_question import chain_question
from planner.campaign.events import Question
from planner.campaign.model import Model
from planner.campaign.question import question
from planner.campaign.state import CampaignState
from planner.dataset.measure import MeasuredPose


@dataclass(frozen=True, eq=False)
class NewHits:
    """Hits that are said to be of a pose: what they give alone."""

    pose: str
    joints_deg: tuple[float, ...]
    measured: MeasuredPose


def asked_of(model: Model, state: CampaignState, new: NewHits) -> Question | None:
    """Of the first pose's hits whether the chain can be so; of others, whether pose and chain can.

    `model` and `state` are those before the import; None: nothing is asked.
    """
    known = state.measurements.get(new.pose)
    if known is not None and known.question is not None:  # answered
        return None
    if not model.labelled:
        return chain_question(model, new.pose, new.joints_deg, new.measured.frf)
    return question(model, state, new.pose, new.joints_deg, new.measured)
