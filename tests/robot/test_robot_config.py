"""A wrong robot folder is refused in one sentence that names file, entry and remedy."""

from pathlib import Path

import numpy as np
import pytest

from planner.campaign.cell import Cell
from planner.campaign.config import load_campaign_config
from planner.errors import InputError
from planner.measurement.nuisances import Tolerances
from planner.proof.arms import KR10
from planner.robot.elastic_model import ElasticModel
from planner.robot.robot import Robot
from tests.support.robots import make_arm

LIMIT = '<limit lower="0.5" upper="0.5" velocity="1" effort="0"/>'
NO_RANGE = f"""<robot name="one"><link name="base"/><link name="tool"/><link name="accelerometer"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="tool"/>{LIMIT}</joint>
<joint name="end" type="fixed"><parent link="tool"/><child link="accelerometer"/></joint></robot>"""
SIZES = "size_m = [4, 4, 0.1]"
PAYLOAD = '[[payload]]\nlink = "tool"\nmass = {}\ncom_m = [0, 0, {}]\n'
TIED = """[[compliance]]
joint = "joint_a{}"
axis = [1, 0, 0]
stiffness = {}
damping = 1.0
tie = "all"
"""
LAW = """[[law]]
joint = "{}"
kind = "{}"
{}
"""
BENT = "stiffness_n_m_rad = {}\nangle_rad = {}"
INERTIA = "inertia_kg_m2 = [0.01, 0, 0, 0.01, 0, {}]\n"

# What is wrong: (old text, new text, words that the sentence has to hold).
WRONG_TOML = {
    "not toml": ("name = ", "name = = ", "robot.toml"),
    "no name": ('name = "small arm"', "", "name"),
    "unknown entry": ("gravity", "gravitation", "gravitation"),
    "a text for a number": ("band_hz = [5.0, 110.0]", 'band_hz = "low"', "band_hz"),
    "a band that falls": ("[5.0, 110.0]", "[110.0, 5.0]", "band_hz, rise"),
    "a band from 0": ("[5.0, 110.0]", "[0.0, 110.0]", "band_hz, above 0 Hz"),
    "an endless band": ("[5.0, 110.0]", "[5.0, inf]", "band_hz"),
    "gravity in g": ("-9.81]", "-981.0]", "gravity, m/s²"),
    "gravity is no number": ("-9.81]", "nan]", "gravity"),
    "no stiffness": ("stiffness = 60000.0", "stiffness = 0.0", "number 1, joint_a1, above 0"),
    "negative damping": ("damping = 23.99", "damping = -23.99", "number 2, joint_a2, damping"),
    "no unit axis": ("axis = [0, 0, 1]", "axis = [0, 0, 2]", "length 2, unit vector"),
    "an axis in the plane": ("axis = [0, 0, 1]", "axis = [0, 1]", "axis"),
    "an elastic joint unknown": ('joint = "joint_a3"', 'joint = "elbow"', "elbow, joint_a3"),
    "a huge loss factor": ("damping = 18.0", "damping = 18.0\nloss_factor = 5.0", "below 2"),
    "a flat obstacle": (SIZES, "size_m = [4, 4, 0]", "floor, above 0 m"),
    "a tool unknown": ('tcp_frame = "tool"', 'tcp_frame = "tol"', 'tcp_frame, "tol"'),
    "a sensor unknown": ('"accelerometer"', '"adxl"', 'sensor_frame, "adxl"'),
    "a URDF that is missing": ('"arm.urdf"', '"leg.urdf"', "leg.urdf, does not exist"),
    "a folder for a URDF": ('"arm.urdf"', '"."', "cannot be read"),
}
# Joint, kind and numbers of a law that cannot be, and the words.
WRONG_LAWS = {
    "of no joint": ("elbow", "hardening", BENT.format(1e4, 1e-3), "elbow, joint_a1"),
    "with another's numbers": (
        "joint_a1", "friction", BENT.format(1e4, 1e-3), "friction, angle_rad, coulomb_torque_n_m",
    ),
    "of a joint that slides": (
        "joint_a1", "backlash", "stiffness_n_m = 1.0\nshift_m = 1.0",
        "backlash, shift_m, give stiffness_n_m_rad and angle_rad",
    ),
    "without numbers": ("joint_a1", "softening", "", "neither"),
    "below 0": ("joint_a1", "hardening", BENT.format(-1e4, 1e-3), "above 0"),
    "of no angle": ("joint_a1", "hardening", BENT.format(1e4, "nan"), "angle_rad"),
    "too soft": ("joint_a1", "softening", BENT.format(7e4, 1e-3), "6e+04"),
    "endless": ("joint_a1", "hardening", BENT.format(1e4, 1) + "\nin_spring = inf", "in_spring"),
    "of no kind": ("joint_a1", "rubber", "", "rubber, softening, backlash"),
}  # fmt: skip
# What is wrong in a block that is added: (the block, words that the sentence has to hold).
ADDED = {
    "ties of unequals": (
        TIED.format(1, 2.0e4) + TIED.format(2, 3.0e4),
        'number 8, joint_a2, "all", stiffness, 30000',
    ),
    "a payload without mass": (PAYLOAD.format(0.0, 0.1), "[[payload]], above 0 kg"),
    "a payload in mm": (PAYLOAD.format(2.0, 150.0), "number 1, com_m, below 100 m"),
    "an impossible payload": (
        PAYLOAD.format(2.0, 0.1) + INERTIA.format(-1.0),
        "inertia, no body can have",
    ),
    "a payload on nothing": (
        PAYLOAD.format(2.0, 0.1).replace("tool", "hook"),
        '[[payload]], "hook"',
    ),
    "a pulse of none": ("[hammer]\npulse_ms = 0\n", "pulse_ms"),
}
ADDED |= {
    f"a law {name}": (LAW.format(*law), f"[[law]], {words}")
    for name, (*law, words) in WRONG_LAWS.items()
}
WRONG_TOML |= {
    name: ("[[obstacle]]", f"{block}[[obstacle]]", words) for name, (block, words) in ADDED.items()
}
WRONG_URDF = {
    "cut off": ("</robot>", "", "not a readable URDF"),
    "no robot at the top": (None, "<mujoco/>", "<mujoco>, <robot>"),
    "no turning joint": (None, '<robot name="x"><link name="a"/></robot>', "no joint that moves"),
    "a joint of a table": ('type="revolute"', 'type="planar"', "joint_a1, planar"),
    "an axis in words": ('<axis xyz="0 1 0"/>', '<axis xyz="up"/>', 'joint_a2, "up"'),
    "an axis of two numbers": ('<axis xyz="0 1 0"/>', '<axis xyz="0 1"/>', "arm.urdf"),
    "limits in words": ('lower="', 'lower="about ', "not a usable URDF"),
    "no range": (None, NO_RANGE, "turn, no range, lower and upper"),
    "no limits": (None, NO_RANGE.replace(LIMIT, ""), "turn, no <limit>"),
}


