"""A campaign told step by step to Rerun: the same steps give the same recording."""

from pathlib import Path

from planner.campaign.cell import Cell
from planner.campaign.events import Entry
from planner.campaign.model import Model
from planner.dataset.measure import MeasuredPose


class EventLogger:
    """Tells each event of a campaign to a Rerun recording and/or live viewer, or to nobody."""

    def __init__(self, cell: Cell, rrd: Path | None, viewer: bool, simulated: bool = False):
        self._view = None
        if rrd is not None or viewer:
            from planner.report.rerun.campaign import RerunView

            self._view = RerunView(cell, rrd, viewer, simulated)

    def __enter__(self) -> "EventLogger":
        return self

    def __exit__(self, *error: object) -> None:
        if self._view is not None:
            self._view.close()

    def log(self, entry: Entry, model: Model, measured: MeasuredPose | None = None) -> None:
        """Show one event; `model` is that after it."""
        if self._view is not None:
            self._view.log(entry, model, measured)
