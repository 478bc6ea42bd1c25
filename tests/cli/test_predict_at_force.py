"""Predictions at a stated force: of a robot alone, of a campaign, and of a cut."""

from pathlib import Path

import numpy as np
import pytest

from tests.support.milling_cases import cut_toml
from tests.support.outside import make_cell, refused, said, told
from tests.support.robots import JOINTS_DEG

LAW = """
[[law]]
joint = "joint_a2"
kind = "hardening"
stiffness_n_m_rad = 4e4
angle_rad = 2e-4
"""
CUT = cut_toml(spindle_rpm=(5000, 6000, 2), depth_m=(0.0, 0.05, 100), method="zeroth_order")
MIDDLE = ",".join(str(np.mean(pair)) for pair in JOINTS_DEG)


@pytest.fixture
def cell(tmp_path: Path) -> tuple[Path, Path, Path]:
    """robot.toml with a law, a campaign with it, and poses at 2 N, 2000 N and without force."""
    robot, campaign_toml, _ = make_cell(tmp_path)
    robot.write_text(robot.read_text() + LAW)
    told("new", tmp_path / "cell", "--robot", robot, "--campaign", campaign_toml)
    poses = tmp_path / "predict.csv"
    names = ",".join(f"joint_a{i}_deg" for i in range(1, 7))
    rows = [f"{name},{MIDDLE},{force}" for name, force in (("A", 2), ("B", 2000), ("C", ""))]
    poses.write_text("\n".join([f"pose,{names},peak_force_n", *rows]) + "\n")
    return robot, tmp_path / "cell", poses


def test_robot_and_campaign_answer_at_the_force(cell, tmp_path):
    robot, campaign, poses = cell
    alone = told("predict", robot, poses, "--out", tmp_path / "r.npz")
    asked = told("predict", campaign, poses)
    for answer in (alone, asked):
        assert [p.get("peak_force_n") for p in answer["poses"]] == [2, 2000, None]
        first = [p["modes"][0]["frequency_hz"] for p in answer["poses"]]
        assert first[0] == pytest.approx(first[2], rel=0.01)  # swings too small for the law
        assert first[1] > 1.01 * first[0]
        with np.load(answer["npz"]) as held:
            soft, hard, stated = held["frf_mean"]
        assert np.linalg.norm(hard - stated) > 5 * np.linalg.norm(soft - stated) > 0
    assert alone["poses"][0]["modes"][0]["sd_hz"] is None
    forced = told("predict", robot, poses, "--peak-force-n", 2000, "--out", tmp_path / "f.npz")
    assert forced["poses"][2]["modes"] == forced["poses"][1]["modes"]
    assert "joint_a2 is not linear" in " ".join(said("check", robot).split())


def test_a_cut_is_asked_at_a_force(cell, tmp_path):
    _, campaign, poses = cell
    cut, path = tmp_path / "cut.toml", tmp_path / "path.csv"
    cut.write_text(CUT)
    head, *_, last = poses.read_text().splitlines()  # of the pose without a force
    path.write_text(f"{head}\n{last}\n")

    def chatter(*force: object) -> list[float]:
        asked = "--cut", cut, "--path", path, "--samples", 20, *force
        return told("stability", campaign, *asked)["depth_limit_m"]

    assert chatter() != chatter("--peak-force-n", 2000)


def test_what_makes_no_sense_is_refused(cell, tmp_path):
    robot, campaign, poses = cell
    cut, bad = tmp_path / "cut.toml", tmp_path / "bad.csv"
    cut.write_text(CUT)
    bad.write_text(poses.read_text().replace(",2\n", ",-2\n"))
    told("predict", robot, poses, "--out", tmp_path / "r.npz")
    robot.write_text(robot.read_text().replace(LAW, ""))
    plain = told("predict", robot, poses, "--out", tmp_path / "p.npz")
    assert "changes nothing" in plain["remarks"][0]
    for words, command in (
        ("row 2: peak_force_n is -2", ("predict", campaign, bad)),
        ("goes with a campaign", ("stability", tmp_path / "r.npz", "--cut", cut, "--pose", "A",
                                  "--peak-force-n", 10)),
    ):  # fmt: skip
        assert words in refused(*command)
