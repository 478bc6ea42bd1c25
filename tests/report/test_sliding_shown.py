"""Joints that slide on screens, in programs of controllers, in Rerun and in the check's remarks."""

import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from rich.console import Console

from planner.campaign.cell import Cell, plan_of
from planner.campaign.config import load_campaign_config
from planner.campaign.events import Proposal
from planner.check.examine import examine
from planner.errors import InputError
from planner.report.rerun.campaign import RerunView
from planner.robot.controller_program import PoseToDrive, program
from planner.robot.robot import Robot
from planner.session.pose_screen import PosePage
from tests.support.rails import GANTRY, GANTRY_BOX, make_sliding, sliding_campaign
from tests.support.rerun_columns import Frames

STANDS = (1200.0, 30.0, -10.0)
TIP = (0, 0.03, -0.25)


def test_the_screen_shows_the_place_on_the_rail(tmp_path):
    robot = Robot.load(make_sliding(tmp_path))
    proposal = Proposal("P001", STANDS, (0.9, 1.4, 0.6), 1.0, "test")
    page = PosePage(proposal, 1, robot.joints, "tcp", 4, (), (9.0,), (0.1,), tmp_path)
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(page.page())
    shown = console.export_text()
    assert re.search(r"rail +1200\.000 mm", shown)
    assert re.search(r"lift +-10\.000°", shown)


@pytest.fixture
def external(tmp_path) -> Robot:
    return Robot.load(make_sliding(tmp_path, said='controller = {external = ["rail"]}'))


def test_programs_drive_a_rail_as_an_external_axis(external):
    poses = [PoseToDrive("P001", STANDS)]
    assert "PTP {A1 30.0000, A2 -10.0000, E1 1200.0000}" in program("krl", external, "c", poses)
    target = "[[30.0000,-10.0000,0,0,0,0],[1200.0000,9E9,9E9,9E9,9E9,9E9]]"
    assert target in program("rapid", external, "c", poses)
    header, row = program("poses", external, "c", poses).splitlines()
    assert header == "pose,A1_deg,A2_deg,E1_mm,note"
    assert row.startswith("P001,30.0000,-10.0000,1200.0000,")


def test_an_axis_of_the_arm_does_not_slide(tmp_path):
    robot = Robot.load(make_sliding(tmp_path))
    with pytest.raises(InputError, match=r"rail slides.*\[controller\] external, or export poses"):
        program("krl", robot, "c", [PoseToDrive("P001", STANDS)])
    assert "A1_mm,A2_deg,A3_deg" in program("poses", robot, "c", [PoseToDrive("P001", STANDS)])


@pytest.mark.parametrize("on", ["an external axis", "the arm"])
def test_urscript_says_what_it_cannot_do_and_what_can(tmp_path, external, on):
    arm = Robot.load(make_sliding(tmp_path / "arm"))
    robot = external if on == "an external axis" else arm
    has = "2 such joints and 1 external axis" if robot is external else (
        r"2 such joints and 1 that slide \(rail\)"
    )  # fmt: skip
    said = f"urscript can only move an arm of 6 joints that turn, and this robot has {has}; export "
    with pytest.raises(InputError, match=f"{said}krl or rapid.* or poses, a table"):
        program("urscript", robot, "c", [PoseToDrive("P001", STANDS)])
    assert program("krl", external, "c", [PoseToDrive("P001", STANDS)])


def test_a_gantry_moves_in_the_recording(tmp_path):
    toml = make_sliding(tmp_path / "robot", GANTRY, TIP)
    urdf = toml.with_name("robot.urdf")
    urdf.write_text(re.sub(r"<collision>.*?</collision>", "", urdf.read_text()))
    plan = sliding_campaign(tmp_path / "campaign.toml", GANTRY_BOX)
    cell = Cell.load(toml, load_campaign_config(plan))
    view, robot = RerunView(cell, tmp_path / "out.rrd"), cell.robot
    poses = ((500.0, 200.0, 300.0, 20.0, 10.0), (2100.0, -400.0, 650.0, -30.0, 40.0))
    for number, stated in enumerate(poses):
        place = tuple(robot.forward(robot.joints.internal(stated))[1])
        view.proposal(number, Proposal(f"P{number}", stated, place, 1.0, "test"))
    view.close()
    frames = Frames(tmp_path / "out.rrd")
    for number, stated in enumerate(poses):
        q = robot.joints.internal(stated)
        for name in ("z_link", "b_link"):
            frame = frames.frame(f"/robot/capsules/{name}")
            there = frames.placement(frame, number)[:3, 3]
            joint = [axis.name for axis in GANTRY].index(name.removesuffix("_link")) + 1
            data = robot.model.createData()
            pin.forwardKinematics(robot.model, data, q)
            assert there == pytest.approx(np.array(data.oMi[joint].translation), abs=1e-5)


def remarks(toml: Path, plan: Path) -> str:
    found = examine(Robot.load(toml), plan_of(load_campaign_config(plan), "campaign.toml"))
    return "\n".join(remark.sentence for remark in found.remarks)


def test_the_check_knows_what_looks_wrong_of_a_rail(tmp_path):
    toml = make_sliding(tmp_path / "robot")
    good = sliding_campaign(tmp_path / "good.toml")
    assert "millimetres" not in remarks(toml, good)
    metres = sliding_campaign(tmp_path / "metres.toml", ((0.0, 1.5), (-70.0, 70.0), (-60.0, 60.0)))
    assert "No joint slides beyond 1.5 mm, as if in metres." in remarks(toml, metres)
    urdf = toml.with_name("robot.urdf")
    urdf.write_text(urdf.read_text().replace('upper="2.0" velocity="1.0"',
                                             'upper="2000" velocity="1000"'))  # fmt: skip
    said = remarks(toml, good)
    assert "It slides from -0.2 to 2000 m, as if its limits were in millimetres." in said
    assert "Its speed limit is 1000 m/s." in said


def test_places_do_not_say_how_a_redundant_robot_stands(tmp_path):
    more = tuple(replace(a, name=f"{a.name}2") for a in GANTRY[3:])
    toml = make_sliding(tmp_path / "robot", (*GANTRY, *more), TIP)
    plan = tmp_path / "campaign.toml"
    plan.write_text(
        "[workspace]\nposition_m = [[1, 2], [-0.3, 0.3], [0.2, 0.8]]\ntool_axis = [0, 0, 1]\n"
        "[modes]\ncount = 2\nband_hz = [3.0, 60.0]\n"
    )
    assert "7 joints move the tool, and a place of it fixes 6" in remarks(toml, plan)
