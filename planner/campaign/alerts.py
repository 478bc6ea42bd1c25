"""What an import notices that is to be acted upon while the robot still stands there."""

from collections.abc import Sequence

from planner.campaign.events import Imported, MeasuredMode
from planner.campaign.model import Model
from planner.campaign.revisits import Suspicion, hit_again
from planner.campaign.state import CampaignState
from planner.dataset.measure import MeasuredPose
from planner.frf.frf import unreciprocal


def alerts(
    model: Model,
    state: CampaignState,
    event: Imported,
    measured: MeasuredPose,
    modes: Sequence[MeasuredMode],
    suspicion: Suspicion | None,
) -> tuple[str, ...]:
    """Remarks on new hits, their channels, reciprocity and drift.

    Args:
        model: Before the import, as is `state`.
        state: See `model`.
        event: The import.
        measured: All hits of the pose, the new ones last.
        modes: By the new hits alone.
        suspicion: Of drift, where they hint at it.
    """
    verdicts = measured.verdicts[-len(event.hits) :]
    told = tuple(dict.fromkeys(text for one in verdicts for text in one.remarks))
    if event.question is not None:
        return told
    if measured.frf is not None:
        told += unreciprocal(measured.frf)
    known = state.hit_at(event.pose)
    if known is not None:
        return told + hit_again(model, known, modes)
    return told if suspicion is None else (*told, suspicion.text)
