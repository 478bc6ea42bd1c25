"""Cells whose hits miss axis and point by known amounts, recorded by the other engine."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.campaign.hit_errors import HitErrorEstimate
from planner.campaign.model import Model
from planner.proof.arms import ARMS
from planner.proof.deviation import Deviation
from planner.proof.fault_injection import InjectedFaults
from planner.proof.hits import AXES, Hammer
from planner.proof.load import load_truth
from planner.proof.measurement_errors import EVERYDAY, HitError, MeasuringChain
from planner.proof.model import Truth
from planner.proof.scene import PULSE_S
from tests.support.struck_poses import record_by_hand

SCATTER = Deviation(stiffness=0.15, damping=0.15, inertia=0.04, com_m=0.005)  # as stated ones do

HAND = replace(EVERYDAY, angle_deg=2.0, offset_m=0.005)  # beside the chain and aims of a real cell
NOISE = 0.01  # of the responses, relative to the largest
SAME = 0.01  # relative difference of frequencies below which two modes are the same


@dataclass(frozen=True, eq=False)
class MissedCell:
    """A campaign's inputs and the truth: of each pose, where it stood and how its hits missed."""

    robot_toml: Path
    campaign_toml: Path
    recordings: Path
    truth: Truth
    chain: MeasuringChain
    q: dict[str, np.ndarray]
    aims: dict[str, list[HitError]]

    def misses(self, pose: str, hits: tuple[HitErrorEstimate, ...]) -> tuple[np.ndarray, ...]:
        """Told, its sds, and true misses (n, 4) of a pose's hits, in the order of the files."""
        pairs = [(h.tilt_deg, h.offset_mm, h.tilt_sd_deg, h.offset_sd_mm) for h in hits]
        told = np.array([[*tilt, *offset] for tilt, offset, _, _ in pairs])
        sd = np.array([[*tilt, *offset] for _, _, tilt, offset in pairs])
        true = []
        for hit, aim in zip(hits, self.aims[pose], strict=True):
            axis, sign = AXES.index(hit.hit[1]), -1.0 if hit.hit[0] == "-" else 1.0
            across = [(axis + 1) % 3, (axis + 2) % 3]
            # The force of a hit along −x is minus (x + aim.direction).
            tilt = sign * np.rad2deg(aim.direction[across])
            true.append([*tilt, *(1e3 * aim.offset_m[across])])
        return told, sd, np.array(true)

    def residue_errors(self, model: Model) -> np.ndarray:
        """(m,): of each labelled mode's residues to those that exact hits would give this chain."""
        out = []
        seen = replace(self.truth, sensor_offset_m=self.chain.offset_m)
        for pose, residues in zip(model.labelled, model.seen_exactly.residue, strict=True):
            frequency, _, residue = seen.modes(self.q[pose.pose], 8)
            residue = self.chain.matrix @ residue / self.chain.force_gain
            for mode, found in zip(pose.modes, residues, strict=True):
                if mode is None:
                    continue
                k = int(np.argmin(np.abs(frequency - mode.frequency_hz)))
                if abs(frequency[k] / mode.frequency_hz - 1) < SAME:
                    off = np.linalg.norm(found - residue[k])
                    out.append(off / np.linalg.norm(residue[k]))
        return np.array(out)


def missed_cell(folder: Path, robot: str, poses: int, repeats: int, seed: int) -> MissedCell:
    """Hits along each axis, in both senses, at `poses` poses; `repeats` a pose and axis."""
    rng, noise = np.random.default_rng([seed, 24]), np.random.default_rng([seed, 25])
    arm = ARMS[robot]
    robot_toml = arm.write(folder / "robot", 1)
    deviation = replace(SCATTER, seed=seed)
    truth, hammer = load_truth(robot_toml, deviation), Hammer(arm.peak_n, PULSE_S, noise=NOISE)
    chain, common = HAND.chain(rng), HAND.common(rng)
    axes = [f"{'+-'[k % 2]}{a}" for a in AXES for k in range(repeats)]
    readback = np.round(np.rad2deg(arm.poses(poses, seed)), 4)
    hit = [(f"P{i:02d}", row) for i, row in enumerate(readback, 1)]
    injected = InjectedFaults(deviation, chain=chain)
    visits = record_by_hand(folder / "recordings", truth, injected, HAND, hit, axes, hammer, rng,
                            common=common, noise=noise)  # fmt: skip
    stood = {name: visit.q for (name, _), visit in zip(hit, visits, strict=True)}
    aimed = {name: [*visit.aims] for (name, _), visit in zip(hit, visits, strict=True)}
    campaign_toml = folder / "campaign.toml"
    campaign_toml.write_text(arm.campaign())
    return MissedCell(robot_toml, campaign_toml, folder / "recordings", truth, chain, stood, aimed)
