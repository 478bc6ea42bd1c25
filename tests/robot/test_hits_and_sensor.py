"""[hits], [sensor], [readback]: what robot.toml and campaign.toml say of the measurement."""

import numpy as np
import pytest

from planner.campaign.cell import Cell
from planner.campaign.config import load_campaign_config
from planner.errors import InputError
from planner.measurement.nuisances import Tolerances
from planner.proof.arms import KR10
from planner.robot.robot import Robot


def test_a_steady_hand_and_a_good_sensor_are_stated_in_robot_toml(tmp_path):
    path = KR10.write(tmp_path)
    usual = Tolerances.of(Robot.load(path).config)
    assert usual.angle_rad == pytest.approx(np.deg2rad(2.0))
    assert usual.offset_m == pytest.approx(5e-3)
    path.write_text(
        path.read_text() + "\n[hits]\nangle_sd_deg = 0.5\n[sensor]\nposition_sd_mm = 2\n"
    )
    stated = Tolerances.of(Robot.load(path).config)
    assert stated.angle_rad == pytest.approx(np.deg2rad(0.5))
    assert stated.offset_m == usual.offset_m
    assert stated.position_m == pytest.approx(2e-3)


@pytest.mark.parametrize("value", ["-1.0", "nan", "1000.0"])
def test_what_no_sd_can_be_is_refused_by_name(tmp_path, value):
    path = KR10.write(tmp_path)
    path.write_text(path.read_text() + f"\n[hits]\noffset_sd_mm = {value}\n")
    with pytest.raises(InputError, match=r"\[hits\] offset_sd_mm"):
        Robot.load(path)


def test_a_campaign_goes_before_its_robot(tmp_path):
    path = KR10.write(tmp_path / "robot")
    campaign = tmp_path / "campaign.toml"
    campaign.write_text(KR10.campaign() + "\n[hits]\nangle_sd_deg = 1.0\n")
    cell = Cell.load(path, load_campaign_config(campaign))
    assert Tolerances.of(cell.robot.config).angle_rad == pytest.approx(np.deg2rad(1.0))
    campaign.write_text(KR10.campaign() + "\n[sensor]\ngain_sd_percent = -2\n")
    with pytest.raises(InputError, match=r"campaign.toml: \[sensor\] gain_sd_percent"):
        load_campaign_config(campaign)


def test_the_readback_is_stated_in_robot_toml_or_in_campaign_toml(tmp_path):
    path = KR10.write(tmp_path / "robot")
    assert Robot.load(path).config.readback.joint_sd_deg == 0.05
    path.write_text(path.read_text() + "\n[readback]\njoint_sd_deg = 0.2\n")
    assert Robot.load(path).config.readback.joint_sd_deg == 0.2
    campaign = tmp_path / "campaign.toml"
    campaign.write_text(KR10.campaign() + "\n[readback]\njoint_sd_deg = 0.01\n")
    cell = Cell.load(path, load_campaign_config(campaign))
    assert cell.robot.config.readback.joint_sd_deg == 0.01
    campaign.write_text(KR10.campaign() + "\n[readback]\njoint_sd_deg = -0.01\n")
    with pytest.raises(InputError, match=r"campaign.toml: \[readback\] joint_sd_deg"):
        load_campaign_config(campaign)
