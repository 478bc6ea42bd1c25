"""Whole campaigns on true robots (MuJoCo) hit as people hit, through the program's own commands.

A robot's simulation lacks one thing, of any size; `next` proposes, hits are recorded and imported,
and frequencies are compared at poses of the workspace that were never measured. Beside it the same
recordings go into a campaign that uses no simulation.
"""

import json
import time
import tomllib
import xml.etree.ElementTree as ElementTree
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from shutil import copytree, rmtree

import numpy as np

from planner.campaign.campaign import Campaign
from planner.campaign.model import Model
from planner.dataset.store import Store
from planner.demo import shipped
from planner.truth.arms import ARMS
from planner.truth.cases import DAMPING_S, PEAK_N
from planner.truth.deviation import AttachedResonator, BentLink, Spring
from planner.truth.handling import EVERYDAY, Aim, Handling, together
from planner.truth.hits import AXES, Hammer, noisy, write_recordings
from planner.truth.load import load_truth
from planner.truth.model import Truth
from planner.truth.scene import PULSE_S, deviate, log_uniform, some_direction, triple
from planner.truth.secret import HitVisit, Secret, quiet_hits
from planner.truth.springs import beam_end
from planner.truth.world import REAL
from tests.support import generated_arms
from tests.support.arm_with_points import NODES, write_arm
from tests.support.counted_modes import NOT_COUNTED, counted, own_of_hose, true_modes

KINDS = "nothing", "soft base", "bending link", "hose"
SIZES = 0.01, 1.0  # of what is lacking, 1 being large: log-uniform, drawn once
POSES, UNSEEN, REPEATS, MOST_MODES, CANDIDATES = 5, 24, 2, 4, 60
BENDS_M = 0.15  # least length of a link that bends
TCP_NODE, MOST = 17, 12  # node of the tool; modes that are looked at when they are counted


@dataclass(frozen=True)
class Robot:
    """Files of a robot, its workspace as text of campaign.toml, band (Hz), and who hits it.

    `nodes` are the analyser's numbers of the points.
    """

    toml: Path
    workspace: str
    band_hz: tuple[float, float]
    hammer: Hammer
    nodes: Mapping[str, int] = field(default_factory=dict)


def _known(name: str, folder: Path, rng: np.random.Generator) -> Robot:
    arm = replace(ARMS[name], damping_s=DAMPING_S)
    toml = arm.write(folder / "robot", int(rng.choice([1, 3])))
    rate = 1000.0 if name == "kr10" else 400.0
    hammer = Hammer(PEAK_N[name], PULSE_S * 400 / rate, rate, record_s=1024 / rate)
    return Robot(toml, f"joints_deg = {[list(r) for r in arm.joints_deg]}", arm.band_hz, hammer)


def _shipped(folder: Path, _: np.random.Generator) -> Robot:
    """The plane of the shipped campaign."""
    copytree(shipped("kr240_plane") / "robot", folder / "robot")
    table = tomllib.loads((shipped("kr240_plane") / "campaign.toml").read_text())
    text = "\n".join(f"{key} = {value}" for key, value in table["workspace"].items())
    return Robot(folder / "robot" / "robot.toml", text, (4.0, 60.0), Hammer())


def _pointed(folder: Path, _: np.random.Generator) -> Robot:
    box = [[-60, 60], [-40, 30], [20, 100], [-50, 50]]
    hammer = Hammer(250.0, 0.005, 512.0, record_s=2.0)
    toml = write_arm(folder / "robot", f'\n[[point]]\nname = "tcp"\nnode = {TCP_NODE}\n')
    return Robot(toml, f"joints_deg = {box}", (4.0, 90.0), hammer, {**NODES, "tcp": TCP_NODE})


def _drawn(folder: Path, rng: np.random.Generator) -> Robot:
    """An arm of five joints that was drawn for this campaign alone."""
    arm = generated_arms.make_generated_arm(folder, int(rng.integers(2**31)), 5, MOST_MODES)
    box = [list(r) for r in generated_arms.BOX_DEG[:5]]
    band, hammer = generated_arms.BAND_HZ, generated_arms.HAMMER
    return Robot(arm.robot_toml, f"joints_deg = {box}", band, hammer)


ROBOTS: dict[str, Callable[[Path, np.random.Generator], Robot]] = {
    "kr240 plane": _shipped,
    "kr10": lambda folder, rng: _known("kr10", folder, rng),
    "irb6640": lambda folder, rng: _known("irb6640", folder, rng),
    "arm of four": _pointed,
    "drawn arm": _drawn,
}


