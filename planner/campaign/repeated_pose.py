"""Whether hitting a measured pose again gains more than a new pose."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planner.campaign.model import Model


@dataclass(frozen=True)
class RepeatedPose:
    """The measured pose whose repetition gains more than any new one.

    Gains are reductions of the mean relative variance.
    """

    pose: str
    gain: float
    gain_of_a_new_pose: float
    text: str

    @classmethod
    def of(cls, model: "Model") -> "RepeatedPose | None":
        """None where a new pose gains more."""
        found = model.repeat()
        if found is None or found[1] <= found[2]:
            return None
        return cls(
            *found,
            f"Better than a new pose: hit {found[0]} again, with as many hits as before. That "
            f"lowers the uncertainty more, as the noise of its hits is now the largest part of it.",
        )
