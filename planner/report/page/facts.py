"""What a report is made from: one reading of the campaign, so that all chapters agree."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.campaign.campaign import Campaign
from planner.campaign.model import Model
from planner.campaign.state import CampaignState, Measurement
from planner.report.status import StatusReport, status


@dataclass(frozen=True, eq=False)
class Facts:
    """A campaign as it is when the report is written."""

    campaign: Campaign
    state: CampaignState
    status: StatusReport

    @classmethod
    def of(cls, campaign: Campaign) -> "Facts":
        """Read it once."""
        return cls(campaign, campaign.state, status(campaign))

    @cached_property
    def model(self) -> Model:
        """The model after all measurements."""
        return self.campaign.model

    @property
    def simulated(self) -> bool:
        """Whether any recording is labelled as simulated."""
        return self.status.simulated

    @property
    def used(self) -> tuple[Measurement, ...]:
        """Measurements that the model uses."""
        return self.state.used

    @cached_property
    def sd_percent(self) -> np.ndarray:
        """(n, count) sd of each frequency at the poses that stand for the workspace, in %."""
        p = self.model.workspace_prediction
        return 100 * p.frequency_sd_hz / p.frequency_hz
