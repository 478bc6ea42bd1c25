"""Descriptions as makers publish them: meshes found, what is missing said, sizes of meshes."""

import os
import shutil
import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from planner.check.examine import examine
from planner.errors import InputError
from planner.robot.collision import Collisions
from planner.robot.mesh_files import find_mesh
from planner.robot.robot import Robot
from tests.support.published import AXES, PACKAGE, published, robot_toml

NAME = f"package://{PACKAGE}/meshes/link_1.stl"
PACKAGE_XML = f"<package><name> {PACKAGE} </name></package>"


def above(folder: Path, _) -> Path:
    return published(folder)


def beside(folder: Path, _) -> Path:
    urdf = published(folder / "src")
    moved = folder / "src" / "cells" / "one" / "arm.urdf"
    moved.parent.mkdir(parents=True)
    return Path(shutil.move(urdf, moved))


def named(folder: Path, _) -> Path:
    """The package that package.xml names so has another folder, beside that of the URDF."""
    urdf = published(folder, package="arm-main-2.1")
    (folder / "arm-main-2.1" / "package.xml").write_text(PACKAGE_XML)
    moved = folder / "bringup" / "urdf" / "arm.urdf"
    moved.parent.mkdir(parents=True)
    (folder / "bringup" / "package.xml").write_text("<package><name>bringup</name></package>")
    return Path(shutil.move(urdf, moved))


def on_path(variable: str, package: str):
    def lay(folder: Path, monkeypatch) -> Path:
        urdf = published(folder / "ws", package=package)
        monkeypatch.setenv(variable, os.pathsep.join([str(folder / "none"), str(folder / "ws")]))
        moved = folder / "elsewhere" / "arm.urdf"
        moved.parent.mkdir()
        return Path(shutil.move(urdf, moved))

    return lay


def renamed(folder: Path, _) -> Path:
    return published(folder, package="download (2)")


def tail(folder: Path, _) -> Path:
    """Meshes in the folder of the URDF, one step of their names less."""
    urdf = published(folder, package="flat")
    shutil.move(urdf.parents[1] / "meshes", urdf.parent / "shapes")
    shutil.move(urdf.parent / "shapes" / "link_1.stl", urdf.parent / "link_1.stl")
    return urdf


LAYOUTS = {
    "a folder above": above, "a folder beside": beside, "package.xml": named, "renamed": renamed,
    "ROS_PACKAGE_PATH": on_path("ROS_PACKAGE_PATH", PACKAGE), "tail": tail,
    "a repository on ROS_PACKAGE_PATH": on_path("ROS_PACKAGE_PATH", f"repository/{PACKAGE}"),
    "AMENT_PREFIX_PATH": on_path("AMENT_PREFIX_PATH", f"share/{PACKAGE}"),
}  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_meshes_are_found_where_they_lie(layout, tmp_path, monkeypatch):
    for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(variable, raising=False)
    urdf = layout(tmp_path, monkeypatch)
    found = find_mesh(urdf, NAME)
    assert found is not None
    assert found.name == "link_1.stl"
    assert find_mesh(urdf, NAME.replace("link_1", "lost")) is None
    assert find_mesh(urdf, "link\0.stl") is None
    assert find_mesh(urdf, "") is None


def test_a_whole_description_has_nothing_wrong(tmp_path):
    path = robot_toml(tmp_path / "robot.toml", published(tmp_path, inertias=True))
    robot = Robot.load(str(path))
    assert [r for r in examine(robot).remarks if r.severity != "note"] == []
    assert Collisions(robot).unchecked is None
    q = np.random.default_rng(0).uniform(robot.lower_rad, robot.upper_rad, (100, 6))
    free = [not Collisions(robot).contacts(one) for one in q]
    assert 20 < sum(free) < 100


