"""A campaign told step by step to Rerun: the same steps give the same recording."""

from pathlib import Path

from planner.campaign import events
from planner.campaign.cell import Cell
from planner.campaign.model import Model
from planner.campaign.undo import in_words
from planner.dataset.measure import MeasuredPose


class EventLogger:
    """Tells each event of a campaign to a Rerun recording and/or live viewer, or to nobody."""

    def __init__(self, cell: Cell, rrd: Path | None, viewer: bool, simulated: bool = False):
        self._view = None
        self._before: Model | None = None  # the model of the entry told last
        if rrd is not None or viewer:
            from planner.report.rerun.campaign import RerunView

            self._view = RerunView(cell, rrd, viewer, simulated)

    def __enter__(self) -> "EventLogger":
        return self

    def __exit__(self, *error: object) -> None:
        if self._view is not None:
            self._view.close()

    def log(
        self,
        entry: events.Entry,
        model: Model,
        measured: MeasuredPose | None = None,
    ) -> None:
        """Show one event; `model` is that after it."""
        if self._view is None:
            return
        view, event, number = self._view, entry.event, len(model.labelled)
        match event:
            case events.Proposed():
                for proposal in event.proposals:
                    view.proposal(number, proposal)
            case events.Imported():
                self._imported(event, model, measured)
            case events.Confirmed():
                self._measurement(event.pose, model, None, f"Confirmed {event.pose}")
            case events.Refused():
                for hit in event.hits:
                    view.text(number, f"Refused {hit.file}: {hit.reason}", "WARN")
            case events.Skipped() | events.Withdrawn():
                reason = f": {event.reason}" if event.reason else ""
                view.text(number, f"{type(event).__name__} {event.pose}{reason}", "WARN")
            case events.Starred():
                view.text(number, f"Starred {event.pose}", "INFO")
            case events.Undone():
                view.text(number, f"{in_words(entry).capitalize()} of the log", "WARN")
            case events.FilesShown() | events.FilesPlaced():
                return
            case _:
                view.text(number, f"Configured {model.cell.robot.name}", "INFO")
        if not isinstance(event, events.Proposed | events.Refused | events.Starred):
            view.learning(number, model.frequency_sd_percent)
        self._before = model

    def _imported(
        self, event: events.Imported, model: Model, measured: MeasuredPose | None
    ) -> None:
        assert self._view is not None
        number = len(model.labelled)
        found = ", ".join(f"{m.frequency_hz:.2f} Hz" for m in event.modes if m.likely)
        text = f"Imported {event.pose}: {found or 'no usable modes'}"
        if any(hit.simulated for hit in event.hits):
            self._view.label_simulated()
        for hit in event.hits:
            if not hit.accepted:
                self._view.text(number, f"Refused {hit.file}: {hit.reason}", "WARN")
        if event.question is not None:
            self._view.text(number, f"Held back: {event.question.text}", "WARN")
        else:
            self._measurement(event.pose, model, measured, text)

    def _measurement(
        self, name: str, model: Model, measured: MeasuredPose | None, text: str
    ) -> None:
        assert self._view is not None
        number = len(model.labelled)
        pose = next((p for p in model.labelled if p.pose == name), None)
        if pose is None:
            self._view.text(number, text, "WARN")
        else:
            self._view.measurement(number, model, self._before, pose, measured, text)
