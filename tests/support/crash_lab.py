"""A small campaign that is killed and has no room on its disk: what is lost, and what is said.

A script of its own: `python -m tests.support.crash_lab ROOT --kills 500 --full 50`.
Each trial is one line of ROOT/KIND.jsonl; started again, it goes on after the last.
"""

import argparse
import errno
import json
import os
import shutil
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.campaign.events import Imported
from planner.campaign.journal import Journal
from planner.campaign.state import CampaignState, fold
from planner.campaign.store import check_kept, recording_path
from planner.cli.run import STOPPED, run
from planner.errors import PlannerError
from planner.proof.deviation import Deviation
from planner.proof.load import load_truth
from planner.proof.recordings import record_poses
from tests.support.forked import Outcome, forked, preload
from tests.support.outside import HAMMER
from tests.support.plain_arm import JOINTS_DEG, make_plain_arm, plain_campaign

ENOUGH = 5  # measured poses, after which a campaign is replayed and another begun
LATEST_S, MOST_CHANGES = 1.2, 150  # of a command's life; beyond, most have ended
LARGEST_FILE = 2**16  # bytes of a disk that takes no large file

# What a second time has nothing left to act upon, where the first one was done before the end.
DONE_ONCE = ("new", "skip", "withdraw", "undo")

Command = list[str]


@dataclass(frozen=True)
class Cell:
    """The folders of one cell; `campaign` is what is ill-treated."""

    root: Path

    @property
    def campaign(self) -> Path:
        return self.root / "cell"

    @property
    def log(self) -> Path:
        return self.campaign / "log.jsonl"

    def make(self) -> "Cell":
        """Write robot and campaign.toml, unless they are there."""
        if not (self.root / "plan").exists():
            make_plain_arm(self.root / "robot")
            plan = plain_campaign(self.root / "plan" / "campaign.toml", "maximin_lhs")
            # What is lost does not hang on what a fit finds.
            plan.write_text(f"{plan.read_text()}\n[fidelity]\nsimulation = 'frozen'\n")
            (self.root / "inbox").mkdir()
            (self.root / "pool").mkdir()
            q = np.random.default_rng(1).uniform(*np.deg2rad(JOINTS_DEG).T, (6, 4))
            self._record(self.root / "pool", [(f"R{i}", row) for i, row in enumerate(q)])
            (self.root / "poses.csv").write_text(
                "pose,joint_1_deg,joint_2_deg,joint_3_deg,joint_4_deg\nH1,0,-40,50,0\n"
            )
        return self

    def _record(self, folder: Path, poses: list) -> None:
        truth = load_truth(self.root / "robot" / "robot.toml", Deviation(seed=3, stiffness=0.1))
        record_poses(truth, poses, folder, repeats=1, hammer=HAMMER, seed=len(poses))

    def exported(self, pose: str, joints_deg: tuple[float, ...]) -> Path:
        """What the analyser exports at a pose."""
        folder = self.root / "exports" / f"{pose}_{hash(joints_deg) % 10**8}"
        if not folder.exists():
            self._record(folder, [(pose, np.deg2rad(joints_deg))])
        return folder

    def begun(self) -> Command:
        robot, plan = self.root / "robot" / "robot.toml", self.root / "plan" / "campaign.toml"
        return ["new", str(self.campaign), "--robot", str(robot), "--campaign", str(plan)]

    def state(self) -> CampaignState:
        return fold(Journal(self.log).entries)

    @property
    def played(self) -> bool:
        return self.log.exists() and len(self.state().used) >= ENOUGH

    def command(self, rng: np.random.Generator) -> Command:
        """What a person might do next."""
        if not self.log.exists():
            return self.begun()
        state, there = self.state(), str(self.campaign)
        if not state.open:
            return ["next", there]
        pose = state.open[0]
        folder = self.exported(pose, state.proposals[pose].joints_deg)
        kinds = ["import", "watch", "undo", "skip", "withdraw", "next"]
        chances = [0.45, 0.25, 0.12, 0.06, 0.06, 0.06]
        kind = str(rng.choice(kinds, p=chances))
        if kind == "withdraw" and state.used:
            return ["withdraw", there, state.used[-1].pose]
        if kind == "watch":
            shutil.rmtree(self.root / "inbox")
            shutil.copytree(folder / "data", self.root / "inbox")
            return ["watch", there, str(self.root / "inbox"), "--auto", "--hits-per-pose", "3"]
        if kind == "skip":
            return ["skip", there, pose]
        if kind == "undo" and state.events > 2:
            return ["undo", there]
        return ["next", there, "--count", "2"] if kind == "next" else ["import", there, str(folder)]


