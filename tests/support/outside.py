"""Driving the program from outside: by commands, files and JSON only."""

import contextlib
import io
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from planner.cli.run import run
from planner.proof import descriptions
from planner.proof.deviation import Deviation
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.proof.recordings import record_poses
from planner.recording.folder import TABLE
from tests.support.robots import BAND_HZ, JOINTS_DEG, campaign_text, make_arm

PLANNER = (sys.executable, "-c", "from planner.cli import main; main()")
HAMMER = Hammer(peak_n=60.0, duration_s=0.004, record_s=2.0, sampling_rate_hz=640.0)


def with_tests() -> dict[str, str]:
    """The environment of a Python that is to import what these tests import."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}


def planner(*arguments: object, limit_s: float = 240) -> subprocess.CompletedProcess[str]:
    """Run `planner …` in a process of its own."""
    command = [*PLANNER, *(str(a) for a in arguments)]
    env = {**os.environ, "PLANNER_DEBUG": "1"}
    return subprocess.run(command, capture_output=True, text=True, env=env, timeout=limit_s)


def call(*arguments: object) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command in this process, which starts no other."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run([str(a) for a in arguments])
    return code, out.getvalue(), err.getvalue()


def said(*arguments: object) -> str:
    """What a command that must succeed prints, in this process."""
    code, out, err = call(*arguments)
    assert code == 0, f"{arguments}: {code}\n{err}"
    return out


def told(*arguments: object) -> dict:
    """The JSON answer of a command that must succeed, in this process."""
    return json.loads(said(*arguments, "--json"))


def only_told(*arguments: object) -> dict:
    """The same of a command that has not a word to say beside."""
    code, out, err = call(*arguments, "--json")
    assert (code, err) == (0, "")
    return json.loads(out)


def refused(*arguments: object, code: int = 2) -> str:
    """The one sentence with which a command refuses its input, in this process."""
    found, out, err = call(*arguments)
    assert (found, out, len(err.strip().splitlines())) == (code, "", 1), err
    return err


def modes(*arguments: object) -> tuple[int, Any, str]:
    """Exit code, JSON answer (None where there is none) and stderr of `planner modes`."""
    code, out, err = call("modes", *arguments, "--json")
    return code, json.loads(out) if out else None, err


def part_of(folder: Path, target: Path, poses: Collection[str]) -> Path:
    """A copy of a recordings folder with some of the poses."""
    header, *lines = (folder / TABLE).read_text().splitlines()
    kept = [line for line in lines if line.split(",")[0] in poses]
    for name in (line.split(",")[-1] for line in kept):
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(folder / name, target / name)
    (target / TABLE).write_text("\n".join([header, *kept]) + "\n")
    return target


FROZEN = '[fidelity]\nsimulation = "frozen"\n'


def make_cell(root: Path, learns: bool = True) -> tuple[Path, Path, Truth]:
    """A robot folder, a campaign.toml and a truth that deviates from the simulation.

    Fits of a simulation that learns are most of an import's time.
    """
    robot = make_arm(root / "robot")
    campaign = root / "plan" / "campaign.toml"
    campaign.parent.mkdir()
    campaign.write_text(campaign_text() + ("" if learns else FROZEN))
    truth = load_truth(
        robot, Deviation(seed=3, stiffness=0.12, damping=0.1, inertia=0.04, com_m=0.003)
    )
    return robot, campaign, truth


def record(truth: Truth, folder: Path, pose: str, joints_deg: list[float], seed: int = 0) -> Path:
    """What the analyser would export for a pose."""
    q = np.deg2rad(joints_deg)
    return record_poses(truth, [(pose, q)], folder, repeats=3, hammer=HAMMER, seed=seed)


def measured(truth: Truth, cell: Path, folder: Path, seed: int = 0) -> tuple[dict, dict]:
    """What `next` proposes, and what `import` says of hits that were recorded there."""
    (proposal,) = told("next", cell)["proposals"]
    hits = record(truth, folder, proposal["pose"], proposal["joints_deg"], seed)
    return proposal, told("import", cell, hits)


def record_pool(truth: Truth, folder: Path, poses: int, seed: int, repeats: int = 3) -> Path:
    """Hits at random poses P000, P001, ... of the joint box."""
    low, high = np.deg2rad(np.array(JOINTS_DEG, dtype=float)).T
    q = np.random.default_rng(seed).uniform(low, high, (poses, 6))
    named = [(f"P{i:03d}", row) for i, row in enumerate(q)]
    return record_poses(truth, named, folder, repeats=repeats, hammer=HAMMER, seed=seed)


def make_pool(root: Path, poses: int, seed: int) -> tuple[Path, Path, Path]:
    """Recordings of poses in the joint box, robot.toml, campaign.toml."""
    robot = make_arm(root / "robot")
    off = Deviation(seed=seed, stiffness=0.15, damping=0.1, inertia=0.04, com_m=0.003)
    recordings = record_pool(load_truth(robot, off), root / "hits", poses, seed, 1)
    campaign = root / "campaign.toml"
    campaign.write_text(descriptions.campaign(JOINTS_DEG, 3, BAND_HZ, 'name = "variance"\n'))
    return recordings, robot, campaign


@dataclass(frozen=True)
class FirstPose:
    """A campaign whose simulation does not learn, which is quick, and nine hits at its pose."""

    cell: Path
    robot: Path
    plan: Path
    truth: Truth
    pose: str
    joints_deg: list[float]
    made: Path

    @classmethod
    def begun(cls, root: Path) -> "FirstPose":
        robot, plan, truth = make_cell(root, learns=False)
        told("new", root / "cell", "--robot", robot, "--campaign", plan)
        (proposal,) = told("next", root / "cell")["proposals"]
        pose, joints_deg = proposal["pose"], proposal["joints_deg"]
        made = record(truth, root / "made", pose, joints_deg)
        return cls(root / "cell", robot, plan, truth, pose, joints_deg, made)

    def copied(self, folder: Path, name: str = "cell") -> "FirstPose":
        """The campaign under a name, and its recordings, to be changed."""
        cell = shutil.copytree(self.cell, folder / name)
        return replace(self, cell=cell, made=shutil.copytree(self.made, folder / "made"))

    @property
    def files(self) -> list[Path]:
        """The recorded hits."""
        return sorted((self.made / "data").iterdir())

    def at(self, folder: Path, pose: str, joints_deg: list[float], seed: int = 0) -> Path:
        """What would be recorded at another pose, or again."""
        return record(self.truth, folder, pose, joints_deg, seed)