BROKEN = {
    "missing": ('<mesh filename="package://arm_description/meshes/link_3.stl"/>',
                '<mesh filename="package://gone/lost.stl"/>', "lost.stl cannot be found"),
    "size 0": ('<mesh filename="package://arm_description/meshes/link_3.stl"/>',
               '<box size="0 0 0"/>', "a box of size 0, 0, 0"),
    "no radius": ('<mesh filename="package://arm_description/meshes/link_3.stl"/>',
                  '<sphere radius="0"/>', "a sphere of size 0"),
    "git-lfs": ("", b"version https://git-lfs.github.com/spec/v1\n", "link_3.stl is no mesh"),
    "cut off": ("", b"solid x", "link_3.stl is no mesh"),
}  # fmt: skip


@pytest.mark.parametrize(("old", "new", "words"), BROKEN.values(), ids=BROKEN)
def test_a_shape_that_cannot_be_used_is_left_out_with_a_sentence(old, new, words, tmp_path):
    urdf = published(tmp_path, inertias=True)
    text = urdf.read_text()
    if old:
        assert text.count(old) == 2  # visual and collision
        urdf.write_text(text.replace(old, new))
    else:
        (urdf.parents[1] / "meshes" / "link_3.stl").write_bytes(new)
    collisions = Collisions(Robot.load(robot_toml(tmp_path / "robot.toml", urdf)))
    said = collisions.unchecked
    assert said is not None
    assert words in said
    assert "link_3" in said
    assert "link_2" not in said
    assert not collisions.none_checked
    warned = [r.what for r in examine(collisions.robot).remarks if r.severity == "warning"]
    assert warned == [said]


def test_the_size_of_a_mesh_tells_units(tmp_path):
    urdf = published(tmp_path, inertias=True)
    text = urdf.read_text()
    start = text.index("<inertia ", text.index('name="link_2"'))
    end = text.index("/>", start)
    big = '<inertia ixx="700000" iyy="700000" izz="80000" ixy="0" ixz="0" iyz="0"'
    urdf.write_text(text[:start] + big + text[end:])
    robot = Robot.load(robot_toml(tmp_path / "robot.toml", urdf))
    (warned,) = [r for r in examine(robot).remarks if r.severity == "warning" and "far" in r.what]
    assert "link_2" in warned.where
    assert "a link of 0.77 m" in warned.what  # diagonal of 0.2 x 0.2 x 0.72


def test_xacro_is_expanded_or_said_to_be_xacro(tmp_path, monkeypatch):
    urdf = published(tmp_path, inertias=True)
    whole = urdf.read_text()
    source = urdf.with_suffix(".xacro")
    source.write_text('<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:arm/></robot>')
    path = robot_toml(tmp_path / "robot.toml", source)
    monkeypatch.setitem(sys.modules, "xacro", None)
    with pytest.raises(InputError, match=r"xacro arm\.xacro > robot\.urdf"):
        Robot.load(path)

    def process_file(name):
        assert name == str(source)
        index = import_module("ament_index_python.packages")  # as xacro does for $(find NAME)
        assert index.get_package_share_directory(PACKAGE) == str(tmp_path / PACKAGE)
        return SimpleNamespace(toxml=lambda encoding: whole.encode(encoding))

    monkeypatch.setitem(sys.modules, "xacro", SimpleNamespace(process_file=process_file))
    assert len(Robot.load(path).joint_names) == len(AXES)
    assert "ament_index_python" not in sys.modules
    monkeypatch.setitem(sys.modules, "xacro", SimpleNamespace(process_file=lambda name: 1 / 0))
    with pytest.raises(InputError, match="could not be expanded"):
        Robot.load(path)


def test_a_comment_on_xacro_is_none(tmp_path):
    urdf = published(tmp_path, inertias=True)
    head = '<robot xmlns:xacro="http://ros.org/wiki/xacro" name="p"><!-- <xacro:arm/> made by xacro'
    urdf.write_text(urdf.read_text().replace('<robot name="published">', f"{head} -->"))
    assert len(Robot.load(robot_toml(tmp_path / "robot.toml", urdf)).joint_names) == len(AXES)
