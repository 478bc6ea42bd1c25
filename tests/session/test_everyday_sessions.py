"""No hit gets in at a pose where it was not hit: everyday sessions in `watch`'s own loop.

An engineer by script answers rightly or not at all. `EVERYDAY_SESSIONS` says how many campaigns are
played, 200 as a rule, `EVERYDAY_FIRST` from which seed on.

Hits come late, bad, without an axis, or before the robot has moved; questions stay unanswered; the
program is killed anywhere; acts are taken back and done again, in the session and by command. Of
each file it is kept where the robot stood: what the campaign uses is held against that.
"""

import io
import os
import shutil
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from planner.campaign.campaign import Campaign
from planner.dataset.screened_files import Source
from planner.errors import PlannerError
from planner.file_content import sha256
from planner.proof.deviation import Deviation
from planner.proof.hits import AXES, SimulatedHit, simulate_hit
from planner.proof.load import load_truth
from planner.proof.recordings import write_uff
from planner.replay import replay
from planner.session.watch import watch
from tests.support import outside
from tests.support.hit_files import write_hit
from tests.support.plain_arm import make_plain_arm, plain_campaign

HAMMER = replace(outside.HAMMER, sampling_rate_hz=320.0, oversampling=4)
MOST_KEYS, POSES, SESSIONS = 90, 4, 6
COUNT = int(os.environ.get("EVERYDAY_SESSIONS", "200"))
FIRST = int(os.environ.get("EVERYDAY_FIRST", "0"))


class Killed(BaseException):
    """The program was killed: nothing more of it runs."""


class LastPage(io.StringIO):
    """What was printed last, as a person sees it, and which pose it sends the robot to."""

    pose = ""

    def write(self, text: str) -> int:
        if "go to pose " in text:
            self.pose = text.rsplit("go to pose ", 1)[1].split(maxsplit=1)[0]
        return len(text)


