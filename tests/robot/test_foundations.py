"""A base that turns about axes above or below its origin, by formulas of one rigid body."""

import numpy as np
import pytest

from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.robot.robot import Robot

MASS, MOMENT, HEIGHT, FOOT, STIFFNESS = 300.0, 20.0, 1.2, 0.7, 4e6
URDF = f"""<robot name="column">
<link name="floor"/>
<link name="column"><inertial><origin xyz="0 0 {HEIGHT}"/><mass value="{MASS}"/>
<inertia ixx="{MOMENT}" iyy="{MOMENT}" izz="{MOMENT}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="turn" type="revolute"><parent link="floor"/><child link="column"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<link name="tool"/><joint name="flange" type="fixed"><origin xyz="0 0 1.5"/>
<parent link="column"/><child link="tool"/></joint>
</robot>"""
STIFF = "stiffness_n_m = 1e13\ndamping_n_s_m = 1.0"
ROCKING = f"stiffness = {STIFFNESS}\ndamping = 100.0\nheight_m = {-FOOT}"
BLOCKS = {
    "turn": "axis = [0, 0, 1]\nstiffness = 1e12\ndamping = 1.0",
    "about x": f"axis = [1, 0, 0]\n{ROCKING}",
    "along x": f"axis = [1, 0, 0]\n{STIFF}",
    "along y": f"axis = [0, 1, 0]\n{STIFF}",
}


def column(folder, **replaced: str) -> Robot:
    """A rigid column that rocks about x at its foot, FOOT below the origin."""
    (folder / "robot.urdf").write_text(URDF)
    blocks = BLOCKS | {name.replace("_", " "): text for name, text in replaced.items()}
    rows = [
        f'[[compliance]]\njoint = "{"turn" if name == "turn" else "base"}"\n{text}\n'
        for name, text in blocks.items() if text
    ]  # fmt: skip
    head = (
        'name = "column"\nurdf = "robot.urdf"\ntcp_frame = "tool"\nsensor_frame = "tool"\n'
        "gravity = [0, 0, 0]\nband_hz = [1.0, 100.0]\n"
    )
    (folder / "robot.toml").write_text(head + "".join(rows))
    return Robot.load(folder / "robot.toml")


def rocking_hz(arm_m: float) -> float:
    return float(np.sqrt(STIFFNESS / (MOMENT + MASS * arm_m**2)) / (2 * np.pi))


@pytest.mark.parametrize("height", [-FOOT, 0.0, 0.3])
def test_what_rocks_turns_about_the_height_that_is_stated(height, tmp_path):
    robot = column(
        tmp_path, about_x=f"axis = [1, 0, 0]\n{ROCKING}".replace(str(-FOOT), str(height))
    )
    [[first, *_]] = Simulation(robot).modes(np.zeros((1, 1)), 1).frequency_hz
    assert first == pytest.approx(rocking_hz(HEIGHT - height), rel=1e-6)


def test_shifts_of_the_base_add_to_its_turning(tmp_path):
    """A force at the tool moves it by the sum of both compliances."""
    along = 5e6
    soft = f"axis = [0, 1, 0]\nstiffness_n_m = {along}\ndamping_n_s_m = 1.0"
    robot = column(tmp_path, along_y=soft)
    elastic = Simulation(robot).elastic
    hit = elastic.matrices(np.zeros((1, 1))).hit[0, 1]  # along y
    assert np.sum(hit**2 / elastic.stiffness) == pytest.approx(
        1 / along + (1.5 + FOOT) ** 2 / STIFFNESS, rel=1e-6
    )


WRONG = {
    "no shift": ({"along_y": ""}, r"number 2 \(base\) has height_m = -0\.7.*stiffness_n_m"),
    "of a joint": ({"turn": BLOCKS["turn"] + "\nheight_m = 0.1"}, 'rotation of joint = "base"'),
    "of a shift": ({"along_x": BLOCKS["along x"] + "\nheight_m = 0.1"}, "of a rotation"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_height_that_nothing_goes_with_is_refused(case, tmp_path):
    replaced, words = WRONG[case]
    with pytest.raises(InputError, match=words):
        Simulation(column(tmp_path, **replaced))
