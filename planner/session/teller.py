"""What the log gained and Rerun has not shown yet: pictures take seconds, and wait."""

from collections import deque
from collections.abc import Sequence

from planner.campaign.campaign import Campaign
from planner.campaign.events import AnyEvent, Entry, FilesPlaced, FilesShown, Imported
from planner.campaign.importing import ImportReport
from planner.campaign.model import Model
from planner.dataset.measure import MeasuredPose
from planner.report.rerun.story import Story


class Teller:
    """Keeps each new entry with the model right after it until there is time to show it."""

    def __init__(self, campaign: Campaign, story: Story):
        self._campaign, self._story = campaign, story
        self._noted = len(campaign.entries)
        self._untold: deque[tuple[Entry, Model, MeasuredPose | None]] = deque()

    def note(self, reports: Sequence[ImportReport] = ()) -> None:
        """Keep what the log gained."""
        found = {report.pose: report.measured for report in reports}
        for entry in self._campaign.entries[self._noted :]:
            event = entry.event
            if isinstance(event, FilesShown | FilesPlaced):  # nothing that pictures show
                continue
            measured = found.get(event.pose) if isinstance(event, Imported) else None
            self._untold.append((entry, self._campaign.model, measured))
        self._noted = len(self._campaign.entries)

    def tell(self) -> None:
        """Show it; what an interruption left over is shown the next time."""
        while self._untold:
            self._story.tell(*self._untold[0])
            self._untold.popleft()

    def gained(self) -> list[AnyEvent]:
        """What the log on disk holds since it was noted last."""
        return [entry.event for entry in Campaign(self._campaign.directory).entries[self._noted :]]
