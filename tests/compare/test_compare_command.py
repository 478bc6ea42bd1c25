"""`planner compare` from outside, and its runs from inside: small pools, few measurements."""

import json
import os
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from planner.campaign.build import build, hits_unknown
from planner.campaign.proposals import propose
from planner.campaign.state import CampaignState
from planner.compare.bench import assemble, cell_of, comparison_config
from planner.compare.resume import recorded
from planner.compare.run import run
from planner.compare.tasks import Task
from planner.dataset.visits import recordings_in
from planner.robot.robot import Robot
from tests.support.outside import PLANNER, make_pool, refused, said, told

POSES, STRATEGIES = 12, "maximin_lhs,default"
SMALL = ("--repeats", "2", "--initial", "2", "--budget", "4", "--simulation", "frozen",
         "--workers", "1")  # fmt: skip


@pytest.fixture(scope="module")
def pool(tmp_path_factory):
    return make_pool(tmp_path_factory.mktemp("pool"), POSES, seed=4)


@pytest.fixture(scope="module")
def bench(pool):
    recordings, robot_toml, campaign = pool
    robot = Robot.load(robot_toml)
    listed = recordings_in(recordings, robot.joints, robot.points)
    config = comparison_config(robot, listed, campaign, "frozen")
    poses = recorded(listed, robot.joints, config.modes, 1, lambda *_: None)
    return assemble(robot, config, poses)[0]


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("study")


def command(pool, out: Path, *more: str) -> list[str]:
    recordings, robot, campaign = pool
    named = ["--robot", str(robot), "--campaign", str(campaign), "--strategies", STRATEGIES]
    return ["compare", str(recordings), *named, *SMALL, "--out", str(out), *more]


@pytest.fixture(scope="module")
def first(pool, out):
    return told(*command(pool, out, "--rrd", str(out / "curves.rrd")))


def test_the_answer_has_every_documented_key(first):
    assert set(first["strategies"]) == {"maximin_lhs", "default"}
    for curve in first["strategies"].values():
        assert curve["n"] == [2, 3, 4]
        for key in ("frequency_rmse_percent", "r2", "coverage95"):
            assert len(curve[key]) == 3
            assert np.all(np.isfinite(curve[key]))
        assert curve["wall_seconds"] > 0
    assert set(first["measurements_to_one_percent"]) == set(first["strategies"])
    assert first["simulated"]
    assert first["pool"] == POSES
    assert first["acquisitions"]["default"] == "variance"


def test_strategies_begin_alike_and_are_compared_in_pairs(first):
    started = [c["frequency_rmse_percent"][0] for c in first["strategies"].values()]
    assert len(set(started)) == 1
    assert first["paired"]["baseline"] == "maximin_lhs"
    for found in first["paired"]["against"].values():
        assert found["seeds"] == 2
        assert found["difference_percent"][0] == 0
        low, high = found["difference_percent_interval95"][-1]
        assert low <= found["difference_percent"][-1] <= high


def test_picture_table_and_rerun_recording_are_written(first, out):
    for file in (*first["plots"], first["rrd"]):
        assert Path(file).is_absolute()
        assert Path(file).stat().st_size > 10_000
    assert json.loads((out / "comparison.json").read_text())["strategies"] == first["strategies"]


def numbers(path: Path) -> list:
    """All that a kept run says, but for the time it took."""
    run = json.loads(path.read_bytes())["kept"]
    return [value for key, value in run.items() if not key.endswith("_seconds")]


def test_more_repeats_take_up_what_is_done(pool, out, first):
    runs = sorted((out / "runs").iterdir())
    assert len(runs) == 4
    kept = {path: (path.stat().st_mtime_ns, numbers(path)) for path in runs}
    runs[0].unlink()
    flipped = runs[1].read_bytes().replace(b"0.", b"1.", 1)
    runs[1].write_bytes(flipped)  # a figure that reads as well as the one before
    text = said(*command(pool, out, "--repeats", "3"))
    assert "SIMULATED" in text
    assert "to 1 %" in text
    after = {path: (path.stat().st_mtime_ns, numbers(path)) for path in runs}
    assert [path for path in runs if after[path][0] != kept[path][0]] == runs[:2]
    assert [found for _, found in after.values()] == [found for _, found in kept.values()]
    remarks = json.loads((out / "comparison.json").read_text())["remarks"]
    assert [r for r in remarks if runs[1].name in r and "damaged" in r]
    assert len(list((out / "runs").iterdir())) == 6


