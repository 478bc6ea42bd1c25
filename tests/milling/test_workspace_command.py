"""`planner stability` of a campaign: over its workspace, along a program, with another tool.

`pytest -m slow tests/milling/test_workspace_command.py` turns along a program with another tool.
"""

import shutil

import numpy as np
import pytest

from planner.campaign.campaign import Campaign
from planner.campaign.cut_source import tip_at, tip_frfs
from planner.milling.cutter_frf import CutterFrf
from planner.milling.tip_files import completed
from planner.proof.arms import KR10
from planner.proof.load import load_truth
from tests.support import outside
from tests.support.direct_solution import direct_accelerance
from tests.support.milling_cases import cut_toml
from tests.support.rerun_columns import lines_of

CUT = {
    "diameter_m": 0.016, "milling": "down", "radial_immersion": 0.5, "kt_n_m2": 8e8,
    "kr_n_m2": 2.5e8, "feed": (0.0, 1.0, 0.0), "feed_in": "base", "axis": (0.0, 0.0, -1.0),
    "spindle_rpm": (5000, 8000, 2), "depth_m": (0.0, 0.02, 100), "method": "zeroth_order",
}  # fmt: skip
PROGRAM = "G21 G90 G0 X0 Y0 Z5\nG1 Z-1\nX80\nG3 X120 Y40 J40\n"
TOOL = """
name = "long mill"
to_spindle = [0.0, 0.0, -1.0]
[material.carbide]
youngs_modulus_pa = 5.4e11
density_kg_m3 = 14500.0
poisson_ratio = 0.25
[[segment]]
material = "carbide"
length_m = 0.12
diameter_m = 0.02
"""


WAY = "--path", "PART", "--origin", "0.6,-0.1,0.4", "--poses", 2


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    return made(tmp_path_factory.mktemp("cell"), "[5.0, 80.0]")


def made(root, band):
    """A campaign in which nothing is measured yet: its simulation predicts."""
    robot = KR10.write(root / "robot", 2)
    campaign = KR10.campaign(str(robot)).replace("[5.0, 150.0]", band)
    (root / "campaign.toml").write_text(campaign + "candidates = 20\n")
    for name, text in (("cut.toml", cut_toml(**CUT)), ("part.nc", PROGRAM), ("tool.toml", TOOL)):
        (root / name).write_text(text)
    outside.said("new", root / "cell", "--robot", robot, "--campaign", root / "campaign.toml")
    return root


def command(cell, *more):
    more = (cell / "part.nc" if one == "PART" else one for one in more)
    return "stability", cell / "cell", "--cut", cell / "cut.toml", "--samples", 20, *more


def asked(cell, *more):
    return outside.told(*command(cell, *more))


def refusal(cell, *more):
    return outside.refused(*command(cell, *more), "--json")


def test_map_of_the_workspace(cell, tmp_path):
    files = ("--plot", tmp_path, "--rrd", tmp_path / "map.rrd")
    said = asked(cell, "--map", "--poses", 4, "--point", "6000,0.0002", *files)
    assert said["spindle_rpm"] == 6000
    assert not any("beyond the tip" in text for text in said["remarks"])
    found, robust = (np.array(said[n], float) for n in ("depth_limit_m", "depth_limit_m_at_95"))
    assert found.shape == (4,)
    assert np.all(robust <= found * 1.05)
    assert said["tightest_pose"] == said["poses"][int(np.argmin(robust))]
    assert said["wanted_share"] == np.mean(robust > 2e-4)
    assert np.array(said["position_m"]).shape == (4, 3)
    assert (tmp_path / "stability_map.png").stat().st_size > 10_000
    assert (tmp_path / "map.rrd").stat().st_size > 10_000


def test_poses_that_chatter_outside_the_band_are_left_out_of_the_map(tmp_path):
    said = asked(made(tmp_path, "[5.0, 13.0]"), "--map", "--poses", 4)
    assert said["left_out"] == ["W001"]
    assert said["poses"] == ["W002", "W003", "W004"]
    assert np.array(said["position_m"]).shape == (3, 3)
    (why,) = said["remarks"]
    assert why.startswith("W001 is left out: the cut would chatter there outside the 5 to 13 Hz")
    narrow = made(tmp_path / "narrow", "[5.0, 6.0]")
    assert "chatter" in refusal(narrow, "--map", "--poses", 2)


def test_frfs_are_carried_from_the_sensor_to_the_tip(cell):
    """By as much as the other engine has both apart."""
    campaign, lines = Campaign(cell / "cell"), np.array([12.0, 25.0, 60.0])
    config = campaign.cell.robot.config
    assert config.sensor_frame != config.tcp_frame
    q = campaign.cell.poses([[10.0, -70.0, 95.0, 20.0, 40.0, -30.0]])
    truth = load_truth(cell / "robot" / "robot.toml")
    *matrices, hit, sensor = truth.matrices(q[0])
    apart = direct_accelerance(*matrices, hit, hit - sensor, lines)
    found, sd = tip_frfs(campaign, q, lines)
    np.testing.assert_allclose(found[0] - campaign.frf_at(q, lines)[0][0], apart, rtol=1e-6)
    assert np.all(sd > 0)