def lacking(kind: str, robot: Robot, rng: np.random.Generator) -> tuple[Secret, float]:
    """What the simulation lacks, beside the scatter of springs and inertias, and its size."""
    secret, size = Secret(REAL.scatter.of(int(rng.integers(2**31)))), log_uniform(rng, *SIZES)
    table = tomllib.loads(robot.toml.read_text())
    root = ElementTree.parse(robot.toml.parent / table["urdf"]).getroot()
    truth = load_truth(robot.toml, secret.deviation)
    k = np.array([s.stiffness for s in truth.springs])
    own = {name: float(truth.own(name) @ k) for name in truth.joint_names}
    damping_s = float(np.median([s.damping / s.stiffness for s in truth.springs]))
    links = _children(root, truth.joint_names)
    if kind == "soft base":
        first = own[truth.joint_names[1]] * log_uniform(rng, 0.7, 4.0) / size
        tilts = first, first * log_uniform(rng, 0.7, 1.4)
        springs = [
            Spring("base", triple(a), t, damping_s * t)
            for a, t in zip(np.eye(3)[:2], tilts, strict=True)
        ]
        secret = deviate(secret, extra=springs)
    elif kind == "bending link":
        able = [n for n, link in links.items() if np.linalg.norm(beam_end(link, root)) > BENDS_M]
        joint = str(rng.choice(able[: len(able) - 1] or able))
        first = own[joint] * log_uniform(rng, 0.4, 2.0) / size
        bending = first, first * log_uniform(rng, 0.7, 1.4)
        twist = first * log_uniform(rng, 0.5, 3.0)
        secret = deviate(secret, beams=[BentLink(links[joint], bending, twist, damping_s)])
    elif kind == "hose":
        link = str(rng.choice(list(links.values())[1:]))
        moving = _mass_that_moves(root)
        low, *_, high = truth.modes(np.mean([truth.lower_rad, truth.upper_rad], axis=0), 4)[0]
        small = AttachedResonator(
            link, triple(rng.uniform(0.3, 1.0) * beam_end(link, root)), triple(some_direction(rng)),
            size * moving * log_uniform(rng, 0.01, 0.05), log_uniform(rng, 0.9 * low, 1.1 * high),
            log_uniform(rng, 0.01, 0.05),
        )  # fmt: skip
        secret = deviate(secret, resonators=[small])
    return secret, size


def _mass_that_moves(root: ElementTree.Element) -> float:
    """Of all links but the one that stands on the floor, in kg."""
    carried = {child.get("link") for child in root.iterfind("joint/child")}
    moving = [link for link in root.findall("link") if link.get("name") in carried]
    return sum(float(m.get("value", 0)) for link in moving for m in link.iterfind("inertial/mass"))


def _children(root: ElementTree.Element, joints: tuple[str, ...]) -> dict[str, str]:
    """The link that each joint moves."""
    found = {j.get("name", ""): j.find("child") for j in root.findall("joint")}
    return {name: str(found[name].get("link")) for name in joints}  # pyright: ignore


@dataclass(frozen=True)
class Cell:
    """A robot that is hit: hands with habits of their own, a chain within its tolerances."""

    robot: Robot
    truth: Truth
    secret: Secret
    hammer: Hammer
    habits: list[Aim]
    handling: Handling
    rng: np.random.Generator

    @classmethod
    def of(cls, robot: Robot, secret: Secret, rng: np.random.Generator) -> "Cell":
        truth, handling = load_truth(robot.toml, secret.deviation), EVERYDAY
        hammer = replace(robot.hammer, noise=float(rng.uniform(0.005, 0.03)), oversampling=8)
        secret = replace(secret, chain=handling.chain(rng))
        middle = np.mean([truth.lower_rad, truth.upper_rad], axis=0)
        [quiet] = quiet_hits(
            truth, secret, [HitVisit(middle, [("+x", hammer.peak_n)])], hammer, rng
        )
        hammer = handling.floor(hammer, quiet, rng)
        return cls(robot, truth, secret, hammer, handling.common(rng), handling, rng)

    def record(self, folder: Path, pose: str, joints_deg: tuple[float, ...]) -> Path:
        """Hits at a pose where the robot was sent; the robot stands a little beside."""
        rng = self.rng
        axes = [axis for axis in range(3) for _ in range(REPEATS)]
        aims = [
            together(self.habits[axis], aim)
            for axis, aim in zip(axes, self.handling.aims(axes, rng), strict=True)
        ]
        off = np.deg2rad(self.handling.readback_deg) * rng.standard_normal(len(joints_deg))
        there = np.deg2rad(joints_deg) + off
        shots = [(f"+{AXES[axis]}", self.hammer.peak_n) for axis in axes]
        [quiet] = quiet_hits(
            self.truth, self.secret, [HitVisit(there, shots, aims=aims)], self.hammer, rng
        )
        rows = [
            (pose, np.array(joints_deg), 1 + number % REPEATS, noisy(hit, self.hammer, rng))
            for number, hit in enumerate(quiet)
        ]
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
    by_mode: tuple[float, ...]
    trust: tuple[float, ...]
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
        learned = model.low.learned or model.low.suspect
        inside, visit = (float(np.mean(np.abs(found - true) <= 1.96 * s)) for s in (sd, visit_sd))
        return cls(
            100 * float(np.sqrt(np.mean(off**2))),
            inside,
            visit,
            tuple((100 * np.sqrt(np.mean(off**2, axis=0))).tolist()),
            tuple(model.surrogate.frequency_trust.tolist()),
            learned.identified.misfit if learned else None,
        )


