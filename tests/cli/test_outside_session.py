"""A whole session by commands on a robot that is not the shipped one."""

import csv
from pathlib import Path

import numpy as np

from planner.truth.load import load_truth
from tests.support.outside import call, make_cell, record, told
from tests.support.robots import JOINTS_DEG

MEASUREMENTS = 3


def likeness(a, b) -> float:
    """Complex correlation of two sets of FRFs, 1 for the same."""
    return float(np.abs(np.vdot(a, b)) / (np.linalg.norm(a) * np.linalg.norm(b)))


def test_some_measurements_and_a_prediction(tmp_path):
    robot, campaign_toml, truth = make_cell(tmp_path)
    cell = tmp_path / "cell"
    made = told("new", cell, "--robot", robot, "--campaign", campaign_toml)
    assert made["modes"] == 4
    for number in range(MEASUREMENTS):
        (proposal,) = told("next", cell)["proposals"]
        assert set(proposal) >= {"pose", "joints_deg", "position_m", "score", "reason"}
        folder = record(truth, tmp_path / f"export{number}", proposal["pose"],
                        proposal["joints_deg"], seed=number)  # fmt: skip
        report = told("import", cell, folder)
        assert report["pose"] == proposal["pose"]
        assert len(report["accepted"]) == 9
        assert report["refused"] == []
    assert call("import", cell, folder, "--json")[0] == 0
    status = told("status", cell, "--plot", tmp_path / "pictures")
    assert len(status["measurements"]) == MEASUREMENTS
    assert status["simulated"] is True
    left_out = status["leave_one_out"]
    assert left_out["values"] == len(left_out["frequencies"]) > 2 * MEASUREMENTS
    assert 0.5 < left_out["coverage"]["0.95"] <= 1
    for row in left_out["frequencies"]:
        assert abs(row["measured_hz"] - row["predicted_hz"]) < 8 * row["sd_hz"]
    assert Path(status["plots"][0]).read_bytes().startswith(b"\x89PNG")

    rng = np.random.default_rng(5)
    poses = np.array([[rng.uniform(a, b) for a, b in JOINTS_DEG] for _ in range(30)])
    table = tmp_path / "predict.csv"
    with open(table, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["pose", *(f"joint_a{i}_deg" for i in range(1, 7))])
        writer.writerows([[f"H{i:02d}", *row] for i, row in enumerate(poses)])
    predicted = told("predict", cell, table, "--out", tmp_path / "out.npz")
    true = np.array([truth.modes(np.deg2rad(q), 4)[0] for q in poses])
    ours = np.array([[m["frequency_hz"] for m in p["modes"]] for p in predicted["poses"]])
    sd = np.array([[m["sd_hz"] for m in p["modes"]] for p in predicted["poses"]])
    rmse = 100 * np.sqrt(np.mean((ours / true - 1) ** 2))
    inside = np.mean(np.abs(ours - true) <= 1.96 * sd)
    print(f"frequency RMSE {rmse:.2f} %, in the 95 % interval {100 * inside:.0f} %")
    assert rmse < 3.0
    assert inside > 0.8

    with np.load(predicted["npz"]) as npz:
        lines = npz["frequency_hz"]
        assert npz["frf_mean"].shape == (30, 3, 3, lines.size)
        assert npz["frf_sd"].shape == (30, 3, 3, lines.size)
        assert np.iscomplexobj(npz["frf_mean"])
        h = np.array([truth.accelerance(np.deg2rad(q), lines) for q in poses])
        nominal = load_truth(robot)
        simulated = np.array([nominal.accelerance(np.deg2rad(q), lines) for q in poses])
        print(
            f"FRF likeness {likeness(npz['frf_mean'], h):.3f}, "
            f"of the simulation {likeness(simulated, h):.3f}"
        )
        assert likeness(npz["frf_mean"], h) > likeness(simulated, h)

    replayed = told("replay", cell)
    assert replayed["reproduced"]
    assert {s["check"] for s in replayed["steps"]} <= {"identical", "kept"}


def test_what_another_acquisition_would_have_proposed_and_saved(tmp_path):
    robot, campaign_toml, truth = make_cell(tmp_path, learns=False)
    cell, measured = tmp_path / "cell", []
    told("new", cell, "--robot", robot, "--campaign", campaign_toml)
    for number in range(MEASUREMENTS + 2):
        (proposal,) = told("next", cell)["proposals"]
        measured.append(proposal["pose"])
        told("import", cell, record(truth, tmp_path / f"export{number}", measured[-1],
                                    proposal["joints_deg"], seed=number))  # fmt: skip
    replayed = told("replay", cell, "--acquisition", "variance")
    assert replayed["reproduced"]
    proposed = [step for step in replayed["steps"] if step["event"] == "proposed"]
    assert proposed
    assert all(len(step["instead"]) == 1 for step in proposed)
    assert all(not step["instead"] for step in replayed["steps"] if step["event"] == "imported")
    runs = replayed["otherwise"]["runs"]
    was, other = runs["campaign"], runs["variance"]
    assert was["poses"] == measured[: len(was["poses"])]
    assert other["poses"][0] == was["poses"][0]
    assert len(set(other["poses"])) == len(was["poses"]) == len(measured) - 2
    assert was["n"] == other["n"]
    assert np.all(np.diff(other["minutes"]) > 0)
    assert "variance would have needed" in replayed["otherwise"]["text"]
