"""Cells hit as people hit, on true robots (MuJoCo), and what a measuring chain may do wrong."""

import warnings
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyuff
from scipy.spatial.transform import Rotation

from planner.campaign.cell import Cell as CampaignCell
from planner.campaign.chain_faults import ChainFault
from planner.campaign.chain_mismatch import LOG_ODDS, HitSums, hit_sums, most_probable
from planner.campaign.config import load_campaign_config
from planner.campaign.imported_files import sort_paths
from planner.dataset.measure import MeasuredPose
from tests.support.everyday_campaigns import Cell, decisions, in_turn
from tests.support.faulty_robots import ROBOTS, lacking

FACTORS = {
    "× 1000": 1e3,
    "÷ 1000": 1e-3,
    "× 9.81": 9.81,
    "÷ 9.81": 1 / 9.81,
    "× 2": 2.0,
    "÷ 2": 0.5,
}
SLIGHTEST = "× 2", "÷ 2", "a channel × 2"
FAULTS = (*FACTORS, "a channel × 2", "turned by 90°", "swapped axes", "wrong sign", "force's sign")


@dataclass(frozen=True, eq=False)
class Struck:
    """A robot's poses in the order of measuring; `kind` is what its simulation lacks."""

    robot: str
    kind: str
    sums: tuple[HitSums, ...]


def struck(folder: Path, seed: int, poses: int) -> Struck:
    """A robot of those for everyday campaigns in turn, hit at poses of its workspace."""
    name, kind = in_turn(seed)
    rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
    robot = ROBOTS[name](folder, rng)
    injected, _ = lacking(kind, robot, rng)
    true = Cell.of(robot, injected, rng)
    config = decisions(robot, folder / "campaign.toml", 3, 30)
    cell = CampaignCell.load(robot.toml, load_campaign_config(config))
    assert cell.simulation is not None
    joints = cell.robot.joints
    found = []
    for number, q in enumerate(rng.permutation(cell.candidates.q)[:poses]):
        stated = tuple(np.round(joints.shown(q), 4).tolist())
        said = true.record(folder / f"hits{number}", f"P{number}", stated)
        [delivery] = sort_paths((said,), cell.robot, None, None)
        frf = MeasuredPose(delivery.sources, robot.band_hz).frf
        assert frf is not None
        q, frf = joints.internal(stated), frf.within(robot.band_hz)
        one = hit_sums(cell.simulation, cell.tolerances, q, frf)
        assert one is not None
        found.append(one)
    return Struck(name, kind, tuple(found))


def shown_by(sums: HitSums, matrix: np.ndarray) -> HitSums:
    """What a chain shows that is wrong by A (3, 3)."""
    noise = np.sqrt(matrix**2 @ sums.noise**2)
    return replace(sums, measured=matrix @ sums.measured, noise=noise)


def fault(name: str, rng: np.random.Generator) -> np.ndarray:
    """A (3, 3) of one of FAULTS, about some axis or of some channels."""
    one, axis = np.eye(3), int(rng.integers(3))
    if name in FACTORS:
        return FACTORS[name] * one
    if name == "a channel × 2":
        return one + np.outer(one[axis], one[axis])
    if name == "turned by 90°":
        sign = rng.choice([-1.0, 1.0])
        return np.round(Rotation.from_rotvec(sign * np.pi / 2 * one[axis]).as_matrix())
    if name == "swapped axes":
        return one[[i if i == axis else 3 - axis - i for i in range(3)]]
    return -one if name == "force's sign" else one - 2 * np.outer(one[axis], one[axis])


def judged(sums: HitSums) -> ChainFault | None:
    """What is asked about; None: nothing."""
    found, gain = most_probable(sums)
    return found if gain >= LOG_ODDS else None


def cases(folder: Path, seeds: range, poses: int) -> Iterator[Struck]:
    """Of all seeds."""
    for seed in seeds:
        (folder / str(seed)).mkdir(parents=True)
        yield struck(folder / str(seed), seed, poses)


def scaled(row, folder, factor: float):
    """The file of a row with accelerations too large by a factor."""
    path = folder / row.file.name
    sets = pyuff.UFF(str(row.file)).read_sets()
    for one in sets:
        if one["ordinate_spec_data_type"] == 12:
            one["data"] = factor * np.array(one["data"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)
        pyuff.UFF(str(path)).write_sets(sets, "add")
    return path