@dataclass
class Engineer:
    """Stands at the robot and presses keys; also its `Keys`."""

    root: Path
    rng: np.random.Generator
    campaign: Campaign = field(init=False)
    at: dict[str, tuple[float, ...]] = field(default_factory=dict)  # by sha256: where it was hit
    done: Counter = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    hits_made: dict[str, list[str]] = field(default_factory=dict)  # axes, by pose
    pending: list[Path] = field(default_factory=list)  # exports that come later
    at_pose: str = ""
    keys: int = 0
    skipping: bool = False

    def __post_init__(self) -> None:
        robot = make_plain_arm(self.root / "robot", softer=float(self.rng.uniform(0.9, 1.2)))
        plan = plain_campaign(self.root / "plan" / "campaign.toml")
        plan.write_text(plan.read_text() + "[cost]\nhits_per_axis = 2\n")
        self.truth = load_truth(robot, Deviation(seed=int(self.rng.integers(99)), stiffness=0.1))
        self.inbox, self.made = self.root / "inbox", self.root / "made"
        self.inbox.mkdir()
        self.made.mkdir()
        self.campaign = Campaign.new(self.root / "cell", robot, plan)

    # -- hits ----------------------------------------------------------------------------------

    def hit(self, pose: str, axis: str, kind: str = "good") -> Path:
        """One hit at a pose, exported beside the watched folder."""
        joints_deg = self.campaign.state.proposals[pose].joints_deg
        made = simulate_hit(self.truth, np.deg2rad(joints_deg), f"+{axis}", HAMMER, self.rng)
        path = self.made / f"h{len(self.at):04d}.uff"
        if kind == "double":
            force = made.force_n + 0.6 * np.roll(made.force_n, 30)
            made = SimulatedHit(made.axis, force, made.acceleration_m_s2)
        write_uff(path, made, HAMMER)
        if kind == "unstated":
            (read,), _ = Source(path, path.name).read()
            path.unlink()
            path = write_hit(path.with_suffix(".csv"), read, stated=False)
        self.at[sha256(path)] = joints_deg
        return path

    def export(self, path: Path) -> None:
        shutil.move(path, self.inbox / path.name)

    # -- keys ----------------------------------------------------------------------------------

    def __call__(self, timeout_s: float) -> str | None:
        """The next key, after what happens at the robot meanwhile."""
        self.check()
        self.keys += 1
        if self.skipping:  # with or without a reason
            self.skipping = False
            return "\n"
        if self.keys > MOST_KEYS:
            return "q"
        if self.rng.random() < 0.02:
            self.done["killed"] += 1
            raise Killed
        state = self.campaign.state
        if state.held:
            return self.on_question()
        if self.page.pose != self.at_pose:
            self.arrive(self.page.pose)
            return None
        return self.work()

    def on_question(self) -> str | None:
        """Right, wrong or nothing; what was hit elsewhere is never confirmed."""
        held = next(iter(self.campaign.state.held.values()))
        right = all(self.from_there(hit.sha256, held.joints_deg) for hit in held.hits)
        self.done["questions"] += 1
        return str(self.rng.choice(["a", "u", "r"] if right else ["r", "u"]))

    def from_there(self, digest: str, joints_deg: tuple[float, ...]) -> bool:
        return bool(np.allclose(self.at[digest], joints_deg, atol=1e-6))

    def arrive(self, pose: str) -> None:
        """The page has changed; some hits are of the pose before all the same."""
        before, self.at_pose = self.at_pose, pose
        for path in self.pending:
            self.export(path)
            self.done["late"] += 1
        self.pending = []
        made = self.hits_made.get(before)
        if made and self.rng.random() < 0.15:  # hit before the robot was moved
            for axis in dict.fromkeys(made):
                self.export(self.hit(before, axis))
            self.done["not moved yet"] += 1

    def work(self) -> str | None:
        """Hit, answer, or go on."""
        pose, rng = self.at_pose, self.rng
        made = self.hits_made.setdefault(pose, [])
        missing = [axis for axis in AXES if made.count(axis) < 2]
        if missing and rng.random() < 0.85:
            axis = missing[0]
            kind = str(rng.choice(["good", "double", "unstated"], p=[0.86, 0.08, 0.06]))
            path = self.hit(pose, axis, kind)
            if kind == "good" and axis in made and rng.random() < 0.25:
                self.pending.append(path)
            else:
                self.export(path)
            if kind == "good":
                made.append(axis)
            self.done[kind] += 1
            return None
        late = self.late_here()
        if late and rng.random() < 0.4:
            self.done["answered"] += 1
            return late
        chances = {
            "a": 0.7, "u": 0.08, "U": 0.06, "k": 0.04, "r": 0.04, "s": 0.02, "R": 0.01, "q": 0.03,
            "\n": 0.02,
        }  # fmt: skip
        key = str(rng.choice([*chances], p=[*chances.values()]))
        self.done[key] += 1
        self.skipping = key == "k"
        return key

    def late_here(self) -> str:
        """The right answer about late hits; "": none is right for all, or there are none."""
        state = self.campaign.state
        digests = {sha256(path) for path in self.inbox.iterdir()}
        used = {h.sha256 for m in state.recorded for h in m.hits} | state.refused.keys()
        waiting = [(d, state.came(d, self.at_pose)) for d in digests - used if d in state.shown]
        late = [(d, pose) for d, pose in waiting if pose != self.at_pose]
        here = state.proposals[self.at_pose].joints_deg
        if late and all(self.from_there(d, here) for d, _ in late):
            return "h"
        stated = state.proposals
        return "b" if late and all(
            pose in stated and self.from_there(d, stated[pose].joints_deg) for d, pose in late
        ) else ""  # fmt: skip

    # -- around the sessions ---------------------------------------------------------------------

    def check(self) -> None:
        """No hit is in use at a pose where it was not hit."""
        for measured in self.campaign.state.used:
            wrong = [
                h for h in measured.accepted if not self.from_there(h.sha256, measured.joints_deg)
            ]
            self.faults += [f"{Path(hit.file).name} at {measured.pose}" for hit in wrong]

    def session(self) -> None:
        """One session, to its end or until it is killed."""
        self.campaign = Campaign(self.campaign.directory)
        self.page, self.keys, self.skipping = LastPage(), 0, False
        console = Console(width=80, file=self.page, force_terminal=False)
        append, rng = self.campaign._journal.append, self.rng

        def killed_after(event):
            entry = append(event)
            if rng.random() < 0.01:
                self.done["killed"] += 1
                raise Killed
            return entry

        self.campaign._journal.append = killed_after
        with suppress(Killed):
            watch(self.campaign, self.inbox, console=console, keys=self, quiet_s=0.0, limit_s=120)
        self.campaign = Campaign(self.campaign.directory)
        self.check()

    def between(self) -> None:
        """A command between two sessions: a pose is skipped, an act taken back, a folder given."""
        state, rng = self.campaign.state, self.rng
        act = str(rng.choice(["undo", "redo", "skip", "import", "nothing"]))
        digests = {sha256(path) for path in self.inbox.iterdir()}
        used = {h.sha256 for m in state.recorded for h in m.hits}
        try:
            if act == "undo":
                self.campaign.undo()
            elif act == "redo":
                self.campaign.redo()
            elif act == "skip" and state.open:
                self.campaign.skip(state.open[0])
            elif act == "import" and digests <= used | state.shown.keys():
                self.campaign.import_paths((self.inbox,))
            self.done[f"{act} by command"] += 1
        except PlannerError:
            self.done[f"no {act}"] += 1
        self.check()


def everyday(root: Path, seed: int) -> Engineer:
    """A campaign in sessions until some poses are measured; its log is replayed at the end."""
    engineer = Engineer(root, np.random.default_rng([53, seed]))
    for _ in range(SESSIONS):
        engineer.session()
        if len(engineer.campaign.state.used) >= POSES:
            break
        engineer.between()
    engineer.done["measured"] = len(engineer.campaign.state.used)
    steps = list(replay(engineer.campaign))
    engineer.faults += [f"replay: {s.detail}" for s in steps if s.check == "differs"]
    return engineer


@pytest.mark.slow
@pytest.mark.timeout(14400)
def test_no_hit_gets_in_at_a_pose_where_it_was_not_hit(tmp_path):
    done, faulty = Counter(), {}
    for seed in range(FIRST, FIRST + COUNT):
        engineer = everyday(tmp_path / f"{seed}", seed)
        done += engineer.done
        if engineer.faults:
            faulty[seed] = sorted(set(engineer.faults))
        print(seed, faulty.get(seed, "no fault"), flush=True)
    print(f"{COUNT} campaigns, {len(faulty)} faulty: {faulty}\n{dict(done)}")
    assert not faulty
    assert min(done[act] for act in ("late", "killed", "answered", "u", "U")) > COUNT / 10
    assert done["measured"] > 2 * COUNT
