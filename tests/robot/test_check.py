"""`planner check`: what is wrong in a robot's description is found, and what is right is not."""

import json
import re
import shutil
from pathlib import Path

import pytest

from planner.campaign.store import EXAMPLE
from tests.support.outside import call, said

ROBOT, URDF, PLAN = "robot/robot.toml", "robot/robot.urdf", "campaign.toml"
INERTIAL = r"<inertial>.*?</inertial>"

# Where, what is replaced (a regular expression), by what, and what the check says of it.
WRONG = {
    "no inertia": (URDF, INERTIAL, "", "error", "no mass"),
    "no inertia on the spindle": (
        URDF, r'(<link name="spindle">\s*)' + INERTIAL, r"\1", "warning", "weightless",
    ),
    "moments in kg mm²": (URDF, r'ixx="4.25" iyy="4.292" izz="0.442"',
                          'ixx="442000" iyy="4250000" izz="4292000"', "warning", "far outside"),
    "moments too small": (URDF, r'ixx="4.25" iyy="4.292" izz="0.442"',
                          'ixx="4.4e-7" iyy="4.2e-6" izz="4.2e-6"', "warning", "at the middle"),
    "impossible moments": (URDF, r'ixx="4.25" iyy="4.292" izz="0.442"',
                           'ixx="0.1" iyy="1" izz="5"', "warning", "No body has"),
    "mass in g": (URDF, r'<mass value="24"/>', '<mass value="24000"/>', "warning", "24000|2.4e"),
    "com far outside": (URDF, r'xyz="0 0.02 0.36"', 'xyz="0 0.02 3.6"', "warning", "outside"),
    "lengths in mm": (URDF, r'0.75"/>\s*<axis', '750"/> <axis', "error", "millimetres"),
    "limits in degrees": (URDF, r'lower="-3.1416" upper="3.1416"', 'lower="-360" upper="360"',
                          "warning", "rad"),
    "speeds in degrees": (URDF, r'velocity="1.920"', 'velocity="110"', "warning", "turns a second"),
    "no collision geometry": (URDF, r"<collision><origin.*?</collision>", "", "warning",
                              "collision"),
    "a link without shape": (URDF, r'<collision><origin xyz="0.2 0 0" rpy=.*?</collision>', "",
                             "warning", "joint_4 turns has no collision shape"),
    "sensor askew": (URDF, r'xyz="0.26 0 0.065" rpy="0 1.570796 0"',
                     'xyz="0.26 0 0.065" rpy="0 0 0"', "warning", "turned by 90"),
    "sensor on another link": (ROBOT, r'sensor_frame = "sensor"', 'sensor_frame = "link_3"',
                               "warning", "different joints"),
    "gravity up": (ROBOT, r"-9.81\]", "9.81]", "warning", "ceiling"),
    "gravity in g": (ROBOT, r"-9.81\]", "-1.0]", "warning", "Gravity is 1"),
    "stiffness 40": (ROBOT, r"stiffness = 9.0e5", "stiffness = 40.0", "warning", "hardly any"),
    "stiffness in N·m/degree": (ROBOT, r"stiffness = 1.2e6", "stiffness = 1.2e4", "warning",
                                "weight"),
    "stiffness in N·mm/rad": (ROBOT, r"stiffness = 1.2e5", "stiffness = 1.2e11", "warning",
                              "rigid"),
    "buckling": (ROBOT, r"stiffness = 1.2e6", "stiffness = 500.0", "error", "falls over"),
    "no damping": (ROBOT, r"damping = 270.0", "damping = 0.0", "warning", "no damping"),
    "too much damping": (ROBOT, r"damping = 270.0", "damping = 2e6", "warning", "damping ratio"),
    "band above": (ROBOT, r"band_hz = .*", "band_hz = [900, 1000]", "warning", "No simulated mode"),
    "band cuts mode 1": (ROBOT, r"band_hz = .*", "band_hz = [11, 80]", "warning", "Mode 1"),
    "workspace in rad": (PLAN, r"joints_deg = .*",
                         "joints_deg = [[-0.7, 0.7], [-0.3, 0.7], [-1, 0.2], [0, 0], [0.3, 1], "
                         "[0, 0]]", "error", "radians"),
    "workspace in mm": (PLAN, r"joints_deg = .*", "position_m = [[800, 1400], [0, 0], [600, 900]]"
                        "\ntool_axis = [0, 0, -1]", "error", "reach"),
    "too many modes": (PLAN, r"count = 4", "count = 6", "warning", "6 modes"),
}  # fmt: skip

# What crashed later or left a broken folder; `new` refuses it in a sentence with these words.
REFUSED = {
    "stiffness 1e20": (ROBOT, r"stiffness = 9.0e5", "stiffness = 1e20", "stiffness"),
    "stiffness nan": (ROBOT, r"stiffness = 9.0e5", "stiffness = nan", "finite"),
    "mass 1e308": (URDF, r'<mass value="24"/>', '<mass value="1e308"/>', "mass"),
    "com of 1e9 m": (URDF, r'xyz="0.26 0 0"', 'xyz="1e9 0 0"', "centre of mass"),
    "joint 1e300 m away": (URDF, r'0.75"/>\s*<axis', '1e300"/> <axis', "joint_3"),
    "buckling": (*WRONG["buckling"][:3], "falls over"),
    "nan target": (PLAN, r"frequency_sd_percent = 1.0", "frequency_sd_percent = nan", "finite"),
    "forbidden nan": (PLAN, r"\[cost\]", "[[forbidden]]\nposition_m = [[nan, 1], [0, 1], [0, 1]]\n"
                      "[cost]", "finite"),
    "goal of five angles": (PLAN, r"\[cost\]", "[goal]\njoints_deg = [[1, 2, 3, 4, 5]]\n[cost]",
                            "5 joint angles"),
    "forbidden of two joints": (PLAN, r"\[cost\]", "[[forbidden]]\njoints_deg = [[0, 1], [0, 1]]\n"
                                "[cost]", "2 ranges"),
    "out of reach": (PLAN, r"joints_deg = .*", "position_m = [[5, 6], [0, 0], [1, 2]]\n"
                     "tool_axis = [0, 0, -1]", "reach"),
}  # fmt: skip


