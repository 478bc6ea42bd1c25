"""A Rerun recording of charts alone: a tab for each group of them, and what is what."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from planner.report.rerun_chart import Chart, chart_view, draw
from planner.report.rerun_stream import open_stream

Sheets = Mapping[str, Sequence[Chart]]


def record_sheets(
    sheets: Sheets,
    kind: str,
    name: str,
    note: str,
    rrd: Path,
    more: Callable[[rr.RecordingStream], rrb.View] | None = None,
) -> None:
    """Write the charts of each tab by its name, one above the other.

    `kind` says which answer it is, `more` draws what is no chart and gives its view. InputError if
    the file cannot be written.
    """
    paths = {
        tab: [f"{kind}/{i}/{k}" for k in range(len(charts))]
        for i, (tab, charts) in enumerate(sheets.items())
    }
    tabs: list[rrb.View | rrb.Container] = []
    for tab, charts in sheets.items():
        views = [
            chart_view(path, chart.title, chart.wide)
            for path, chart in zip(paths[tab], charts, strict=True)
        ]
        tabs.append(rrb.Vertical(*views, name=tab))
    # The blueprint comes first: a viewer that is open shows the tabs at once.
    stream = open_stream(f"{kind}|{name}", name, rrb.Blueprint(), rrd)
    for tab, charts in sheets.items():
        for path, chart in zip(paths[tab], charts, strict=True):
            draw(stream, path, chart)
    if more is not None:
        tabs.append(more(stream))
    text = rr.TextDocument(f"# {name}\n{note}", media_type="text/markdown")
    stream.log("note", text, static=True)
    tabs.append(rrb.TextDocumentView(origin="/note", name="What is what"))
    hidden = rrb.TimePanel(state="hidden")
    stream.send_blueprint(rrb.Blueprint(rrb.Tabs(*tabs), hidden, collapse_panels=True))
    stream.flush(timeout_sec=10.0)
    stream.disconnect()
