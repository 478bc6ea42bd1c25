"""`next` with every acquisition, and on a robot that cannot be checked for collision."""

import io
import re
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from planner.campaign.campaign import Campaign
from planner.campaign.events import Proposed
from planner.design.propose import ACQUISITIONS, DESIGNS
from planner.session.screen import no_keys
from planner.session.watch import watch
from tests.support.milling_cases import cut_toml
from tests.support.outside import said, told
from tests.support.plain_arm import make_plain_arm, plain_campaign

UNCHECKED = "Nothing is checked for collision, because plain.urdf has no collision geometry"


@pytest.fixture
def robot(tmp_path) -> Path:
    return make_plain_arm(tmp_path / "robot")


CUT = cut_toml(spindle_rpm=(600, 3000, 3), depth_m=(0.0, 0.001, 4), method="zeroth_order")


def begun(
    folder: Path, robot: Path, acquisition: str = "integrated_variance", more: str = ""
) -> Path:
    toml = plain_campaign(folder / "plan" / "campaign.toml", acquisition)
    toml.write_text(toml.read_text().replace("candidates = 30", "candidates = 10") + more)
    said("new", folder / "cell", "--robot", robot, "--campaign", toml)
    return folder / "cell"


def proposed_again(cell: Path, *options: object) -> list[dict]:
    """Proposals that the next command reads from the log as the first one answered them."""
    first = told("next", cell, "--count", 2, *options)["proposals"]
    assert told("next", cell, "--count", 2, *options)["proposals"] == first
    status = told("status", cell)
    assert [p["pose"] for p in status["open"]] == [p["pose"] for p in first]
    assert status["log"]["torn_bytes"] == 0
    assert [s["check"] for s in told("replay", cell)["steps"]] == ["kept", "identical"]
    return first


@pytest.mark.parametrize("name", [*ACQUISITIONS, *DESIGNS])
def test_every_acquisition_is_logged_so_that_it_reads_back(name, robot, tmp_path):
    more = ""
    if name == "stability":
        (robot.parent / "cut.toml").write_text(CUT)
        more = "[cut]\nspeed_rpm = 1200.0\ndepth_m = 1e-4\njoints_deg = [[0, -40, 50, 0]]\n"
    for proposal in proposed_again(begun(tmp_path, robot, name, more)):
        assert (proposal["score"] is None) == (name in DESIGNS)


def test_an_acquisition_that_is_asked_for_is_that_of_the_file(robot, tmp_path):
    asked = proposed_again(begun(tmp_path / "asked", robot), "--acquisition", "variance")
    assert asked == proposed_again(begun(tmp_path / "stated", robot, "variance"))


def test_a_log_in_which_a_score_became_null_opens(robot, tmp_path):
    """Not a number is null in JSON: earlier versions wrote that and could not read it."""
    cell = begun(tmp_path, robot)
    proposals = told("next", cell, "--acquisition", "sobol")["proposals"]
    log = (cell / "log.jsonl").read_text()
    assert '"score":null' in log
    said("skip", cell, proposals[0]["pose"])
    event = Campaign(cell).entries[1].event
    assert isinstance(event, Proposed)
    assert event.proposals[0].score is None


def test_a_robot_without_collision_geometry_is_told_of_once(robot, tmp_path):
    toml = plain_campaign(tmp_path / "plan" / "campaign.toml")
    text = said("new", tmp_path / "cell", "--robot", robot, "--campaign", toml)
    assert " ".join(text.split()).count(UNCHECKED) == 1
    text = said("next", tmp_path / "cell", "--count", 3)
    assert " ".join(text.split()).count(UNCHECKED) == 1
    (remark,) = told("next", tmp_path / "cell", "--count", 3)["remarks"]
    assert remark.startswith(UNCHECKED)


def test_a_session_tells_of_it_once_at_its_beginning(robot, tmp_path):
    (tmp_path / "inbox").mkdir()
    console = Console(width=100, file=io.StringIO())
    campaign = Campaign(begun(tmp_path, robot))
    watch(campaign, tmp_path / "inbox", console=console, keys=no_keys, limit_s=0.0)
    text = " ".join(console.file.getvalue().split())
    assert text.count(UNCHECKED) == 1
    assert text.index(UNCHECKED) < text.index("P001")


def test_a_robot_with_collision_geometry_is_not_told_of(robot, tmp_path):
    urdf = robot.parent / "plain.urdf"
    shape = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>'
    urdf.write_text(urdf.read_text().replace("</inertial></link>", f"</inertial>{shape}", 1))
    assert told("next", begun(tmp_path, robot))["remarks"] == []


def without_damping(robot: Path) -> None:
    robot.write_text(re.sub(r"damping = .*", "damping = 0.0", robot.read_text()))


def sensor_elsewhere(robot: Path) -> None:
    """On the first link, which hits along some axes do not move at all."""
    robot.write_text(robot.read_text().replace('sensor_frame = "tcp"', 'sensor_frame = "link_1"'))


@pytest.mark.parametrize("change", [without_damping, sensor_elsewhere])
def test_a_pose_is_proposed_for_odd_robots_too(change, robot, tmp_path):
    change(robot)
    plan = plain_campaign(tmp_path / "campaign.toml")
    said("new", tmp_path / "cell", "--robot", robot, "--campaign", plan)
    proposal, *_ = told("next", tmp_path / "cell", "--count", 2)["proposals"]
    assert np.isfinite(proposal["score"])
