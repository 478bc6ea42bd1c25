"""Rerun recordings: figures lie where their numbers say, views show something, robots move."""

import re
from contextlib import closing
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
import rerun.blueprint as rrb
from matplotlib.figure import Figure

from planner.campaign.cell import Cell
from planner.campaign.config import load_campaign_config
from planner.campaign.events import Proposal
from planner.replay import replay
from planner.report.rerun.campaign import RerunView, _blueprint
from planner.report.rerun.figures import one_by_one, open_stream, record_figures
from planner.report.rerun.progress import MeasuredSeries
from tests.support.rerun_columns import WORLD, Frames, columns_of, lines_of, rotation, rows_of
from tests.support.robots import campaign_text, make_arm, urdf

X = np.linspace(1.0, 9.0, 33)


def figure(scale: float = 1.0) -> Figure:
    made = Figure(figsize=(6, 4), layout="constrained")
    left, right = made.subplots(1, 2)
    gap = np.where(np.abs(X - 5) < 0.6, np.nan, X)
    left.semilogy(X, scale * 10.0**gap, label="grown (m)")
    left.plot(X, X, "--", label="dashed")
    left.set(xlim=(0, 10), ylim=(1e-3, 1e10))
    right.plot(X, X, "o", label="points")
    right.plot(2 * X, X)
    right.set(xlim=(0, 10), ylim=(0, 10))
    return made


def test_lines_lie_in_the_picture_where_their_numbers_say(tmp_path):
    shown = figure()
    record_figures({"some_plot": shown}, "KR240", "SIMULATED", tmp_path / "a.rrd")
    found = lines_of(tmp_path / "a.rrd")
    assert set(found) == {"/figures/some_plot/0/grown__m_", "/figures/some_plot/1/line_1"}
    parts = found["/figures/some_plot/0/grown__m_"]
    assert len(parts) == 2  # the gap stays one
    places = np.concatenate(parts)
    expected = [shown.axes[0].transData.transform((x, 10.0**x)) for x in X if abs(x - 5) >= 0.6]
    scale = 160 / shown.dpi
    height = shown.bbox.height
    assert places == pytest.approx(
        np.array([(scale * x, scale * (height - y)) for x, y in expected]), abs=0.5
    )
    (beyond,) = found["/figures/some_plot/1/line_1"]
    assert np.max(beyond[:, 0]) <= scale * shown.axes[1].bbox.x1 + 2.0  # cut off at the frame
    assert [line.get_linestyle() for line in shown.axes[0].lines] == ["-", "--"]
    text = columns_of(tmp_path / "a.rrd")[("/note", "TextDocument:text")]
    assert text == [["# KR240\nSIMULATED"]]


def test_figures_follow_each_other_on_a_timeline(tmp_path):
    each = one_by_one("pose", "FRFs", (figure(scale) for scale in (1.0, 0.1, 0.01)))
    record_figures({}, "KR240", "", tmp_path / "a.rrd", each)
    found = columns_of(tmp_path / "a.rrd")
    drawn = [np.array(s[0]) for s in found[("/pose/0/grown__m_", "LineStrips2D:strips")] if s]
    assert found[("/pose/0/grown__m_", "pose")] == [1, 2, 3]
    assert all(np.all(a[:, 1] < b[:, 1]) for a, b in pairwise(drawn))


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


def by_entity(rrd):
    """The rows of each entity: (timelines, components)."""
    rows = {}
    for entity, row in rows_of(rrd):
        rows.setdefault(entity, []).append(row)
    return rows


@pytest.fixture(scope="module")
def told(named, tmp_path_factory):
    """The campaign, its file, the rows of each entity, and its blueprint."""
    rrd = tmp_path_factory.mktemp("rrd") / "named.rrd"
    with closing(RerunView(named.cell, rrd, simulated=True)) as story:
        for step in replay(named):
            story.log(step.entry, step.model, step.measured)
    return named, rrd, by_entity(rrd), _blueprint(named.cell, "progress/0").root_container


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
        kind = str(view.class_identifier)
        assert kinds & set(DRAWN[kind]), (view.name, origin)
        if kind in ("2D", "3D"):  # bright things have a dark ground, figures a white one
            (ground,) = view.properties["Background"].color.as_arrow_array().to_pylist()
            parts = [ground >> shift & 255 for shift in (8, 16, 24)]
            assert max(parts) < 40 if kind == "3D" else min(parts) == 255, view.name


def test_measured_modes_are_series_over_the_measurements_in_a_small_file(told):
    campaign, rrd, rows, _ = told
    assert rrd.stat().st_size < LARGEST_BYTES * len(campaign.state.used)
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
    rows = by_entity(tmp_path / "a.rrd")
    assert not any("mode_2" in entity for entity in rows)
    told = [row for row in rows["/progress/1/learning/mode_1"] if row.get("Scalars:scalars")]
    values = [(row["measurement"], row["Scalars:scalars"][0]) for row in told]
    assert values == [(1, 5.0), (2, 4.0), (3, 3.0)]