def changed(folder: Path, file: str, pattern: str, text: str) -> Path:
    """The example with one passage replaced; returns its robot.toml."""
    shutil.copytree(EXAMPLE, folder)
    path = folder / file
    before = path.read_text()
    after = re.sub(pattern, text, before, count=0 if "collision" in pattern else 1, flags=re.S
                   if pattern.startswith("<") or INERTIAL in pattern else 0)  # fmt: skip
    assert after != before
    path.write_text(after)
    return folder / ROBOT


def checked(robot: Path, *options: object) -> tuple[int, dict, str]:
    """Exit code, answer, and what stands on stderr."""
    code, out, err = call("check", robot, *options, "--json")
    return code, json.loads(out), err


def test_nothing_is_wrong_with_the_example(tmp_path):
    options = "--campaign", EXAMPLE / PLAN, "--plot", tmp_path / "pictures"
    code, answer, err = checked(EXAMPLE / ROBOT, *options)
    assert (code, err, answer["ok"]) == (0, "", True)
    assert {f["severity"] for f in answer["findings"]} <= {"note"}
    assert answer["moving_mass_kg"] == pytest.approx(255)
    masses = {link["link"]: link["mass_kg"] for link in answer["links"]}
    assert (masses["spindle"], masses["tcp"]) == (14, 0)
    (picture,) = answer["plots"]
    assert Path(picture).stat().st_size > 20_000
    home = answer["poses"][0]
    assert home["pose"] == "home"
    assert 5 < home["frequency_hz"][0] < 15
    assert len(answer["poses"]) > 3
    assert (answer["joints"][1]["lower_deg"], answer["joints"][1]["upper_deg"]) == (
        pytest.approx(-70, abs=0.01), pytest.approx(90, abs=0.01),
    )  # fmt: skip
    screen = " ".join(re.sub("[│┃]", " ", said("check", EXAMPLE / ROBOT)).split())
    assert "home: 0°, 0°" in screen
    assert "Nothing looks wrong" in screen
    assert "…" not in screen


@pytest.mark.parametrize("robot", sorted(Path("campaigns").glob("*/robot/robot*.toml")), ids=str)
def test_published_robots_are_not_suspected(robot):
    code, answer, _ = checked(robot)
    assert code == 0
    assert [f for f in answer["findings"] if f["severity"] != "note"] == []


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_found(name, tmp_path):
    file, pattern, text, severity, words = WRONG[name]
    robot = changed(tmp_path / "own", file, pattern, text)
    options = ("--campaign", tmp_path / "own" / PLAN) if file == PLAN else ()
    code, answer, err = checked(robot, *options)
    found = [f for f in answer["findings"] if f["severity"] == severity]
    assert any(re.search(words, f["what"]) for f in found), answer["findings"]
    assert all(f["where"] and f["what"].endswith((".", ":")) for f in found)
    refused = severity == "error"
    assert (code, answer["ok"]) == ((2, False) if refused else (0, True))
    assert bool(err) == refused


def test_the_cause_is_told_first_and_each_error_once(tmp_path):
    """Lengths in mm let springs look soft too; limits in degrees are none with a workspace."""
    file, pattern, text, *_ = WRONG["lengths in mm"]
    robot = changed(tmp_path / "long", file, pattern, text)
    code, out, err = call("check", robot)
    both = " ".join((out + err).split())
    assert code == 2
    assert both.count("as if lengths were in millimetres") == 1
    assert both.index("error:") < both.index("warning:")
    file, pattern, text, *_ = WRONG["limits in degrees"]
    robot = changed(tmp_path / "wide", file, pattern, text)
    said("check", robot)
    code, out, _ = call("check", robot, "--campaign", tmp_path / "wide" / PLAN)
    assert (code, "error: robot.urdf, joint" in out) == (2, True)


@pytest.mark.parametrize("name", REFUSED)
def test_what_would_crash_later_is_refused_and_leaves_nothing(name, tmp_path):
    file, pattern, text, words = REFUSED[name]
    robot = changed(tmp_path / "own", file, pattern, text)
    cell, plan = tmp_path / "cell", robot.parents[1] / PLAN
    code, _, err = call("new", cell, "--robot", robot, "--campaign", plan)
    assert code == 2
    assert re.search(words, err)
    assert err.count("\n") == 1
    assert ".part" not in err  # names the user's file, not a copy that is gone
    assert [p.name for p in tmp_path.iterdir()] == ["own"]


def test_a_change_by_hand_that_cannot_be_is_refused_and_not_believed(tmp_path):
    shutil.copytree(EXAMPLE, tmp_path / "own")
    cell = tmp_path / "cell"
    own = tmp_path / "own"
    said("new", cell, "--robot", own / ROBOT, "--campaign", own / PLAN)
    log = (cell / "log.jsonl").read_bytes()
    toml = cell / ROBOT
    toml.write_text(toml.read_text().replace("1.2e6", "500.0"))
    code, _, err = call("next", cell)
    assert (code, "falls over" in err) == (2, True)
    assert (cell / "log.jsonl").read_bytes() == log