@pytest.fixture
def arm(tmp_path) -> Path:
    return make_arm(tmp_path)


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        Robot.load(path)
    return str(caught.value)


def is_one_sentence(text: str) -> bool:
    return "\n" not in text and text.endswith(".") and "Traceback" not in text


@pytest.mark.parametrize("case", WRONG_TOML)
def test_wrong_robot_toml(arm, case):
    old, new, words = WRONG_TOML[case]
    text = arm.read_text()
    assert old in text
    arm.write_text(text.replace(old, new, 1))
    said = refusal(arm)
    assert is_one_sentence(said)
    assert str(arm.parent) in said
    assert [w for w in words.split(", ") if w not in said] == []


@pytest.mark.parametrize("case", WRONG_URDF)
def test_wrong_urdf(arm, case, capfd):
    old, new, words = WRONG_URDF[case]
    urdf = arm.with_name("arm.urdf")
    text = urdf.read_text()
    urdf.write_text(new if old is None else text.replace(old, new, 1))
    arm.write_text(arm.read_text().split("[[compliance]]")[0])
    said = refusal(arm)
    assert capfd.readouterr() == ("", "")  # nothing by the reader itself
    assert "\n" not in said.strip()
    assert [w for w in words.split(", ") if w not in said] == []


def test_a_missing_robot_toml(tmp_path):
    said = refusal(tmp_path / "robot.toml")
    assert is_one_sentence(said)
    assert "does not exist" in said


def test_binary_rubbish(arm):
    arm.write_bytes(bytes(range(256)))
    assert "not a valid robot.toml" in refusal(arm)


def test_elastic_joints_are_needed_for_a_simulation_only(arm):
    arm.write_text(arm.read_text().split("[[compliance]]")[0])
    robot = Robot.load(arm)
    with pytest.raises(InputError) as caught:
        ElasticModel(robot)
    assert is_one_sentence(str(caught.value))
    assert "[[compliance]]" in str(caught.value)


MEASUREMENT = {  # of robot.toml or campaign.toml, with what it sets and the words of a wrong one
    "[hits]\nangle_sd_deg = {}": lambda config: np.rad2deg(Tolerances.of(config).angle_rad),
    "[hits]\noffset_sd_mm = {}": lambda config: 1e3 * Tolerances.of(config).offset_m,
    "[sensor]\nposition_sd_mm = {}": lambda config: 1e3 * Tolerances.of(config).position_m,
    "[sensor]\ngain_sd_percent = {}": lambda config: 100 * Tolerances.of(config).gain,
    "[readback]\njoint_sd_deg = {}": lambda config: config.readback.joint_sd_deg,
}


@pytest.mark.parametrize("entry", MEASUREMENT)
def test_what_a_measurement_errs_by_is_stated_and_a_campaign_goes_before_its_robot(tmp_path, entry):
    path, campaign = KR10.write(tmp_path / "robot"), tmp_path / "campaign.toml"
    plain, stated = path.read_text(), MEASUREMENT[entry]
    assert stated(Robot.load(path).config) > 0.01  # what is usual
    path.write_text(f"{plain}\n{entry.format(0.3)}\n")
    assert stated(Robot.load(path).config) == pytest.approx(0.3)
    campaign.write_text(f"{KR10.campaign()}\n{entry.format(0.7)}\n")
    cell = Cell.load(path, load_campaign_config(campaign))
    assert stated(cell.robot.config) == pytest.approx(0.7)
    words = r"\[{}\] {}".format(*entry[1:].replace("]\n", " ").split()[:2])
    for value in ("-1.0", "nan", "1000.0"):
        path.write_text(f"{plain}\n{entry.format(value)}\n")
        with pytest.raises(InputError, match=words):
            Robot.load(path)
        campaign.write_text(f"{KR10.campaign()}\n{entry.format(value)}\n")
        with pytest.raises(InputError, match="campaign.toml: " + words):
            load_campaign_config(campaign)