def test_a_tool_is_coupled_to_what_the_sensor_shows(cell):
    """Carried to the tip once: of the simulation's own FRFs exactly."""
    campaign, lines = Campaign(cell / "cell"), np.array([12.0, 25.0, 60.0])
    simulation, s2 = campaign.model.low.simulation, (2j * np.pi * lines) ** 2
    q = campaign.cell.poses([[10.0, -70.0, 95.0, 20.0, 40.0, -30.0]])
    shown = simulation.accelerance(q, lines)[0] / s2
    tip = completed(CutterFrf("", lines, shown, 0 * np.abs(shown)), simulation, q[0])
    there = simulation.frfs(q, lines, sensors=("tcp",), quantity="receptance")[0, 0, :, 0]
    found = np.moveaxis(tip.receptance[:, :3, :3], 0, -1)
    np.testing.assert_allclose(found, there, atol=1e-9 * np.abs(there).max())
    measured = np.moveaxis(tip_at(campaign, "P", q[0], lines).measured, 0, -1)
    np.testing.assert_allclose(measured, campaign.frf_at(q, lines)[0][0] / s2)


def test_frfs_of_a_sensor_beside_the_tip_are_said_to_be_that(cell, tmp_path):
    q = Campaign(cell / "cell").cell.robot.joints.columns
    (tmp_path / "p.csv").write_text(",".join(["pose", *q]) + "\nA,10,-70,95,20,40,-30\n")
    cut, npz = tmp_path / "cut.toml", tmp_path / "p.npz"
    outside.said("predict", cell / "cell", tmp_path / "p.csv", "--out", npz)
    cut.write_text(cut_toml(**CUT | {"feed_in": "frf"}))
    answer = outside.told("stability", npz, "--cut", cut, "--samples", 20)
    assert any("not at the tcp" in text for text in answer["remarks"])


def test_tip_and_sensor_may_be_points_of_robot_toml(cell, tmp_path):
    campaign, lines = Campaign(cell / "cell"), np.array([12.0, 25.0, 60.0])
    config = campaign.cell.robot.config
    shutil.copytree(cell / "robot", tmp_path / "robot")
    text = (tmp_path / "robot" / "robot.toml").read_text()
    for name in ("tcp", "sensor"):
        link = getattr(config, f"{name}_frame")
        text = text.replace(f'{name}_frame = "{link}"', f'{name}_frame = "{name}_there"')
        text += f'[[point]]\nname = "{name}_there"\nlink = "{link}"\n'
    (tmp_path / "robot" / "robot.toml").write_text(text)
    other = Campaign.new(
        tmp_path / "cell", tmp_path / "robot" / "robot.toml", cell / "campaign.toml"
    )
    assert other.cell.robot.config.tcp_frame == "tcp_there"
    q = campaign.cell.poses([[10.0, -70.0, 95.0, 20.0, 40.0, -30.0]])
    for found, known in zip(tip_frfs(other, q, lines), tip_frfs(campaign, q, lines), strict=True):
        np.testing.assert_allclose(found, known, rtol=1e-9)


def test_a_spindle_beyond_the_tip_is_remarked_upon(cell, tmp_path):
    (tmp_path / "cut.toml").write_text(cut_toml(**CUT | {"axis": (0.0, 0.0, 1.0)}))
    said = asked(cell, "--cut", tmp_path / "cut.toml", "--map", "--poses", 2)
    assert any("beyond the tip" in text for text in said["remarks"])


@pytest.mark.slow
def test_a_program_with_turns_and_another_tool(cell, tmp_path):
    said = asked(cell, *WAY, "--turns", "--plot", tmp_path, "--rrd", tmp_path / "path.rrd")
    assert "/figures/path/0/whole_path__95___probability" in lines_of(tmp_path / "path.rrd")
    turn = said["turn"]
    depth = np.array(turn["depth_m"], float)
    assert depth.shape == (2, 12)
    assert turn["reached"][0][0] is True
    assert depth[:, 0].min() == pytest.approx(_at(said, said["best_spindle_rpm"]), rel=1e-6)
    for row, best in zip(depth, turn["best_deg"], strict=True):
        assert turn["turn_deg"][int(np.nanargmax(row))] == best
    assert (tmp_path / "turns.png").exists()
    assert said["feed"]["direction_base"] is not None
    longer = asked(cell, *WAY, "--tool", cell / "tool.toml")
    assert longer["depth_limit_m"] != said["depth_limit_m"]
    assert {len(one["poses"]) for one in (longer, said)} == {2}


def _at(said, rpm):
    return said["depth_limit_m"][said["spindle_rpm"].index(rpm)]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--path", "PART"), "--origin"),
        (("--path", "PART", "--origin", "a,b"), "--origin"),
        (("--path", "PART", "--origin", "60,0,0"), "cannot be reached"),
        (("--path", "PART", "--origin", "0.6,0,0.4", "--pose", "all"), "leave --pose out"),
        (("--turns",), "name the path"),
        (("--map", "--pose", "P001"), "--map"),
        (("--pose", "all"), "--path"),
        (("--pose", "P9"), "has no pose"),
        (("--noise", "2", "--map"), "go with --tool"),
    ],
)
def test_what_cannot_be_is_said_in_a_sentence(cell, more, words):
    assert words in refusal(cell, *more)


def test_a_tool_that_points_the_other_way_is_refused(cell, tmp_path):
    tool = tmp_path / "tool.toml"
    tool.write_text(TOOL.replace("-1.0]", "1.0]"))
    assert "to_spindle" not in refusal(cell, *WAY, "--tool", tool).split(";")[-1]
