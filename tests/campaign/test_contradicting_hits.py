"""Hits of an axis that contradict each other are held and asked about, and no limit is claimed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.campaign.campaign import Campaign
from planner.design.stopping import Forecast
from planner.proof.hits import simulate_hit
from planner.proof.recordings import write_uff
from tests.support.outside import HAMMER, call, told


@pytest.fixture
def struck(first_pose):
    """A campaign, and hits at its pose: two an axis, of z the second was along y.

    Aside: a third along z, and a fourth that was along y, too.
    """
    rng, q = np.random.default_rng(1), np.deg2rad(first_pose.joints_deg)
    hits = first_pose.made / "data"
    for path in hits.glob("*_3.uff"):
        path.unlink()
    wrong = next(hits.glob("*pz_2.uff"))
    third, fourth = (first_pose.made / name for name in ("third.uff", "fourth.uff"))
    for path, axis in ((wrong, "+y"), (third, "+z"), (fourth, "+y")):
        hit = simulate_hit(first_pose.truth, q, axis, HAMMER, rng)
        write_uff(path, replace(hit, axis="+z"), HAMMER)
    return first_pose, hits, wrong, third, fourth


def names(paths) -> set[str]:
    return {Path(path).name for path in paths}


def test_the_import_is_held_and_names_the_files(struck):
    first, hits, wrong, *_ = struck
    cell = first.cell
    code, _, err = call("import", cell, hits)
    said = " ".join(err.split())
    two = [wrong.name, wrong.name.replace("_2", "_1")]
    wanted = (*two, f"planner undo {cell}", f"planner confirm {cell} {first.pose}")
    assert (code, [words for words in wanted if words not in said]) == (3, [])
    found = told("status", cell)
    assert found["used"] == 0
    question = found["held"][0]["question"]
    assert [Path(name).name for name in question["disagree"]] == two
    # Confirmed, all are used; the log is reproduced.
    told("confirm", cell, first.pose)
    assert told("status", cell)["used"] == 1
    assert told("replay", cell)["reproduced"]
    page = Path(told("report", cell)["report"]).read_text()
    assert "Joints as proposed: nothing was read back" in page  # files alone say no angles
    code, _, err = call("report", cell, "--out", cell / "none" / "x.html")
    assert (code, "make that folder" in err, (cell / "none").exists()) == (2, True, False)


def test_two_and_two_are_held_too(struck):
    first, hits, wrong, third, fourth = struck
    code, _, err = call("import", first.cell, hits, third, fourth, "--pose", first.pose)
    assert code == 3
    assert all(name in " ".join(err.split()) for name in (wrong.name, fourth.name))
    question = told("status", first.cell)["held"][0]["question"]
    every = {wrong.name, wrong.name.replace("_2", "_1"), third.name, fourth.name}
    assert names(question["disagree"]) == every


def test_a_third_hit_tells_which_was_right(struck):
    first, hits, wrong, third, _ = struck
    assert call("import", first.cell, hits)[0] == 3
    told("undo", first.cell)
    code, _, err = call("import", first.cell, hits, third, "--pose", first.pose)
    assert code == 3
    assert "held" not in err
    (used,) = Campaign(first.cell).state.used
    assert names(h.file for h in used.hits if not h.accepted) == {wrong.name}
    assert len(used.accepted) == 6


def test_where_the_simulation_misses_no_limit_is_told():
    known = Forecast(0.4, 1.3, 0.95, 1.0, 0.97, 1.0, 0.06, 2)
    doubted = known.doubted(4.2)
    assert "0.4" not in doubted.text.replace("4.2 times", "")
    assert "not known" in doubted.text
    assert "4.2 times their noise" in doubted.text
    assert doubted.rmse_percent == pytest.approx(4.2 * 0.4)
    assert doubted.reached == 0
    assert "bring the RMSE to about 0.34 %" in replace(known, gain_percent=0.06).text
