"""Whole campaigns on true robots (MuJoCo) hit as people hit, through the program's own commands.

A robot's simulation lacks one thing, of any size; `next` proposes, hits are recorded and imported,
and frequencies are compared at poses of the workspace that were never measured. Beside it the same
recordings go into a campaign that uses no simulation.
"""

import json
import time
import zlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from shutil import rmtree

import msgspec
import numpy as np

from planner.campaign.campaign import Campaign
from planner.campaign.model import Model
from planner.dataset.store import Store
from planner.proof.fault_injection import HitVisit, InjectedFaults, quiet_hits
from planner.proof.hits import AXES, Hammer, noisy
from planner.proof.load import load_truth
from planner.proof.measurement_errors import EVERYDAY, HitError
from planner.proof.model import Truth
from planner.proof.recordings import write_recordings
from tests.support.faulty_robots import KINDS, MOST_MODES, ROBOTS, Robot, lacking
from tests.support.true_modes import NOT_COUNTED, counted, own_of_hose, true_modes

POSES, UNSEEN, REPEATS, CANDIDATES = 5, 24, 2, 60
MOST = 12  # modes that are looked at when they are counted


@dataclass(frozen=True)
class Cell:
    """A robot that is hit: hands with habits of their own, a chain within its tolerances."""

    robot: Robot
    truth: Truth
    injected: InjectedFaults
    hammer: Hammer
    habits: list[HitError]
    rng: np.random.Generator

    @classmethod
    def of(
        cls,
        robot: Robot,
        injected: InjectedFaults,
        rng: np.random.Generator,
    ) -> "Cell":
        truth = load_truth(robot.toml, injected.deviation)
        hammer = replace(robot.hammer, noise=float(rng.uniform(0.005, 0.03)), oversampling=8)
        injected = replace(injected, chain=EVERYDAY.chain(rng))
        middle = np.mean([truth.lower_rad, truth.upper_rad], axis=0)
        [quiet] = quiet_hits(
            truth, injected, [HitVisit(middle, [("+x", hammer.peak_n)])], hammer, rng
        )
        hammer = EVERYDAY.floor(hammer, quiet, rng)
        return cls(robot, truth, injected, hammer, EVERYDAY.common(rng), rng)

    def record(self, folder: Path, pose: str, joints_deg: tuple[float, ...]) -> Path:
        """Hits at a pose where the robot was sent; the robot stands a little beside."""
        rng = self.rng
        axes = [axis for axis in range(3) for _ in range(REPEATS)]
        aims = EVERYDAY.aims(axes, rng, self.habits)
        there = EVERYDAY.beside(np.deg2rad(joints_deg), rng)
        shots = [(f"+{AXES[axis]}", self.hammer.peak_n) for axis in axes]
        [quiet] = quiet_hits(
            self.truth, self.injected, [HitVisit(there, shots, aims=aims)], self.hammer, rng
        )
        rows = [(pose, np.array(joints_deg), [noisy(hit, self.hammer, rng) for hit in quiet])]
        names, said = self.truth.joint_names, self.truth.description
        return write_recordings(folder, names, rows, self.hammer, said, self.robot.nodes)


@dataclass(frozen=True)
class Score:
    """At unseen poses: RMSE in %, and the share of frequencies inside their 95 % intervals.

    `covered`: inside those of a pose's mean over visits, which the truth is; `visit`: inside those
    of a new visit, which are told and are wider by the scatter from visit to visit.
    """

    rmse: float
    covered: float
    visit: float
    misfit: float | None

    @classmethod
    def of(cls, model: Model, truth: Truth, unseen: np.ndarray, hose: bool) -> "Score":
        """Of a campaign's model at some of its candidates, by their numbers.

        For `hose` see `true_modes`.
        """
        q = model.cell.candidates.q[unseen]
        found, visit_sd = model.frequencies(q)
        sd = model.workspace_prediction.frequency_sd_hz[unseen]
        most = found.shape[1] + NOT_COUNTED
        known = [true_modes(truth, one, most, hose) for one in q]
        true = np.array([counted(*k, f) for k, f in zip(known, found, strict=True)])
        off = found / true - 1
        learned = model.low.identified_robot or model.low.rejected
        inside, visit = (float(np.mean(np.abs(found - true) <= 1.96 * s)) for s in (sd, visit_sd))
        misfit = learned.identified.misfit if learned else None
        return cls(100 * float(np.sqrt(np.mean(off**2))), inside, visit, misfit)


