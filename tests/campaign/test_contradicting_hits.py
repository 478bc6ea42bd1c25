"""Hits of an axis that contradict each other are held and asked about, and no limit is claimed."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.campaign.campaign import Campaign
from planner.design.stopping import Forecast
from planner.proof.hits import simulate_hit
from planner.proof.recordings import record_poses, write_uff
from planner.recording.read import read
from planner.recording.records import TimeRecord
from tests.support.outside import HAMMER, call, make_cell, told


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A new campaign with a proposal, and two hits an axis there; one z hit was along y."""
    root = tmp_path_factory.mktemp("contradicting")
    robot, plan, truth = make_cell(root, learns=False)
    assert call("new", root / "cell", "--robot", robot, "--campaign", plan)[0] == 0
    pose = told("next", root / "cell")["proposals"][0]
    q = np.deg2rad(pose["joints_deg"])
    folder = record_poses(truth, [(pose["pose"], q)], root / "good", repeats=2, hammer=HAMMER)
    rng = np.random.default_rng(1)
    odd = simulate_hit(truth, q, "+y", HAMMER, rng)
    third = simulate_hit(truth, q, "+z", HAMMER, rng)
    fourth = simulate_hit(truth, q, "+y", HAMMER, rng)
    hits = root / "hits"
    shutil.copytree(folder / "data", hits)
    wrong = next(hits.glob("*pz_2.uff"))
    write_uff(wrong, type(odd)("+z", odd.force_n, odd.acceleration_m_s2), HAMMER)
    write_uff(root / "third.uff", third, HAMMER)
    as_z = type(odd)("+z", fourth.force_n, fourth.acceleration_m_s2)
    write_uff(root / "fourth.uff", as_z, HAMMER)
    assert all(isinstance(r, TimeRecord) for r in read(wrong))
    return root / "cell", pose["pose"], hits, wrong, root / "third.uff"


@pytest.fixture
def cell(made, tmp_path) -> Path:
    return shutil.copytree(made[0], tmp_path / "cell")


def test_the_import_is_held_and_names_the_files(cell, made):
    _, pose, hits, wrong, _ = made
    code, _, err = call("import", cell, hits)
    said = " ".join(err.split())
    assert code == 3
    assert wrong.name in said
    assert wrong.name.replace("_2", "_1") in said
    assert f"planner undo {cell}" in said
    assert f"planner confirm {cell} {pose}" in said
    found = told("status", cell)
    assert found["used"] == 0
    question = found["held"][0]["question"]
    assert [Path(name).name for name in question["disagree"]] == [
        wrong.name, wrong.name.replace("_2", "_1"),
    ]  # fmt: skip
    # Confirmed, all are used; the log is reproduced.
    told("confirm", cell, pose)
    assert told("status", cell)["used"] == 1
    assert told("replay", cell)["reproduced"]
    page = Path(told("report", cell)["report"]).read_text()
    assert "Joints as proposed: nothing was read back" in page  # files alone say no angles
    code, _, err = call("report", cell, "--out", cell / "none" / "x.html")
    assert (code, "make that folder" in err, (cell / "none").exists()) == (2, True, False)


def test_two_and_two_are_held_too(cell, made):
    _, pose, hits, wrong, third = made
    fourth = third.with_name("fourth.uff")
    code, _, err = call("import", cell, hits, third, fourth, "--pose", pose)
    assert code == 3
    assert all(name in " ".join(err.split()) for name in (wrong.name, fourth.name))
    question = told("status", cell)["held"][0]["question"]
    assert {Path(name).name for name in question["disagree"]} == {
        wrong.name, wrong.name.replace("_2", "_1"), third.name, fourth.name,
    }  # fmt: skip


def test_a_third_hit_tells_which_was_right(cell, made):
    _, pose, hits, wrong, third = made
    assert call("import", cell, hits)[0] == 3
    told("undo", cell)
    code, _, err = call("import", cell, hits, third, "--pose", pose)
    assert code == 3
    assert "held" not in err
    state = Campaign(cell).state
    assert [Path(h.file).name for m in state.used for h in m.hits if not h.accepted] == [wrong.name]
    assert len(state.used[0].accepted) == 6


def test_where_the_simulation_misses_no_limit_is_told():
    known = Forecast(0.4, 1.3, 0.95, 1.0, 0.97, 1.0, 0.06, 2)
    doubted = known.doubted(4.2)
    assert "0.4" not in doubted.text.replace("4.2 times", "")
    assert "not known" in doubted.text
    assert "4.2 times their noise" in doubted.text
    assert doubted.rmse_percent == pytest.approx(4.2 * 0.4)
    assert doubted.reached == 0
    assert "bring the RMSE to about 0.34 %" in replace(known, gain_percent=0.06).text
