"""A campaign's Rerun recording: every view of every tab shows something, and what is true."""

import numpy as np
import pytest
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from planner.replay import replay
from planner.report.rerun_chart import HEIGHT, ChartAxis, log_range
from planner.report.rerun.story import Story
from planner.report.rerun.campaign import _blueprint

# What a view of each kind draws.
DRAWN = {
    "3D": ("Points3D", "LineStrips3D", "Capsules3D", "Boxes3D", "Asset3D", "Mesh3D"),
    "2D": ("LineStrips2D", "Points2D", "Image"),
    "TextLog": ("TextLog",),
    "TextDocument": ("TextDocument",),
}
LARGEST_BYTES = 20_000_000 / 30  # a measurement's share of what 30 may take


def views(part):
    """All views of a blueprint's container."""
    if isinstance(part, rrb.View):
        return [part]
    return [view for child in part.contents for view in views(child)]


@pytest.fixture(scope="module")
def told(named, tmp_path_factory):
    """The campaign, its file, and the rows of each entity: (timelines, components)."""
    rrd = tmp_path_factory.mktemp("rrd") / "named.rrd"
    with Story(named.cell, rrd, viewer=False, simulated=True) as story:
        for step in replay(named):
            story.tell(step.entry, step.model, step.measured)
    reader, rows = RrdReader(rrd), {}
    for chunk in reader.stream(store=reader.recordings()[0]):
        for row in chunk.to_record_batch().to_pylist():
            rows.setdefault(str(chunk.entity_path), []).append(row)
    return named, rrd, rows


def test_every_view_of_every_tab_has_something_to_draw(told):
    campaign, _, rows = told
    shown = views(_blueprint(campaign.cell).root_container)
    assert {str(view.class_identifier) for view in shown} == set(DRAWN)
    for view in shown:
        origin = str(view.origin)
        below = [e for e in rows if e == origin or e.startswith(f"{origin.rstrip('/')}/")]
        kinds = {name.split(":")[0] for e in below for row in rows[e] for name, v in row.items()
                 if v is not None}  # fmt: skip
        assert kinds & set(DRAWN[str(view.class_identifier)]), (view.name, origin)


def test_all_is_on_a_dark_ground_whatever_theme_the_viewer_has(told):
    """Much of it is white: measured curves, names and legends."""
    campaign, *_ = told
    for view in views(_blueprint(campaign.cell).root_container):
        if str(view.class_identifier) in ("2D", "3D"):
            (ground,) = view.properties["Background"].color.as_arrow_array().to_pylist()
            assert all(ground >> shift & 255 < 40 for shift in (8, 16, 24)), view.name


def test_each_tab_has_a_name(told):
    campaign, *_ = told
    tabs = _blueprint(campaign.cell).root_container.contents
    assert [tab.name for tab in tabs] == ["Cell", "FRFs", "Modes", "Progress", "What is what"]


def test_the_file_is_small(told):
    campaign, rrd, _ = told
    assert rrd.stat().st_size < LARGEST_BYTES * len(campaign.state.used)


def test_measured_frfs_stand_where_the_axes_say(told):
    """Read back from the picture: the highest point of the line is the FRF's largest value."""
    campaign, _, rows = told
    pose = campaign.state.used[-1]
    frf = campaign.frf_of(pose, campaign.cell.config.modes)
    low, high = campaign.cell.config.modes.band_hz
    inside = (frf.frequency_hz >= low) & (frf.frequency_hz <= high)
    size = np.abs(frf.accelerance[2, 2, inside])
    strips = rows["/frf/zz/measured"][-1]["LineStrips2D:strips"]
    drawn = np.concatenate([np.array(strip) for strip in strips])
    words = rows["/frf/zz/words"][-1]
    places = dict(zip(words["Points2D:labels"], words["Points2D:positions"], strict=True))
    ticks = {float(t): p for t, p in places.items() if t.replace(".", "", 1).isdigit()}
    across = sorted((p[0], t) for t, p in ticks.items() if p[1] > HEIGHT)
    x, hz = np.array(across).T
    peak = drawn[np.argmin(drawn[:, 1])]
    at = hz[0] + (peak[0] - x[0]) * (hz[-1] - hz[0]) / (x[-1] - x[0])
    assert at == pytest.approx(frf.frequency_hz[inside][np.argmax(size)], abs=0.5)


def test_modes_move_on_a_timeline_of_their_own_and_stand_still_on_the_other(told):
    _, _, rows = told
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


def test_an_axis_shows_what_it_should():
    log = ChartAxis(1e-3, 10.0, "", log=True)
    assert log.share(np.array([1e-3, 0.1, 10.0, 1e-9])).tolist() == pytest.approx([0, 0.5, 1, 0])
    assert log.ticks.tolist() == pytest.approx([1e-3, 1e-2, 0.1, 1, 10])
    assert ChartAxis(0.5, 6.5, "").ticks.tolist() == [1, 2, 3, 4, 5, 6]
    assert ChartAxis(4.0, 80.0, "").ticks.tolist() == [20, 40, 60, 80]
    assert ChartAxis(0.2, 0.9, "", log=True).ticks.tolist() == pytest.approx([0.2, 0.5])
    low, high = log_range([np.array([np.nan, 1e-9, 5.0])])
    assert low == pytest.approx(8.0e-4)
    assert high == pytest.approx(8.0)
    assert log_range([np.array([np.nan])]) == (1e-3, 1.0)