@dataclass(frozen=True)
class Played:
    """A campaign's scores after each pose, and those of its peer that uses no simulation.

    `asked`: how often the campaign took hits for those of another pose, which none were.
    """

    robot: str
    kind: str
    seed: int
    size: float
    modes: int
    own: tuple[Score, ...]
    peer: tuple[Score, ...]
    remarks: tuple[str, ...]
    cpu_s: float
    asked: int = 0


def play(name: str, kind: str, seed: int, folder: Path) -> Played:
    """One campaign by `next` and `import`, and its peer by `import` of the same recordings."""
    started = time.process_time()
    rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    rng = np.random.default_rng([seed, zlib.crc32(f"{name} {kind}".encode())])
    robot = ROBOTS[name](folder, rng)
    injected, size = lacking(kind, robot, rng)
    cell = Cell.of(robot, injected, rng)
    kept = Store(folder / "models")

    def begun(use: str, modes: int) -> Campaign:
        more = f"[fidelity]\nsimulation = '{use}'\n"
        path = decisions(robot, folder / f"{use}.toml", modes, CANDIDATES, more)
        return Campaign(Campaign.new(path.with_suffix(""), robot.toml, path).directory, kept)

    first = np.deg2rad(begun("frozen", MOST_MODES).next()[0].joints_deg)
    hz, seen = true_modes(cell.truth, first, MOST)
    hose = kind != "hose" or bool(seen[own_of_hose(cell.truth, first, MOST)])
    modes = min(MOST_MODES, int(np.sum(seen & (hz > robot.band_hz[0]) & (hz < robot.band_hz[1]))))
    own, peer = both = begun("updated", modes), begun("none", modes)
    models: list[tuple[Model, Model]] = []
    asked = 0
    for number in range(POSES):
        proposal = own.next()[0]
        said = cell.record(folder / f"hits{number}", proposal.pose, proposal.joints_deg)
        for campaign in both:
            for report in campaign.import_paths((said,)):
                if report.question is not None:  # the robot is where it was sent
                    campaign.confirm(report.pose)
                    asked += campaign is own
        models.append((own.model, peer.model))
    unseen = _unseen(own, rng)
    scores = [[Score.of(m, cell.truth, unseen, hose) for m in pair] for pair in models]
    return Played(
        name, kind, seed, size, modes, tuple(a for a, _ in scores), tuple(b for _, b in scores),
        models[-1][0].remarks, time.process_time() - started, asked,
    )  # fmt: skip


def _unseen(campaign: Campaign, rng: np.random.Generator) -> np.ndarray:
    """Numbers (UNSEEN,) of candidates, which stand for the workspace, that were not measured."""
    q = campaign.cell.candidates.q
    taken = np.deg2rad([m.joints_deg for m in campaign.state.measurements.values()])
    free = np.min(np.max(np.abs(q[:, None] - taken), axis=2), axis=1) > np.deg2rad(1.0)
    return rng.permutation(np.flatnonzero(free))[:UNSEEN]


def decisions(robot: Robot, path: Path, modes: int, candidates: int, more: str = "") -> Path:
    """A robot's campaign.toml."""
    path.write_text(
        f"[workspace]\n{robot.workspace}\n[modes]\ncount = {modes}\n"
        f"band_hz = {list(robot.band_hz)}\n[acquisition]\ncandidates = {candidates}\n{more}"
    )
    return path


def in_turn(number: int) -> tuple[str, str]:
    """A robot and what its simulation lacks."""
    names = list(ROBOTS)
    return names[number % len(names)], KINDS[(number + number // len(names)) % len(KINDS)]


def campaigns(folder: Path, first_seed: int, wanted: int) -> Iterator[Played]:
    """As many campaigns, robots and kinds in turn; what the folder holds is not done again."""
    for number in range(wanted):
        name, kind = in_turn(number)
        path = folder / f"{first_seed + number}.json"
        if not path.is_file():
            played = play(name, kind, first_seed + number, folder / str(first_seed + number))
            part = path.with_suffix(".part")
            part.write_text(json.dumps(asdict(played)))
            part.replace(path)
        yield msgspec.json.decode(path.read_bytes(), type=Played)
