"""Rails, turntables, followers and seven axes: held where robot.toml says, or refused in words."""

import re
from pathlib import Path

import numpy as np
import pytest

from planner.cli.run import run
from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.robot.robot import Robot
from tests.support.robots import campaign_text, make_arm

RAIL = (
    '<link name="floor"/><joint name="rail" type="{kind}"><parent link="floor"/>'
    '<child link="base_link"/><origin xyz="0.1 0 0.2" rpy="0 0.3 0"/><axis xyz="0 2 0"/>'
    '<limit lower="0" upper="3" velocity="1" effort="0"/>{more}</joint>'
)
FIXED = (
    '<link name="floor"/><joint name="rail" type="fixed"><parent link="floor"/>'
    '<child link="base_link"/><origin xyz="{xyz}" rpy="{rpy}"/></joint>'
)
TABLE = (  # an external turntable that carries the work, not the arm
    '<link name="table"><inertial><mass value="80"/><inertia ixx="3" iyy="3" izz="5" ixy="0" '
    'ixz="0" iyz="0"/></inertial></link><joint name="table_axis" type="continuous">'
    '<parent link="base_link"/><child link="table"/><origin xyz="1.5 0 0"/><axis xyz="0 0 1"/>'
    "</joint>"
)
Q = np.deg2rad([[10, -80, 90, 5, 40, -10], [-30, -60, 70, 20, 20, 0]])


def arm(folder: Path, more: str, toml: str = "") -> Path:
    """The small arm with more in its URDF, and more at the top of its robot.toml."""
    path = make_arm(folder)
    urdf = folder / "arm.urdf"
    urdf.write_text(urdf.read_text().replace("</robot>", more + "</robot>"))
    path.write_text(f"{path.read_text()}{toml}\n")
    return path


def modes(path: Path) -> np.ndarray:
    found = Simulation(Robot.load(path)).modes(Q, 6)
    return np.concatenate([found.frequency_hz, np.abs(found.residue).sum(axis=(2, 3))])


@pytest.mark.parametrize(
    ("kind", "held", "xyz", "rpy"),
    [("prismatic", "rail_m = 1.5", "0.1 1.5 0.2", "0 0.3 0"),
     ("prismatic", "rail_mm = 1500", "0.1 1.5 0.2", "0 0.3 0"),
     ("revolute", "rail_deg = 90", "0.1 0 0.2", f"0 {0.3 + np.pi / 2} 0"),
     ("continuous", "rail_deg = 360", "0.1 0 0.2", "0 0.3 0")],
)  # fmt: skip
def test_a_held_joint_is_a_fixed_one_there(kind, held, xyz, rpy, tmp_path):
    toml = f"[held]\n{held}"
    there = arm(tmp_path / "held", RAIL.format(kind=kind, more=""), toml)
    fixed = arm(tmp_path / "fixed", FIXED.format(xyz=xyz, rpy=rpy))
    np.testing.assert_allclose(modes(there), modes(fixed), rtol=1e-9)
    both = [Robot.load(path).forward(Q[0])[1] for path in (there, fixed)]
    np.testing.assert_allclose(*both, atol=1e-9)
    assert Robot.load(there).joint_names == Robot.load(fixed).joint_names


@pytest.mark.parametrize(
    ("toml", "words"),
    [("[held]\nrail = 1", "NAME_deg"),
     ("[held]\nrail_deg = 1", "rail_m"), ("[held]\nrails_m = 1", "names no joint"),
     ("[held]\nrail_m = 3.5", "limits of 0 to 3"),
     ("[held]\nrail_mm = 3500", "limits of 0 to 3000"), ("[held]\nrail_m = nan", "finite")],
)  # fmt: skip
def test_what_is_not_held_rightly_is_said(toml, words, tmp_path):
    with pytest.raises(InputError, match=words):
        Robot.load(arm(tmp_path, RAIL.format(kind="prismatic", more=""), toml))


def test_seven_axes_and_a_turntable_go_from_check_to_a_proposal(tmp_path, capsys):
    """The seventh joint turns the tool; the turntable beside the arm moves too."""
    robot = tmp_path / "robot"
    make_arm(robot)
    urdf = robot / "arm.urdf"
    wrist = (
        '<link name="link_7"><inertial><mass value="1"/><inertia ixx="0.002" iyy="0.002" '
        'izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="joint_a7" '
        'type="revolute"><parent link="link_6"/><child link="link_7"/><origin xyz="0.1 0 0"/>'
        '<axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="3" effort="0"/></joint>'
    )
    text = urdf.read_text().replace('<parent link="link_6"/>', '<parent link="link_7"/>')
    urdf.write_text(text.replace("</robot>", TABLE + wrist + "</robot>"))
    order = Robot.load(robot / "robot.toml").joint_names
    assert set(order) == {f"joint_a{k}" for k in range(1, 8)} | {"table_axis"}
    box = {"joint_a7": "[-20, 20]", "table_axis": "[-90, 90]"}
    ranges = re.findall(r"\[-?\d+, -?\d+\]|\(-?\d+, -?\d+\)", campaign_text())[:6]
    box |= {f"joint_a{k + 1}": one for k, one in enumerate(ranges)}
    plan = tmp_path / "campaign.toml"
    whole = ", ".join(box[name] for name in order)
    plan.write_text(re.sub(r"joints_deg = .*", f"joints_deg = [{whole}]", campaign_text(3))
                    .replace("candidates = 200", "candidates = 40"))  # fmt: skip
    toml = str(robot / "robot.toml")
    assert run(["check", toml, "--campaign", str(plan)]) == 0
    assert run(["new", str(tmp_path / "cell"), "--robot", toml, "--campaign", str(plan)]) == 0
    assert run(["next", str(tmp_path / "cell"), "--json"]) == 0
    assert '"P001"' in capsys.readouterr().out