def doing(command: Command) -> Callable[[], int]:
    """The command as an outsider's script gives it."""
    return lambda: run([*command, "--json"])


def entries(cell: Cell) -> tuple:
    return Journal(cell.log).entries if cell.log.exists() else ()


def lost(cell: Cell, before: tuple, command: Command, outcome: Outcome) -> list[str]:
    """What was acknowledged, before or now, and is not there; and what is there twice."""
    if not cell.log.exists():
        return ["the campaign is gone"] if before else []
    try:
        now = entries(cell)
    except PlannerError as error:
        return [str(error)]
    found = [] if now[: len(before)] == before else ["what the log said before"]
    state = fold(now)
    imported = [h for e in now if isinstance(e.event, Imported) for h in e.event.hits]
    for hit in (*imported, *(hit for _, hit in state.refused.values())):
        path = recording_path(cell.campaign, hit.sha256, hit.suffix)
        try:
            check_kept(path, hit.sha256, hit.file)
        except PlannerError as error:
            found.append(str(error))
    hashes = Counter(hit.sha256 for m in state.recorded for hit in m.hits)
    found += [f"{digest} twice" for digest, count in hashes.items() if count > 1]
    answer = outcome.answer
    if answer is None or outcome.code not in (0, 3):
        return found
    if command[0] == "next":
        missing = [p for p in answer["proposals"] if p["pose"] not in state.proposals]
        found += [f"proposal {p['pose']}" for p in missing]
    if command[0] == "import" and answer["accepted"]:
        files = {hit.file for m in state.recorded for hit in m.hits}
        found += [f"hit {file}" for file in answer["accepted"] if file not in files]
    if command[0] in ("undo", "skip", "withdraw") and len(now) <= len(before):
        found.append(f"the {command[0]}")
    return found


def given_again(cell: Cell, command: Command, log: Path) -> list[str]:
    """The faults of a command that is given once more; halves of files are gone after it."""
    before, again = entries(cell), forked(doing(command), log)
    codes = (0, 2, 3) if command[0] in DONE_ONCE else (0, 3)
    left_over = [str(path) for path in cell.campaign.rglob(".*.part")]
    return again.faults(codes) + lost(cell, before, command, again) + left_over


def kill(cell: Cell, rng: np.random.Generator, log: Path) -> dict:
    """One command, killed; half of the time it is given again."""
    if cell.played:
        replayed = forked(doing(["replay", str(cell.campaign)]), log)
        shutil.rmtree(cell.campaign)
        if replayed.code or not replayed.answer["reproduced"]:
            said = replayed.out[-500:] or f"code {replayed.code}: {replayed.err[-500:]}"
            return {"command": ["replay"], "faults": ["not reproduced", said]}
    command, before = cell.command(rng), entries(cell)
    change = int(np.exp(rng.uniform(0, np.log(MOST_CHANGES)))) if rng.random() < 0.6 else 0
    after = float(rng.uniform(0.0, LATEST_S * (2 if command[0] == "watch" else 1)))
    if change and command[0] != "watch":
        after = 0.0
    outcome = forked(doing(command), log, change, after)
    faults = outcome.faults() + lost(cell, before, command, outcome)
    if command[0] != "watch" and rng.random() < 0.5:
        faults += given_again(cell, command, log)
    return {"command": command[:1], "killed": outcome.killed, "cpu_s": outcome.cpu_s,
            "gib": outcome.peak_gib, "faults": faults}  # fmt: skip


def interrupt(cell: Cell, rng: np.random.Generator, log: Path) -> dict:
    """One command, stopped as by Ctrl-C, then given again."""
    if cell.played:
        shutil.rmtree(cell.campaign)
    command, before = cell.command(rng), entries(cell)
    change = int(np.exp(rng.uniform(0, np.log(MOST_CHANGES))))
    watching = command[0] == "watch"
    outcome = forked(doing(command), log, change, 4.0 if watching else 0.0, signal.SIGINT)
    faults = outcome.faults((0, 3, STOPPED)) + lost(cell, before, command, outcome)
    said = outcome.err.strip().splitlines()
    if outcome.code == STOPPED and (len(said) != 1 or not said[0].startswith("Stopped")):
        faults.append(f"no one sentence: {outcome.err[:400]}")
    if watching and outcome.code == 0 and "Session ended: quit" in outcome.err:
        told, gained = outcome.err, entries(cell)[len(before) :]
        faults += [] if "Stopped: " in told else [f"nothing is said of the stop: {told[-300:]}"]
        new = [e.event.pose for e in gained if isinstance(e.event, Imported)]
        faults += [f"the hits of {pose} are not named" for pose in new[-1:] if pose not in told]
    if not watching:
        faults += given_again(cell, command, log)
    return {"command": command[:1], "code": outcome.code, "change": change,
            "said": outcome.err.strip()[-200:], "faults": faults}  # fmt: skip


