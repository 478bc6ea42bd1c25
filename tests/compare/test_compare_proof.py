"""A study of the size that is asked for: 4 strategies × 20 seeds × 15 measurements, 100 poses.

`pytest -m slow tests/compare/test_compare_proof.py -s` prints curves and times. SIMULATION=updated
or none instead of frozen, SEEDS=2 for a smaller one. The bound is that of two idle cores: the
runs' processor time on two of them.
"""

import json
import os

import numpy as np
import pytest

from planner.proof.arms import KR10
from planner.proof.deviation import Deviation
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.recordings import record_poses
from tests.support.outside import planner

pytestmark = [pytest.mark.slow, pytest.mark.timeout(7200)]
POSES, BUDGET, SEED = 100, 15, 201
SEEDS = int(os.environ.get("SEEDS", "20"))
SIMULATION = os.environ.get("SIMULATION", "frozen")
STRATEGIES = "maximin_lhs,random,variance,default"
BOUND_S = 300.0


def test_the_study_takes_five_minutes_on_two_cores(tmp_path):
    robot = KR10.write(tmp_path / "robot", 2)
    truth = load_truth(robot, Deviation(SEED, 0.15, 0.15, 0.04, 0.005))
    poses = [(f"P{i:03d}", q) for i, q in enumerate(KR10.poses(POSES, SEED))]
    hammer = Hammer(peak_n=300, duration_s=0.004, sampling_rate_hz=640, record_s=2.4)
    hits = record_poses(truth, poses, tmp_path / "hits", repeats=2, hammer=hammer, seed=SEED)
    campaign = tmp_path / "campaign.toml"
    campaign.write_text(
        KR10.campaign(str(robot)).replace(str(list(KR10.band_hz)), f"[{KR10.band_hz[0]}, 60.0]")
    )
    arguments = ("compare", hits, "--robot", robot, "--campaign", campaign, "--out", tmp_path)
    study = ("--strategies", STRATEGIES, "--repeats", SEEDS, "--budget", BUDGET)
    how = ("--simulation", SIMULATION, "--json")
    answer = json.loads(planner(*arguments, *study, *how, limit_s=7000).stdout)
    spent = sum(curve["process_seconds"] for curve in answer["strategies"].values())
    print(f"\nsimulation {SIMULATION}, {SEEDS} seeds, {POSES} poses; medians of RMSE in %")
    for name, curve in answer["strategies"].items():
        print(f"{name:<12}" + "".join(f"{e:7.2f}" for e in curve["frequency_rmse_percent"]))
    print("to 1 %:", answer["measurements_to_one_percent"])
    print(f"{spent:.0f} s of processor time: {spent / 2:.0f} s on two idle cores", flush=True)
    assert answer["failed"] == []
    for curve in answer["strategies"].values():
        assert curve["n"] == list(range(3, BUDGET + 1))
        assert np.all(np.isfinite(curve["frequency_rmse_percent"]))
    assert spent / 2 * 20 / SEEDS <= BOUND_S
