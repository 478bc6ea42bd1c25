"""A campaign's Rerun recording: every view of every tab shows something, and what is true."""

import numpy as np
import pytest
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from planner.replay import replay
from planner.report.rerun.campaign import _blueprint
from planner.report.rerun.progress import MeasuredSeries
from planner.report.rerun.story import Story
from planner.report.rerun.stream import open_stream

# What a view of each kind draws.
DRAWN = {
    "3D": ("Points3D", "LineStrips3D", "Capsules3D", "Boxes3D", "Asset3D", "Mesh3D"),
    "2D": ("LineStrips2D", "EncodedImage"),
    "TimeSeries": ("Scalars",),
    "TextLog": ("TextLog",),
    "TextDocument": ("TextDocument",),
}
LARGEST_BYTES = 20_000_000 / 30  # a measurement's share of what 30 may take


def views(part):
    """All views of a blueprint's container."""
    if isinstance(part, rrb.View):
        return [part]
    return [view for child in part.contents for view in views(child)]


def rows_of(rrd):
    """The rows of each entity: (timelines, components)."""
    reader, rows = RrdReader(rrd), {}
    for chunk in reader.stream(store=reader.recordings()[0]):
        for row in chunk.to_record_batch().to_pylist():
            rows.setdefault(str(chunk.entity_path), []).append(row)
    return rows


@pytest.fixture(scope="module")
def told(named, tmp_path_factory):
    """The campaign, its file, the rows of each entity, and its blueprint."""
    rrd = tmp_path_factory.mktemp("rrd") / "named.rrd"
    with Story(named.cell, rrd, viewer=False, simulated=True) as story:
        for step in replay(named):
            story.tell(step.entry, step.model, step.measured)
    return named, rrd, rows_of(rrd), _blueprint(named.cell, "progress/0").root_container


def test_every_view_of_every_tab_has_something_to_draw(told):
    _, _, rows, tabs = told
    assert [tab.name for tab in tabs.contents] == [
        "Cell", "FRFs", "Modes", "Progress", "What is what",
    ]  # fmt: skip
    assert {str(view.class_identifier) for view in views(tabs)} == set(DRAWN)
    for view in views(tabs):
        origin = str(view.origin)
        below = [e for e in rows if e == origin or e.startswith(f"{origin.rstrip('/')}/")]
        kinds = {name.split(":")[0] for e in below for row in rows[e] for name, v in row.items()
                 if v is not None}  # fmt: skip
        assert kinds & set(DRAWN[str(view.class_identifier)]), (view.name, origin)


def test_bright_things_have_a_dark_ground_and_figures_a_white_one(told):
    for view in views(told[3]):
        kind = str(view.class_identifier)
        if kind in ("2D", "3D"):
            (ground,) = view.properties["Background"].color.as_arrow_array().to_pylist()
            parts = [ground >> shift & 255 for shift in (8, 16, 24)]
            assert max(parts) < 40 if kind == "3D" else min(parts) == 255, view.name


def test_the_file_is_small(told):
    campaign, rrd, *_ = told
    assert rrd.stat().st_size < LARGEST_BYTES * len(campaign.state.used)


def test_measured_modes_are_series_over_the_measurements(told):
    campaign, _, rows, _ = told
    for k in (1, 2):
        seen = rows[f"/progress/0/frequency/mode_{k}/measured"]
        values = [row["Scalars:scalars"][0] for row in seen if row.get("Scalars:scalars")]
        modes = [pose.modes[k - 1] for pose in campaign.model.labelled]
        assert values == [mode.frequency_hz for mode in modes if mode is not None]


def test_modes_move_on_a_timeline_of_their_own_and_stand_still_on_the_other(told):
    rows = told[2]
    moving = rows["/modes/mode_1/simulated"]
    frames = [row for row in moving if row.get("measurement") is None]
    still = [row for row in moving if row.get("measurement") is not None]
    assert len(still) == 2  # two measured poses
    assert len(frames) == 48
    first = np.array(frames[-24]["LineStrips3D:strips"])
    assert np.allclose(first, still[-1]["LineStrips3D:strips"])
    half = np.array(frames[-12]["LineStrips3D:strips"])
    rest = (first + half) / 2  # half a period later everything is on the other side
    assert np.max(np.abs(first - rest)) > 0.01
    ends = np.array(rows["/modes/mode_1/rest"][-1]["LineStrips3D:strips"])
    assert np.allclose(rest[0, 0], ends[0, 0], atol=1e-5)


def test_what_was_taken_back_is_in_no_series_that_is_shown(tmp_path):
    shown = []
    stream = open_stream("key", "name", rrb.Blueprint(), tmp_path / "a.rrd")
    series = MeasuredSeries(stream, shown.append)
    for number, value in ((1, 5.0), (2, 4.0), (2, 4.0), (3, 9.0), (2, 4.0), (3, 3.0)):
        series.log(number, {"learning/mode_1": value, "learning/mode_2": np.nan})
    stream.flush(timeout_sec=10.0)
    stream.disconnect()
    assert shown == ["progress/1"]
    rows = rows_of(tmp_path / "a.rrd")
    assert not any("mode_2" in entity for entity in rows)
    told = [row for row in rows["/progress/1/learning/mode_1"] if row.get("Scalars:scalars")]
    values = [(row["measurement"], row["Scalars:scalars"][0]) for row in told]
    assert values == [(1, 5.0), (2, 4.0), (3, 3.0)]
