"""From hits to lobes at poses never measured: the shipped campaign beside its own truth."""

import csv
import importlib.util
from pathlib import Path

import numpy as np
import pytest

from planner.campaign.campaign import Campaign
from planner.demo import play
from planner.progress import no_progress
from planner.proof.load import load_truth
from tests.support.milling_cases import cut
from tests.support.true_limits import limit_pair

SHIPPED = Path(__file__).parents[2] / "campaigns" / "kr240_plane"
NEAR = 0.10  # of the true limit


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_limits_at_poses_never_measured(tmp_path: Path):
    """Four measured poses; all other poses of the pool, at eight speeds."""
    spec = importlib.util.spec_from_file_location("regenerate", SHIPPED / "regenerate.py")
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    truth = load_truth(SHIPPED / "robot" / "robot.toml", made.DEVIATION)
    play(tmp_path / "campaign", 4, False, no_progress)
    campaign = Campaign(tmp_path / "campaign")
    angles = {}
    with open(SHIPPED / "recordings" / "recordings.csv", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            angles[row["pose"]] = [float(row[f"joint_{k}_deg"]) for k in range(1, 7)]
    for pose in campaign.state.measurements:
        del angles[pose]
    q, lines = np.deg2rad(np.array(list(angles.values()))), campaign.frequency_lines
    mean, sd = campaign.frf_at(q)
    given = cut(
        diameter_m=0.018, kt_n_m2=8.8e8, kr_n_m2=0.52e8, spindle_rpm=(500.0, 4000.0, 8),
        depth_m=(0.0, 0.02, 100),
    )  # fmt: skip
    pairs = [
        limit_pair(given, lines, mean[i], sd[i], truth.accelerance(q[i], lines), 48)
        for i in range(len(q))
    ]
    off = np.array([pair.off for pair in pairs])
    inside = np.mean([pair.inside for pair in pairs])
    print(
        f"{len(off)} poses × 8 speeds: within 10 % {100 * np.mean(off < NEAR):.1f} %, median off "
        f"{100 * np.median(off):.2f} %, all speeds within 10 % at "
        f"{100 * np.mean(np.all(off < NEAR, axis=1)):.0f} % of the poses; the true limit inside "
        f"the 90 % band {100 * inside:.1f} %"
    )
    assert np.mean(off < NEAR) >= 0.9
    assert inside >= 0.85