@dataclass(frozen=True)
class Played:
    """A campaign's scores after each pose, and those of its peer that uses no simulation."""

    robot: str
    kind: str
    seed: int
    size: float
    modes: int
    own: tuple[Score, ...]
    peer: tuple[Score, ...]
    remarks: tuple[str, ...]
    cpu_s: float


def play(name: str, kind: str, seed: int, folder: Path) -> Played:
    """One campaign by `next` and `import`, and its peer by `import` of the same recordings."""
    started = time.process_time()
    rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    rng = np.random.default_rng([seed, zlib.crc32(f"{name} {kind}".encode())])
    robot = ROBOTS[name](folder, rng)
    secret, size = lacking(kind, robot, rng)
    cell = Cell.of(robot, secret, rng)
    kept = Store(folder / "models")

    def begun(use: str, modes: int) -> Campaign:
        path = _decisions(robot, folder, use, modes)
        return Campaign(Campaign.new(path.with_suffix(""), robot.toml, path).directory, kept)

    first = np.deg2rad(begun("frozen", MOST_MODES).next()[0].joints_deg)
    hz, seen = true_modes(cell.truth, first, MOST)
    hose = kind != "hose" or bool(seen[own_of_hose(cell.truth, first, MOST)])
    modes = min(MOST_MODES, int(np.sum(seen & (hz > robot.band_hz[0]) & (hz < robot.band_hz[1]))))
    own, peer = both = begun("updated", modes), begun("none", modes)
    models: list[tuple[Model, Model]] = []
    for number in range(POSES):
        proposal = own.next()[0]
        said = cell.record(folder / f"hits{number}", proposal.pose, proposal.joints_deg)
        for campaign in both:
            campaign.import_paths((said,))
        models.append((own.model, peer.model))
    unseen = _unseen(own, rng)
    scores = [[Score.of(m, cell.truth, unseen, hose) for m in pair] for pair in models]
    return Played(
        name, kind, seed, size, modes, tuple(a for a, _ in scores), tuple(b for _, b in scores),
        models[-1][0].remarks, time.process_time() - started,
    )  # fmt: skip


def _unseen(campaign: Campaign, rng: np.random.Generator) -> np.ndarray:
    """Numbers (UNSEEN,) of candidates, which stand for the workspace, that were not measured."""
    q = campaign.cell.candidates.q
    taken = np.deg2rad([m.joints_deg for m in campaign.state.measurements.values()])
    free = np.min(np.max(np.abs(q[:, None] - taken), axis=2), axis=1) > np.deg2rad(1.0)
    return rng.permutation(np.flatnonzero(free))[:UNSEEN]


def _decisions(robot: Robot, folder: Path, simulation: str, modes: int) -> Path:
    path = folder / f"{simulation}.toml"
    path.write_text(
        f"[workspace]\n{robot.workspace}\n[modes]\ncount = {modes}\n"
        f"band_hz = {list(robot.band_hz)}\n[fidelity]\nsimulation = '{simulation}'\n"
        f"[acquisition]\ncandidates = {CANDIDATES}\n"
    )
    return path


def campaigns(folder: Path, first_seed: int, wanted: int) -> Iterator[Played]:
    """As many campaigns, robots and kinds in turn; what the folder holds is not done again."""
    names = list(ROBOTS)
    for number in range(wanted):
        name = names[number % len(names)]
        kind = KINDS[(number + number // len(names)) % len(KINDS)]
        path = folder / f"{first_seed + number}.json"
        if not path.is_file():
            played = play(name, kind, first_seed + number, folder / str(first_seed + number))
            part = path.with_suffix(".part")
            part.write_text(json.dumps(asdict(played)))
            part.replace(path)
        yield _read(path)


def _read(path: Path) -> Played:
    found = json.loads(path.read_text())
    both = {which: tuple(Score(**score) for score in found[which]) for which in ("own", "peer")}
    return Played(**{**found, **both})
