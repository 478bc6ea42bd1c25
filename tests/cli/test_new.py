"""`planner new`: from a maker's description, or the example, to the first pose."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from planner.campaign.campaign import Campaign
from planner.robot.robot import Robot
from tests.support.outside import refused, said, told
from tests.support.published import BOXES, DENSITY, HAND, LIMITS, RAIL, published, robot_toml

GIVEN = "--mass-kg", "420", "--payload-kg", "20"


def whole(folder: Path) -> Path:
    return published(folder, inertias=True)


def no_meshes(folder: Path) -> Path:
    urdf = published(folder)
    shutil.rmtree(urdf.parents[1] / "meshes")
    return urdf


def rail(folder: Path) -> Path:
    return published(folder, more=RAIL)


def hand(folder: Path) -> Path:
    return published(folder, more=HAND)


def odd_limits(folder: Path) -> Path:
    """Limits that no three digits of a degree state, and a joint without a range."""
    urdf = published(folder)
    text = urdf.read_text()
    for low, high in LIMITS:
        text = text.replace(f'lower="{low}"', f'lower="{low / 3:.9f}"', 1)
        text = text.replace(f'upper="{high}"', f'upper="{high / 3:.9f}"', 1)
    urdf.write_text(re.sub(r'lower="[^"]+" upper="[^"]+"(?=[^>]*></joint>\n<link name="tool0")',
                           'lower="0.1" upper="0.1"', text))  # fmt: skip
    return urdf


def test_its_robot_toml_says_how_to_move_the_tcp(tmp_path):
    cell = tmp_path / "cell"
    told("new", cell, "--urdf", whole(tmp_path / "src"))
    toml = cell / "robot" / "robot.toml"
    flange, text = Robot.load(toml), toml.read_text()
    said = [line[2:] for line in text.splitlines() if line.startswith("# ")]
    block = "\n".join(said[said.index("[[point]]") :])
    text = text.replace('tcp_frame = "tool0"', 'tcp_frame = "tcp"')
    text = text.replace('sensor_frame = "tool0"', 'sensor_frame = "tcp"')
    toml.write_text(f"{text}\n{block}\n")
    q = np.full(len(flange.joint_names), 0.2)
    moved = Robot.load(toml).forward(q)[1] - flange.forward(q)[1]
    assert np.linalg.norm(moved) == pytest.approx(0.25, abs=1e-3)
    assert told("next", cell)["proposals"]


KINDS = {
    "whole": whole, "no meshes": no_meshes, "rail": rail, "hand": hand, "odd limits": odd_limits,
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_it_goes_from_a_description_to_a_first_pose(kind, tmp_path):
    urdf, cell = kind(tmp_path / "src"), tmp_path / "cell"
    given = () if kind is whole else GIVEN
    new = told("new", cell, "--urdf", urdf, *given, "--tool-mass-kg", 8)
    named = {guess["what"] for guess in new["guessed"]}
    assert {"stiffness of joint_1 about its axis", "workspace joints_deg"} <= named
    assert len(named) == len(new["guessed"])
    assert "tie" not in (cell / "robot" / "robot.toml").read_text()  # no bearing is alike all round
    assert ("mass of link_2" in named) == (kind is not whole)
    assert all({"what", "value", "sd"} <= set(guess) for guess in new["guessed"])
    masses = [g["value"] for g in new["guessed"] if g["what"].startswith("mass of")]
    assert kind is whole or sum(masses) == pytest.approx(420, rel=1e-3)
    shutil.rmtree(tmp_path / "src")  # the campaign holds all it needs
    checked = told("check", cell / "robot" / "robot.toml", "--campaign", cell / "campaign.toml")
    warned = [f["what"] for f in checked["findings"] if f["severity"] != "note"]
    assert len(warned) == (kind is no_meshes), warned
    assert all("left out" in what for what in warned)
    assert {link["guessed"] for link in checked["links"] if link["mass_kg"]} == {kind is not whole}
    (proposal,) = told("next", cell)["proposals"]
    robot = Robot.load(cell / "robot" / "robot.toml")
    q = robot.joints.internal(proposal["joints_deg"])
    assert np.all((robot.lower_rad <= q) & (q <= robot.upper_rad))
    x, _, z = proposal["position_m"]
    assert x > 0.3  # in front
    assert z > 0.0
    assert told("replay", cell)["reproduced"]


def test_it_copies_what_it_needs_and_nothing_else(tmp_path):
    urdf = published(tmp_path)
    (urdf.parent / "notes.pdf").write_text("x")
    told("new", tmp_path / "cell", "--urdf", urdf, *GIVEN)
    files = {p.name for p in (tmp_path / "cell" / "robot").rglob("*") if p.is_file()}
    meshes = {f"link_{i}.stl" for i in range(1, 7)}
    assert files == {"robot.toml", "arm.urdf", "base_link.stl", *meshes}


def test_joints_beside_the_arm_are_held_and_named(tmp_path):
    new = told("new", tmp_path / "cell", "--urdf", hand(tmp_path / "src"), *GIVEN)
    assert len(new["joints"]) == 6
    (text,) = [text for text in new["told"] if "longest chain" in text]
    assert "finger_joint_left" in text
    with_rail = told("new", tmp_path / "two", "--urdf", rail(tmp_path / "rail"), *GIVEN)
    assert with_rail["joint_units"] == ["mm", *["deg"] * 6]


def test_a_spindle_that_the_description_has_is_the_tool(tmp_path):
    urdf, cell = whole(tmp_path / "src"), tmp_path / "cell"
    spindle = (
        '<link name="spindle"><inertial><mass value="9.5"/><inertia ixx="0.1" ixy="0" ixz="0" '
        'iyy="0.1" iyz="0" izz="0.1"/></inertial></link><joint name="mount" type="fixed">'
        '<parent link="tool0"/><child link="spindle"/></joint></robot>'
    )
    urdf.write_text(urdf.read_text().replace("</robot>", spindle))
    assert "and the tool ([[payload]]" not in said("new", cell, "--urdf", urdf)
    checked = " ".join(said("check", cell / "robot" / "robot.toml").split())
    assert "9.5 kg of it the URDF's spindle" in checked


def test_the_screen_says_what_to_put_right_first(tmp_path):
    cell = tmp_path / "cell"
    screen = " ".join(said("new", cell, "--urdf", published(tmp_path), *GIVEN).split())
    assert 'Put right first: tcp_frame = "tool0", where the hammer hits' in screen
    assert "and the tool ([[payload]] there" in screen
    assert "a factor of 3" in screen
    assert "Masses are guessed" in screen
    assert "Masses are guessed" in said("check", cell / "robot" / "robot.toml")
    said("report", cell)
    assert "Masses are guessed" in next(cell.glob("*.html")).read_text()


@pytest.mark.parametrize(
    ("mass", "words"),
    [(1.0, ""), (1.2, "the URDF's masses are used"), (100.0, "--mass-kg is used and shared out")],
)
def test_it_says_whose_masses_are_used_where_urdf_and_data_sheet_differ(mass, words, tmp_path):
    urdf = published(tmp_path, inertias=True)
    stated = sum(DENSITY * float(np.prod(np.subtract(high, low))) for low, high in BOXES)
    new = told("new", tmp_path / "cell", "--urdf", urdf, "--mass-kg", mass * stated)
    found = [text for text in new["told"] if "--mass-kg says" in text]
    assert [words in text for text in found] == [True] * bool(words)


REFUSED = {
    "no mass": (lambda p: ["--urdf", str(published(p))], "--mass-kg"),
    "mass 0": (lambda p: ["--urdf", str(published(p)), "--mass-kg", "0"], "above 0"),
    "tonnes": (lambda p: ["--urdf", str(published(p, inertias=True)), "--mass-kg", "0.2"],
               "kg together; give"),
    "no file": (lambda p: ["--urdf", str(p / "none.urdf"), *GIVEN], "none.urdf cannot be read"),
    "two robots": (lambda p: ["--urdf", "a.urdf", "--robot", "b.toml"], "give one"),
    "mass of a robot.toml": (lambda p: ["--robot", "b.toml", *GIVEN], "go with --urdf"),
}  # fmt: skip


@pytest.mark.parametrize(("arguments", "words"), REFUSED.values(), ids=REFUSED)
def test_what_is_missing_is_asked_for(arguments, words, tmp_path):
    assert words in refused("new", tmp_path / "cell", *arguments(tmp_path))
    assert not (tmp_path / "cell").exists()


def test_a_robot_toml_may_name_a_urdf_elsewhere(tmp_path):
    (tmp_path / "own").mkdir()
    toml = robot_toml(tmp_path / "own" / "robot.toml", whole(tmp_path / "src"))
    told("new", tmp_path / "cell", "--robot", toml)
    shutil.rmtree(tmp_path / "src")
    assert len(told("next", tmp_path / "cell")["proposals"]) == 1


@pytest.mark.parametrize("high", [1.4, 2.61799387799149, 0.123456789])
def test_the_default_workspace_lies_within_the_limits(high, tmp_path):
    urdf = whole(tmp_path / "src")
    urdf.write_text(urdf.read_text().replace('upper="1.4"', f'upper="{high}"'))
    (tmp_path / "own").mkdir()
    toml = robot_toml(tmp_path / "own" / "robot.toml", urdf)
    told("new", tmp_path / "cell", "--robot", toml)
    ranges = Campaign(str(tmp_path / "cell")).cell.config.workspace.joints_deg
    assert ranges is not None
    assert np.rad2deg(high) - 1e-3 <= ranges[2][1] <= np.rad2deg(high) + 1e-9


def test_the_example_goes_from_check_to_a_proposal(tmp_path):
    written = told("new", "--example", tmp_path / "own")
    assert {Path(f).name for f in written["files"]} == {
        "robot.toml", "robot.urdf", "campaign.toml", "ask_tell.py",
        "cut.toml", "tool.toml",
    }  # fmt: skip
    texts = [Path(f).read_text() for f in written["files"]]
    assert all("#" in text or "<!--" in text for text in texts)
    assert told("check", written["robot"])["ok"]
    new = told("new", tmp_path / "cell", "--robot", written["robot"], "--campaign",
              written["campaign"])  # fmt: skip
    assert new["findings"] == []
    (proposal,) = told("next", tmp_path / "cell")["proposals"]
    assert len(proposal["joints_deg"]) == 6


def test_the_example_overwrites_nothing(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    assert "not empty" in refused("new", "--example", tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["mine.txt"]
