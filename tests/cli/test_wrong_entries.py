"""What is wrong in a file is said with file, entry and remedy, and which help to look at."""

from pathlib import Path

import pytest

from tests.support.outside import call, make_cell


@pytest.fixture
def cell(tmp_path) -> tuple[Path, Path]:
    robot, plan, _ = make_cell(tmp_path)
    return robot, plan


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("count = 4", 'count = "four"', '[modes] count must be a whole number, not "four".'),
        ("count = 4", "cuont = 4", '[modes] has no entry "cuont"; "count" may be meant.'),
        ("[modes]", "[mdes]", 'there is no entry "mdes"; "modes" may be meant.'),
        ("[[-40, 40]", '[["a", 40]', "[workspace] joints_deg must be a number, not"),
        ("[[-40, 40]", "[[40, -40]", "joints_deg, range 1 is [40, -40]; give finite numbers"),
        ("[[-40, 40]", "[[-400, 400]", "[workspace] joints_deg of joint_a1"),
        ("band_hz = [5.0, 110.0]", "band_hz = [40.0, 8.0]", "[modes] band_hz is [40, 8]"),
        ("integrated_variance", "ei", "[acquisition] name: there is no acquisition"),
    ],
)
def test_an_entry_of_campaign_toml(cell, tmp_path, old, new, words):
    robot, plan = cell
    text = plan.read_text()
    assert old in text, text
    plan.write_text(text.replace(old, new))
    code, _, err = call("new", tmp_path / "cell", "--robot", robot, "--campaign", plan)
    assert (code, err.count("\n")) == (2, 1)
    assert "campaign.toml" in err
    assert words in err


def test_an_entry_of_a_list_of_tables(cell):
    robot, _ = cell
    text = robot.read_text()
    robot.write_text(text.replace("stiffness = 60000.0", 'stiffness = "high"'))
    assert "[[compliance]] stiffness must be a number, not" in call("check", robot)[2]
    robot.write_text(text.replace('urdf = "arm.urdf"\n', ""))
    assert "urdf is missing; add it." in call("check", robot)[2]
    robot.write_text(text.replace('urdf = "arm.urdf"', 'urdf = "a\\u0000.urdf"'))
    assert "correct the entry urdf" in call("check", robot)[2]
    robot.write_text(text.replace("damping = ", "dampening = ", 1))
    assert (
        '[[compliance]] has no entry "dampening"; "damping" may be meant.'
        in call("check", robot)[2]
    )


def test_a_folder_instead_of_its_robot(cell, tmp_path):
    robot, _ = cell
    for folder in (robot.parent, robot.parent.parent):
        code, _, err = call("check", folder)
        assert (code, f"is a folder; name {robot}." in err) == (2, True), err
    assert "name a robot.toml in it" in call("check", tmp_path / "plan")[2]


@pytest.mark.parametrize("command", ["new", "import", "check"])
def test_a_missing_argument_points_to_the_commands_own_help(command):
    code, _, err = call(command)
    assert (code, f"see planner {command} --help." in err) == (2, True), err