POSES_DEG = ((10.0, -80.0, 90.0, 5.0, 30.0, 20.0), (-35.0, -60.0, 70.0, -25.0, 65.0, -15.0))
LINKS = ("base_link", *(f"link_{i}" for i in range(1, 7)))
BARE = re.sub(r"<(visual|collision)>.*?</\1>", "", urdf())
NO_VISUALS = re.sub(r"<visual>.*?</visual>", "", urdf())
FENCE = (
    '[[obstacle]]\nname = "fence"\ncenter_m = [2, 2, 0.5]\nsize_m = [0.1, 0.4, 1.0]\n'
    "rpy_deg = [20, 30, 40]\n"
)
TRIANGLE = (
    "solid t\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"
    "endfacet\nendsolid t\n"
)


def record(folder, text):
    """The cell, and what is read back after proposals at POSES_DEG (measurements 0 and 1)."""
    robot_toml = make_arm(folder / "robot")
    robot_toml.write_text(robot_toml.read_text() + FENCE)
    (folder / "robot" / "arm.urdf").write_text(text)
    (folder / "plan").mkdir()
    (folder / "plan" / "campaign.toml").write_text(campaign_text())
    cell = Cell.load(robot_toml, load_campaign_config(folder / "plan" / "campaign.toml"))
    view = RerunView(cell, folder / "out.rrd")
    for number, degrees in enumerate(POSES_DEG):
        position = tuple(cell.robot.forward(np.deg2rad(degrees))[1])
        view.proposal(number, Proposal(f"P{number}", degrees, position, 1.0, "test"))
    view.close()
    return cell, Frames(folder / "out.rrd")


def capsule_ends(frames, entity, number):
    """Both ends of an entity's capsules in the world (n, 2, 3) at a measurement."""
    shape, place = frames.shapes[entity], frames.placement(frames.frame(entity), number)
    ends = []
    for length, turn in zip(
        shape["Capsules3D:lengths"], shape["Capsules3D:quaternions"], strict=True
    ):
        own = np.array([[0.0, 0.0, 0.0], rotation(turn) @ [0.0, 0.0, length]])
        ends.append(own @ place[:3, :3].T + place[:3, 3])
    return np.array(ends)


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    return record(tmp_path_factory.mktemp("bare"), BARE)


def test_without_shapes_capsules_go_from_joint_to_joint_at_every_pose(bare):
    cell, frames = bare
    robot, data = cell.robot, cell.robot.model.createData()
    drawn = {entity for entity in frames.shapes if entity.startswith("/robot/")}
    assert drawn == {f"/robot/capsules/{link}" for link in LINKS}
    for number, degrees in enumerate(POSES_DEG):
        q = np.deg2rad(degrees)
        pin.forwardKinematics(robot.model, data, q)
        points = [np.array(place.translation) for place in data.oMi] + [robot.forward(q)[1]]
        for body, link in enumerate(LINKS):
            ends = capsule_ends(frames, f"/robot/capsules/{link}", number)
            assert np.allclose(ends, [points[body : body + 2]], atol=1e-5), link


def test_what_lies_in_the_cell_lies_in_the_space_of_the_robot(bare):
    cell, frames = bare
    assert {"/cell/obstacles", "/cell/proposed"} <= set(frames.shapes)
    assert {frames.root(frames.frame(entity)) for entity in frames.shapes} == {WORLD}
    assert frames.root("base_link") == WORLD
    for number, degrees in enumerate(POSES_DEG):
        turn, position = cell.robot.forward(np.deg2rad(degrees))
        tool = frames.placement("tool", number)
        assert np.allclose(tool[:3, 3], position, atol=1e-5)
        assert np.allclose(tool[:3, :3], turn, atol=1e-5)
    last = cell.robot.forward(np.deg2rad(POSES_DEG[-1]))[1]
    assert np.allclose(frames.shapes["/cell/proposed"]["Points3D:positions"], [last])
    fence = frames.shapes["/cell/obstacles"]  # turned as the robot avoids it
    expected = pin.rpy.rpyToMatrix(*np.deg2rad([20.0, 30.0, 40.0]))
    assert np.allclose(rotation(fence["Boxes3D:quaternions"][1]), expected, atol=1e-6)
    assert np.allclose(fence["Boxes3D:centers"][1], [2.0, 2.0, 0.5])


@pytest.mark.parametrize(
    ("text", "kind"), [(urdf(), "visual_geometries"), (NO_VISUALS, "collision_geometries")]
)
def test_collision_shapes_are_drawn_only_where_there_are_no_visual_ones(text, kind, tmp_path):
    _, frames = record(tmp_path, text)
    drawn = [entity for entity in frames.shapes if entity.startswith("/robot/")]
    assert {frames.frame(entity) for entity in drawn} == set(LINKS)
    assert len(drawn) == 7
    assert all(f"/{kind}/" in entity for entity in drawn)


def test_meshes_are_found_beside_the_urdf_and_capsules_stand_for_missing_ones(tmp_path):
    mesh = '<visual><geometry><mesh filename="package://arm/meshes/{}.stl"/></geometry></visual>'
    text = BARE
    for link, file in (("link_2", "upper"), ("link_4", "lost")):
        text = text.replace(f'<link name="{link}">', f'<link name="{link}">{mesh.format(file)}')
    folder = tmp_path / "robot" / "arm" / "meshes"
    folder.mkdir(parents=True)
    (folder / "upper.stl").write_text(TRIANGLE)
    _, frames = record(tmp_path, text)
    drawn = {frames.frame(entity): entity for entity in frames.shapes if "/robot/" in entity}
    assert set(drawn) == set(LINKS)
    assert "/visual_geometries/" in drawn["link_2"]
    assert drawn["link_4"] == "/robot/capsules/link_4"