def others(cell: Cell) -> list[Command]:
    """Commands that write elsewhere than into the log."""
    there, out = str(cell.campaign), cell.root / "out"
    out.mkdir(exist_ok=True)
    robot, plan = cell.root / "robot" / "robot.toml", cell.root / "plan" / "campaign.toml"
    compare = ["compare", str(cell.root / "pool"), "--robot", str(robot), "--campaign", str(plan),
               "--strategies", "sobol", "--repeats", "2", "--initial", "2", "--budget", "3",
               "--simulation", "frozen", "--workers", "1",
               "--out", str(out / "compare")]  # fmt: skip
    return [
        compare,
        ["study", "busch2022", "--small", "--out", str(out / "study")],
        ["predict", there, str(cell.root / "poses.csv"), "--out", str(out / "frfs.npz")],
        ["report", there, "--out", str(out / "report.html")],
        ["export", there, "csv", "--out", str(out / "export")],
        ["status", there, "--plot", str(out / "pictures")],
        ["replay", there],
    ]


def starve(cell: Cell, rng: np.random.Generator, log: Path) -> dict:
    """One command on a disk that is full or read-only from some change on, or takes no large file;
    then again with room."""
    if cell.played:
        shutil.rmtree(cell.campaign)
    shutil.rmtree(cell.root / "out", ignore_errors=True)
    (cell.root / "out").mkdir()
    command = cell.command(rng)
    if rng.random() < 0.3 and cell.log.exists() and cell.state().used:
        more = others(cell)
        command = more[int(rng.choice(len(more)))]
    before, change = entries(cell), int(np.exp(rng.uniform(0, np.log(MOST_CHANGES))))
    why = int(rng.choice([errno.ENOSPC, errno.EROFS, errno.EFBIG]))
    watching = 1.5 if command[0] == "watch" else 0.0
    room = {"largest": LARGEST_FILE} if why == errno.EFBIG else {"at_change": change, "full": why}
    outcome = forked(doing(command), log, after_s=watching, **room)
    faults = outcome.faults((0, 2, 3)) + lost(cell, before, command, outcome)
    said = outcome.err.strip().splitlines()
    if outcome.code == 2 and len(said) != 1 and not watching:  # whose page goes there too
        faults.append(f"no one sentence: {outcome.err[:400]}")
    before = entries(cell)
    again = forked(doing(command), log, after_s=watching)
    codes = (0, 3, 2) if outcome.code == 0 else (0, 3)
    faults += again.faults(codes) + lost(cell, before, command, again)
    return {"command": command[:1], "code": outcome.code, "said": outcome.err.strip()[:200],
            "why": errno.errorcode[why], "change": change, "faults": faults}  # fmt: skip


TRIALS = {"kills": kill, "stopped": interrupt, "full": starve}


def trials(root: Path, kind: str, count: int, seed: int) -> Iterator[dict]:
    """All trials of a kind: those that were done before, then the others."""
    folder = root / kind
    folder.mkdir(parents=True, exist_ok=True)
    kept = root / f"{kind}.jsonl"
    done = kept.read_text().splitlines() if kept.exists() else []
    yield from (json.loads(line) for line in done[:count])
    if len(done) >= count:
        return
    disk = folder / "disk"
    disk.mkdir(exist_ok=True)
    cell = Cell(disk).make()
    os.environ["XDG_CACHE_HOME"] = str(root / "cache")
    for number in range(len(done), count):
        found = TRIALS[kind](cell, np.random.default_rng([seed, number]), folder)
        with open(kept, "a") as file:
            file.write(json.dumps({"number": number, **found}) + "\n")
        yield found


def main() -> int:
    """Run what is asked; 1 where anything was lost or went wrong."""
    asked = argparse.ArgumentParser()
    asked.add_argument("root", type=Path)
    asked.add_argument("--seed", type=int, default=1)
    for kind in TRIALS:
        asked.add_argument(f"--{kind}", type=int, default=0)
    told = asked.parse_args()
    preload()
    wrong = 0
    for kind in TRIALS:
        found = list(trials(told.root.resolve(), kind, getattr(told, kind), told.seed))
        faulty = [one for one in found if one["faults"]]
        wrong += len(faulty)
        counted = Counter(one["command"][0] for one in found)
        print(f"{kind}: {len(found)}, {sum(bool(f.get('killed')) for f in found)} killed, "
              f"{len(faulty)} faulty; {dict(counted)}")  # fmt: skip
        for one in faulty[:20]:
            print(json.dumps(one, ensure_ascii=False))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
