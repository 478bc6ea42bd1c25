"""Analysers that export FRFs: one UFF per hit direction, imported like time histories."""

import csv

import numpy as np
import pyuff

from planner.campaign.campaign import Campaign
from tests.support.outside import make_cell

LINES = np.arange(4.0, 130.0, 0.25)


def write_frfs(path, truth, q, hit):
    """Three accelerances of one hit axis, function type 4."""
    file = pyuff.UFF(str(path))
    frf = truth.accelerance(q, LINES)
    for i in range(3):
        entry = {
            "type": 58, "binary": 0, "func_type": 4, "id1": "SIMULATED", "rsp_node": 1,
            "rsp_dir": i + 1, "ref_node": 1, "ref_dir": hit + 1, "ord_data_type": 6,
            "num_pts": LINES.size, "abscissa_spacing": 1, "abscissa_min": LINES[0],
            "abscissa_inc": 0.25, "abscissa_spec_data_type": 18, "z_axis_spec_data_type": 0,
            "ordinate_spec_data_type": 12, "ordinate_axis_units_lab": "m/s^2",
            "orddenom_spec_data_type": 13, "orddenom_axis_units_lab": "N",
            "data": frf[i, hit], "x": LINES,
        }  # fmt: skip
        file.write_sets(entry, "add")


def test_exported_frfs_give_the_modes(tmp_path):
    robot, campaign_toml, truth = make_cell(tmp_path)
    campaign = Campaign.new(tmp_path / "cell", robot, campaign_toml)
    proposal = campaign.next()[0]
    q = np.deg2rad(proposal.joints_deg)
    folder = tmp_path / "export"
    folder.mkdir()
    with open(folder / "recordings.csv", "w", newline="") as file:
        writer = csv.writer(file)
        names = [f"{n}_deg" for n in campaign.cell.robot.joint_names]
        writer.writerow(["pose", *names, "hit", "repeat", "file"])
        for hit in range(3):
            name = f"frf_{'xyz'[hit]}.uff"
            write_frfs(folder / name, truth, q, hit)
            writer.writerow([proposal.pose, *proposal.joints_deg, f"+{'xyz'[hit]}", 1, name])
    (report,) = campaign.import_paths((folder,))
    assert report.refused == ()
    assert report.measurement is not None
    found = np.array([m.frequency_hz for m in report.measurement.modes])
    assert report.measurement.simulated
    for frequency in truth.modes(q, 3)[0]:
        assert np.min(np.abs(found / frequency - 1)) < 1e-3
    assert [m is not None for m in report.model.labelled[0].modes[:3]] == [True] * 3
