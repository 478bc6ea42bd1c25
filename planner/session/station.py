"""What a session works with: campaign, folder, screen, keys and what runs beside it."""

import time
from dataclasses import dataclass

from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.campaign.events import Proposal
from planner.session.diagnosis_process import DiagnosisProcess
from planner.session.hit_verdicts import Verdicts
from planner.session.inbox import Inbox
from planner.session.keys import Keys
from planner.session.screen import Screen
from planner.session.teller import Teller

POLL_S = 0.2


@dataclass(frozen=True, eq=False)
class Station:
    """Nothing of it changes in the course of a session.

    `started` and `deadline` are monotonic times (s); a diagnosis is asked for from
    `explain_from` measured poses on.
    """

    campaign: Campaign
    inbox: Inbox
    screen: Screen
    keys: Keys
    teller: Teller
    verdicts: Verdicts
    auto: bool
    hits_per_pose: int | None
    explaining: DiagnosisProcess | None
    explain_from: int
    started: float
    deadline: float | None

    def hits_at(self, proposal: Proposal) -> int:
        """How many hits make this pose."""
        each = self.campaign.cell.config.cost.hits_per_axis
        return self.hits_per_pose or each * len(proposal.hits)

    def key(self) -> str | None:
        """The next key, or None after POLL_S."""
        return self.keys.get(POLL_S)

    @property
    def late(self) -> bool:
        """Whether the time limit is over."""
        return self.deadline is not None and time.monotonic() > self.deadline

    def say(self, sentence: str, style: str = "") -> None:
        """A sentence under the page."""
        self.screen.say(Text(sentence, style=style))

    def say_diagnosis(self, wait: bool = False) -> None:
        """Say what the diagnosis beside the session found, once it is through."""
        text = self.explaining.told(wait) if self.explaining is not None else None
        if text is not None:
            self.say(f"Diagnosis: {text}", "bold")