def test_models_are_compared_as_strategies_are(pool, tmp_path):
    asked = command(pool, tmp_path, "--strategies", "random", "--models", "gp,ar1,none")
    asked += ["--repeats", "1"]
    found = told(*asked)
    assert found["models"] == {"gp": "gp", "ar1": "ar1", "none": "none"}
    assert set(found["acquisitions"].values()) == {"random"}
    last = {n: c["frequency_rmse_percent"][-1] for n, c in found["strategies"].items()}
    assert last["ar1"] < last["none"] < last["gp"]  # 4 poses, a simulation that is 5 % off


def test_ctrl_c_keeps_what_is_finished(pool, tmp_path):
    long = command(pool, tmp_path, "--repeats", "500")
    # Tests that a shell runs in the background inherit that Ctrl-C is ignored.
    heard = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    interpreter, option, code = PLANNER
    process = subprocess.Popen(
        [interpreter, option, heard + code, *long],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    until = time.monotonic() + 200
    while len(list((tmp_path / "runs").glob("*.json"))) < 2 and time.monotonic() < until:
        time.sleep(0.1)
    os.kill(process.pid, signal.SIGINT)
    _, last = process.communicate(timeout=60)
    assert process.returncode == 130
    assert last.splitlines()[-1].startswith("Stopped")  # after progress, on a slow machine
    assert "kept" in last
    done = list((tmp_path / "runs").glob("*.json"))
    assert 2 <= len(done) < 500
    assert all(json.loads(path.read_bytes())["kept"]["n"] == [2, 3, 4] for path in done)
    assert not list((tmp_path / "runs").glob(".*"))


def test_a_run_is_the_campaign_s(bench):
    found = run(bench, Task("variance", 1, 2, 4))
    assert len(set(found.poses)) == 4
    by_name = {m.pose: m for m in bench.measurements}
    frfs = {m.pose: f for m, f in zip(bench.measurements, bench.frfs, strict=True)}
    for n in (2, 3):
        state = CampaignState(measurements={p: by_name[p] for p in found.poses[:n]}, events=1)
        model = build(cell_of(bench), state, hits_unknown(frfs))
        (proposal,) = propose(model, state, 1, "variance")
        chosen = by_name[found.poses[n]].joints_deg
        assert np.allclose(proposal.joints_deg, chosen, atol=1e-3)
        unused = [i for i, m in enumerate(bench.measurements) if m.pose not in found.poses[:n]]
        predicted = model.predict(bench.q[unused]).frequency_hz
        error = predicted / bench.frequency_hz[unused] - 1
        rmse = 100 * np.sqrt(np.nanmean(error**2))
        assert found.frequency_rmse_percent[n - 2] == pytest.approx(rmse, rel=1e-9)


def test_the_pool_is_judged_by_its_own_modes(bench, pool):
    from planner.proof.deviation import Deviation
    from planner.proof.load import load_truth

    truth = load_truth(pool[1], Deviation(4, 0.15, 0.1, 0.04, 0.003))
    right = np.array([truth.modes(q, 3)[0] for q in bench.q])
    known = np.isfinite(bench.frequency_hz)
    assert known.mean() > 0.9
    assert np.max(np.abs(bench.frequency_hz / right - 1)[known]) < 0.005


def test_other_versions_of_the_program_are_refused(bench):
    from dataclasses import replace

    from planner.errors import InputError

    with pytest.raises(InputError, match="another version"):
        run(replace(bench, program="older"), Task("random", 0, 2, 4))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--strategies", "astrology"), "astrology"),
        (("--strategies", ","), "--strategies names none"),
        (("--models", "kriging"), 'there is no model "kriging"; choose one of default, gp'),
        (("--models", "gp,ar1", "--simulation", "none"), '"ar1" needs a simulation'),
        (("--budget", "11"), "--budget 11"),
        (("--initial", "9"), "--initial 9"),
        (("--simulation", "frosted"), "frosted"),
        (("--repeats", "9", "--scheduler", "tcp://127.0.0.1:9"), "No Dask scheduler"),
        (("--campaign", "nowhere.toml"), "nowhere.toml"),
        (("--robot", "nowhere.toml"), "nowhere.toml"),
        (("--repeats", "0"), "repeats"),
    ],
)
def test_bad_input_is_one_sentence(pool, out, first, more, words, monkeypatch):
    monkeypatch.setattr("planner.compare.cluster.CONNECT_TIMEOUT_S", 0.5)
    assert words in refused(*command(pool, out), *more, "--json")
