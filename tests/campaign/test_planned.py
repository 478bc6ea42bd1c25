"""Predictions outside what was planned are marked: by joints, places, tool and branch alike."""

from pathlib import Path

import numpy as np
import pytest

from planner.campaign.cell import Cell
from planner.campaign.config import load_campaign_config
from planner.campaign.model_status import outside_remark
from planner.demo import NAME, shipped
from planner.report.predictions import predictions
from planner.robot.collision import Collisions
from planner.robot.inverse_kinematics import solve
from tests.support.shipped_campaign import shipped_campaign

POSES = 80  # planned; as many again that are not


def cell_of(config: Path) -> Cell:
    return Cell.load(shipped(NAME) / "robot" / "robot.toml", load_campaign_config(config))


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """A workspace of positions and rotations."""
    config = tmp_path_factory.mktemp("places") / "campaign.toml"
    text = (shipped(NAME) / "campaign.toml").read_text()
    ranges = "position_m = [[1.2, 1.8], [-0.5, 0.6], [1.0, 1.4]]\nrotation_deg = [-40, 40]"
    assert "\n[acquisition]" in text
    text = text.replace("\n[acquisition]", f"\n[acquisition]\ncandidates = {POSES}")
    old = next(line for line in text.splitlines() if line.startswith("position_m"))
    config.write_text(text.replace(old, ranges))
    return cell_of(config)


@pytest.fixture(scope="module")
def planned(places):
    """Further poses as they would have been planned."""
    return places.workspace.candidates(places.robot, 2 * POSES, 0).q[POSES:]


def test_poses_as_planned_are_inside(places, planned):
    assert places.inside(places.candidates.q).all()
    assert places.inside(planned).all()
    turned = planned.copy()
    turned[:, 5] += np.where(turned[:, 5] > 0, -2 * np.pi, 2 * np.pi)  # the same pose
    assert places.inside(turned).all()


def test_a_wrist_turned_over_is_outside(places, planned):
    rotation, position = places.robot.forward_batch(planned)
    over = planned.copy()
    over[:, 3] += np.where(over[:, 3] > 0, -np.pi, np.pi)
    over[:, 4] *= -1
    over[:, 5] += np.where(over[:, 5] > 0, -np.pi, np.pi)
    same_rotation, same_position = places.robot.forward_batch(over)
    np.testing.assert_allclose(same_rotation, rotation, atol=1e-9)
    np.testing.assert_allclose(same_position, position, atol=1e-9)
    assert places.workspace.contains(places.robot, over, 1e-5).all()
    away = np.abs(planned[:, 4]) > np.deg2rad(15)  # where the two ways are far from one another
    assert away.sum() > POSES / 2
    # So few poses are planned here that one far from all may be reached either way.
    assert places.inside(over[away]).mean() < 0.06


def test_a_tilted_tool_is_outside(places, planned):
    rotation, position = places.robot.forward_batch(planned[:10])
    turn = np.array([[1, 0, 0], [0, np.cos(0.04), -np.sin(0.04)], [0, np.sin(0.04), np.cos(0.04)]])
    free = Collisions(places.robot)
    every = zip(rotation, position, planned, strict=False)
    found = [solve(places.robot, r @ turn, p, q, free, 0).q for r, p, q in every]
    tilted = np.array([q for q in found if q is not None])
    assert len(tilted) > 5
    np.testing.assert_allclose(
        places.robot.forward_batch(tilted)[1], position[[q is not None for q in found]], atol=1e-4
    )
    assert not places.inside(tilted).any()


def test_every_answer_marks_them(tmp_path):
    campaign = shipped_campaign(tmp_path)
    here = campaign.cell.candidates.q[0]
    off_deg = {"here": [0.0] * 6, "read back": [0.02, *[0.0] * 5], "tilted": [0, 0, 0, 0, 3, 0]}
    q = [here + np.deg2rad(off) for off in off_deg.values()]
    report = predictions(campaign, list(off_deg), q, tmp_path / "p.npz", np.full(3, np.nan))
    assert [pose["outside"] for pose in report.to_json()["poses"]] == [False, False, True]
    assert np.load(tmp_path / "p.npz")["outside"].tolist() == [False, False, True]
    rows, remark, *_ = report.text().renderables
    assert {"here", "tilted (outside)"} <= set(rows.columns[0].cells)
    assert str(remark) == outside_remark(["tilted"])
    records = campaign.predict_records(joints_deg=np.rad2deg(q))
    assert {row["pose"]: row["outside"] for row in records} == {1: False, 2: False, 3: True}


def test_the_sentence_stays_short():
    assert outside_remark([]) == ""
    assert outside_remark(["A"]).startswith("A lies outside")
    assert "and 14 more lie outside" in outside_remark([f"W{i}" for i in range(20)])
