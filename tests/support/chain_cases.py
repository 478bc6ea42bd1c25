"""What a measuring chain may do wrong to the hits of a true robot."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyuff
from scipy.spatial.transform import Rotation

from planner.campaign.chain_faults import ChainFault
from planner.campaign.chain_mismatch import LOG_ODDS, HitSums, hit_sums, most_probable
from planner.export.uff import write_sets
from tests.support.case_campaigns import CaseCampaign

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


def sums_of(campaign: CaseCampaign, poses: int) -> list[HitSums]:
    """Of the first poses of a case, whose chain is right."""
    found = []
    for q, pose in zip(campaign.case.q[:poses], campaign.case.measured, strict=False):
        assert campaign.cell.simulation is not None
        frf = pose.frf.within(campaign.case.band_hz)
        one = hit_sums(campaign.cell.simulation, campaign.cell.tolerances, q, frf)
        assert one is not None
        found.append(one)
    return found


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


def scaled(file: Path, folder: Path, factor: float) -> Path:
    """A copy of a hit's file with accelerations too large by a factor."""
    folder.mkdir(parents=True, exist_ok=True)
    sets = pyuff.UFF(str(file)).read_sets()
    for one in sets:
        if one["ordinate_spec_data_type"] == 12:
            one["data"] = factor * np.array(one["data"])
    write_sets(folder / file.name, sets)
    return folder / file.name
