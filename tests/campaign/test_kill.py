"""kill -9 at random moments of a session: nothing acknowledged is lost, replay is identical."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from planner.campaign.campaign import Campaign
from planner.campaign.events import Imported, Proposed
from planner.replay import replay
from tests.support.outside import make_cell, planner, with_tests

MEASUREMENTS = 5

# A session as an outsider's script would drive it; what it was told, it writes down and syncs.
SESSION = """
import contextlib, io, json, os, sys
from pathlib import Path
from tests.support.outside import make_cell, record
from planner.cli.run import run
from planner.truth.deviation import Deviation
from planner.truth.load import load_truth

root, wanted = Path(sys.argv[1]), int(sys.argv[2])
truth = load_truth(root / "robot" / "robot.toml", Deviation(seed=3, stiffness=0.12, inertia=0.04))
told = open(root / "told.jsonl", "a")

def ask(*arguments):
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        code = run([str(a) for a in arguments] + ["--json"])
    assert code == 0, (arguments, code, out.getvalue())
    answer = json.loads(out.getvalue())
    told.write(json.dumps({"command": arguments[0], "answer": answer}) + "\\n")
    told.flush()
    os.fsync(told.fileno())
    return answer

print("ready", flush=True)
cell = root / "cell"
while len(ask("status", cell)["measurements"]) < wanted:
    proposal = ask("next", cell)["proposals"][0]
    folder = root / "export" / proposal["pose"]
    if not (folder / "recordings.csv").exists():
        record(truth, folder, proposal["pose"], proposal["joints_deg"])
    ask("import", cell, folder)
print("done", flush=True)
"""


def check_survivor(root: Path) -> None:
    """All that the session was told is in the log, and there only once."""
    campaign = Campaign(root / "cell")
    proposed = {p.pose: p for e in campaign.entries if isinstance(e.event, Proposed)
                for p in e.event.proposals}  # fmt: skip
    imported = [e.event for e in campaign.entries if isinstance(e.event, Imported)]
    hashes = [hit.sha256 for event in imported for hit in event.hits]
    assert len(hashes) == len(set(hashes))
    told = root / "told.jsonl"
    for line in told.read_text().splitlines() if told.exists() else []:
        if not line.endswith("}"):
            continue  # the kill hit the test's own note
        entry = json.loads(line)
        if entry["command"] == "next":
            for proposal in entry["answer"]["proposals"]:
                kept = proposed[proposal["pose"]]
                assert list(kept.joints_deg) == proposal["joints_deg"]
                assert kept.score == proposal["score"]
        if entry["command"] == "import":
            event = next(e for e in imported if e.pose == entry["answer"]["pose"])
            assert len(event.hits) == 9
            for hit in event.hits:
                assert campaign.source_of(hit).path.is_file()


def kill_sessions(root: Path, kills: int, seed: int) -> int:
    """Start, kill after a random time, check; again until so many kills have struck."""
    rng = random.Random(seed)
    struck = generation = 0
    cell_root = root
    while struck < kills:
        process = subprocess.Popen(
            [sys.executable, "-c", SESSION, str(cell_root), str(MEASUREMENTS)],
            stdout=subprocess.PIPE, text=True, start_new_session=True,
            env=with_tests(),
        )  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(rng.uniform(0.0, 5.0))
        finished = process.poll() is not None
        os.killpg(process.pid, signal.SIGKILL) if not finished else None
        output = process.communicate()[0]
        check_survivor(cell_root)
        if not finished:
            struck += 1
        if "done" in output or finished:
            assert process.returncode in (0, -9), output
            check_replay(cell_root)
            generation += 1
            cell_root = root / f"generation{generation}"
            start(cell_root)
    check_replay(cell_root)
    return struck


def check_replay(root: Path) -> None:
    steps = list(replay(Campaign(root / "cell")))
    assert {step.check for step in steps} <= {"identical", "kept"}


def start(root: Path) -> None:
    root.mkdir(exist_ok=True)
    robot, campaign_toml, _ = make_cell(root)
    planner("new", root / "cell", "--robot", robot, "--campaign", campaign_toml)


@pytest.mark.parametrize(
    ("kills", "seed"),
    [(6, 1), pytest.param(100, 2, marks=[pytest.mark.slow, pytest.mark.timeout(3000)])],
)
def test_kill_minus_nine_at_random_moments(tmp_path, kills, seed):
    start(tmp_path)
    struck = kill_sessions(tmp_path, kills, seed)
    print(f"{struck} kills survived")
    assert struck == kills
