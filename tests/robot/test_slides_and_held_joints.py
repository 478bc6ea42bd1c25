"""Joints that are held, by robot.toml; joints that slide: in mm, and as another engine has them."""

import re
from pathlib import Path

import numpy as np
import pytest

from planner.cli.run import run
from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.proof.load import load_truth
from planner.recording.folder import read_poses
from planner.recording.joints import JointUnits
from planner.robot.collision import Collisions
from planner.robot.inverse_kinematics import solve
from planner.robot.robot import Robot
from tests.support.rails import GANTRY, GANTRY_BOX, RAIL_ARM, RAIL_BOX, make_sliding
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


TIP = (0, 0.03, -0.25)
KINDS = {"rail": (RAIL_ARM, RAIL_BOX, (0.4, 0.04, 0.05)), "gantry": (GANTRY, GANTRY_BOX, TIP)}
LINES = np.linspace(3.0, 60.0, 40)


def some_poses(robot, box, n=3):
    rng = np.random.default_rng(5)
    return robot.joints.internal([[rng.uniform(*ends) for ends in box] for _ in range(n)])


def test_stated_numbers_are_millimetres_of_slides_and_degrees_of_the_others():
    joints = JointUnits(("rail", "turn"), (True, False))
    q = joints.internal([[1200.0, 90.0], [-5.0, 180.0]])
    assert q == pytest.approx(np.array([[1.2, np.pi / 2], [-0.005, np.pi]]))
    assert joints.shown(q) == pytest.approx(np.array([[1200.0, 90.0], [-5.0, 180.0]]))
    assert joints.columns == ("rail_mm", "turn_deg")
    assert joints.declared == ("mm", "deg")
    assert joints.listed((1200.0, 90.0)) == "1200.0 mm, 90.0°"
    assert joints.apart((1200.0, 90.0), (1204.0, 90.4)) == ""
    assert joints.apart((1200.0, 90.0), (1206.0, 90.4)) == "6.00 mm"
    assert JointUnits.of(("turn",)).listed((10.0,)) == "10.0°"


@pytest.mark.parametrize("kind", KINDS)
def test_simulation_agrees_with_an_independent_engine(kind, tmp_path):
    axes, box, tip = KINDS[kind]
    toml = make_sliding(tmp_path, axes, tip)
    robot, truth = Robot.load(toml), load_truth(toml)
    q = some_poses(robot, box)
    simulation = Simulation(robot)
    modes, frfs = simulation.frequencies(q, len(axes)), simulation.accelerance(q, LINES)
    for i, one in enumerate(q):
        hertz, damping, _ = truth.modes(one, len(axes))
        assert modes.frequency_hz[i] == pytest.approx(hertz, rel=1e-9)
        assert modes.damping_ratio[i] == pytest.approx(damping, rel=1e-6)
        real = truth.accelerance(one, LINES)
        assert np.max(np.abs(frfs[i] - real)) < 1e-6 * np.max(np.abs(real))
        assert robot.forward(one)[1] == pytest.approx(truth.position(one), abs=1e-9)


def test_inverse_kinematics_and_limits_speak_of_millimetres(tmp_path):
    axes, box, tip = KINDS["gantry"]
    robot = Robot.load(make_sliding(tmp_path, axes, tip))
    q = some_poses(robot, box, 1)[0]
    rotation, place = robot.forward(q)
    found = solve(robot, rotation, place, collisions=Collisions(robot))
    assert found.q is not None
    assert robot.forward(found.q)[1] == pytest.approx(place, abs=1e-5)
    far = q.copy()
    far[0] = 3.2
    assert Collisions(robot).limits(far) == ("x at 3200.0 mm is above its limit of 3000.0 mm",)


def test_tables_need_millimetres_of_what_slides(tmp_path):
    robot = Robot.load(make_sliding(tmp_path))
    path = tmp_path / "poses.csv"
    path.write_text("pose,rail_mm,turn_deg,lift_deg\nA,1200,30,-10\n")
    (row,) = read_poses(path, robot.joints)
    assert robot.joints.internal(row.joints_deg) == pytest.approx([1.2, *np.deg2rad([30, -10])])
    path.write_text("pose,rail_deg,turn_deg,lift_deg\nA,1200,30,-10\n")
    with pytest.raises(InputError, match="no column rail_mm"):
        read_poses(path, robot.joints)


WRONG = {
    "a rail's spring in N·m/rad": ("_n_m", "", r"rail slides.*stiffness_n_m \(N/m\)"),
    "both units": ("stiffness_n_m", "stiffness = 1.0\nstiffness_n_m", "not both"),
    "one of two": ("damping_n_s_m = ", "loss_factor = 0.1 # ", "damping_n_s_m"),
    "negative": ("stiffness_n_m = ", "stiffness_n_m = -", "above 0 N/m"),
}


@pytest.mark.parametrize("case", WRONG)
def test_springs_of_slides_are_stated_along_them(case, tmp_path):
    old, new, words = WRONG[case]
    toml = make_sliding(tmp_path)
    text = toml.read_text()
    if case.startswith("a rail"):
        text = text.replace("damping_n_s_m", "damping")
    toml.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=words):
        Robot.load(toml)


def test_slides_without_range_and_springs_of_followers_are_refused(tmp_path):
    urdf = make_sliding(tmp_path).with_name("robot.urdf")
    text = urdf.read_text()
    urdf.write_text(re.sub(r"<limit[^>]*/>", "", text, count=1))
    with pytest.raises(InputError, match="rail has no <limit>; add its range in m"):
        Robot.load(tmp_path / "robot.toml")
    urdf.write_text(text.replace("<limit", '<mimic joint="turn"/><limit', 1))
    with pytest.raises(InputError, match=r'"rail" follows another.* name one of turn, lift'):
        Robot.load(tmp_path / "robot.toml")
