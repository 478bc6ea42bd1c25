"""The robot in a recording: shapes or capsules that move with it, in one space with the cell."""

import re

import numpy as np
import pinocchio as pin
import pytest

from planner.campaign.cell import Cell
from planner.campaign.config import load_campaign_config
from planner.campaign.events import Proposal
from planner.report.rerun.campaign import RerunView
from tests.support.rerun_frames import WORLD, Frames, rotation
from tests.support.robots import campaign_text, make_arm, urdf

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
    for number, degrees in enumerate(POSES_DEG):
        q = np.deg2rad(degrees)
        pin.forwardKinematics(robot.model, data, q)
        points = [np.array(place.translation) for place in data.oMi] + [robot.forward(q)[1]]
        for body, link in enumerate(LINKS):
            ends = capsule_ends(frames, f"/robot/capsules/{link}", number)
            assert np.allclose(ends, [points[body : body + 2]], atol=1e-5), link


def test_every_moving_link_moves_with_the_pose(bare):
    _, frames = bare
    drawn = {entity for entity in frames.shapes if entity.startswith("/robot/")}
    assert drawn == {f"/robot/capsules/{link}" for link in LINKS}
    for link in LINKS[1:]:
        first, second = (capsule_ends(frames, f"/robot/capsules/{link}", n) for n in (0, 1))
        assert np.max(np.abs(first - second)) > 0.005, link


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


def test_obstacles_are_turned_as_the_robot_avoids_them(bare):
    _, frames = bare
    fence = frames.shapes["/cell/obstacles"]
    expected = pin.rpy.rpyToMatrix(*np.deg2rad([20.0, 30.0, 40.0]))
    assert np.allclose(rotation(fence["Boxes3D:quaternions"][1]), expected, atol=1e-6)
    assert np.allclose(fence["Boxes3D:centers"][1], [2.0, 2.0, 0.5])


def test_collision_shapes_are_drawn_only_where_there_are_no_visual_ones(tmp_path):
    _, both = record(tmp_path / "both", urdf())
    assert len([entity for entity in both.shapes if "/visual_geometries/" in entity]) == 7
    assert not [entity for entity in both.shapes if "collision" in entity or "capsules" in entity]
    _, collision = record(tmp_path / "collision", NO_VISUALS)
    drawn = [entity for entity in collision.shapes if entity.startswith("/robot/")]
    assert {collision.frame(entity) for entity in drawn} == set(LINKS)
    assert all("/collision_geometries/" in entity for entity in drawn)


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
