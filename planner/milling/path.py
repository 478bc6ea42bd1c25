"""A cut at one pose (its margin, and on which modes it hangs) and along a path of poses."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np
from scipy.stats import norm

from planner.milling.cut import Cut
from planner.milling.lobes import StabilityLimit, depths_of, sampled_limits, stability_limits
from planner.milling.machine import Machine, multipliers
from planner.milling.structure import Structure, moved
from planner.progress import ProgressCallback, no_progress, part_of

TURNS_DEG = np.arange(0.0, 360.0, 15.0)  # of the feed about the tool's axis that are tried


@dataclass(frozen=True, eq=False)
class PathLimits:
    """Of p poses at n speeds: first losses, and depths (p, n) in m that are stable at 95 %.

    inf where nothing is lost up to the largest depth. `known` (p, n): whether samples agree.
    """

    names: tuple[str, ...]
    found: tuple[tuple[StabilityLimit, ...], ...]
    robust_m: np.ndarray
    known: np.ndarray

    @property
    def depth_m(self) -> np.ndarray:
        """(p, n) first losses, inf where there is none."""
        return np.array([depths_of(row) for row in self.found])

    @property
    def tightest(self) -> np.ndarray:
        """(n,) number of the pose that allows the least at each speed."""
        return np.argmin(self.robust_m, axis=0)

    @property
    def best_speed(self) -> int:
        """Number of the speed at which the path's tightest pose allows the most."""
        return int(np.argmax(np.min(self.robust_m, axis=0)))


def limits_along(
    poses: Sequence[tuple[str, Structure]],
    cut: Cut,
    samples: int,
    progress: ProgressCallback = no_progress,
) -> PathLimits:
    """Limits at every pose, with so many samples of what is uncertain (0: as if it were known)."""
    found, robust, known = [], [], []
    for i, (_, structure) in enumerate(poses):
        part = part_of(progress, i / len(poses), (i + 1) / len(poses))
        own = stability_limits(structure.machine(cut))
        drawn = structure.samples(cut, samples)
        depth = depths_of(own)
        limits = sampled_limits(drawn, own, part) if drawn else None
        robust.append(depth if limits is None else limits.robust())
        known.append(depth > 0 if limits is None else ~limits.open(depth))
        found.append(own)
        part("poses", 1.0)
    names = tuple(name for name, _ in poses)
    return PathLimits(names, tuple(found), np.array(robust), np.array(known))


def best_speed_of(
    poses: Sequence[tuple[str, Structure]],
    cut: Cut,
    most: int,
    progress: ProgressCallback = no_progress,
) -> float:
    """Of at most so many of the cut's speeds that in rpm at which the tightest pose allows most."""
    low, high, count = cut.spindle_rpm
    fewer = msgspec.structs.replace(cut, spindle_rpm=(low, high, min(count, most)))
    return float(fewer.speeds_rpm[limits_along(poses, fewer, 0, progress).best_speed])


def limits_by_feed(poses: Sequence[tuple[str, Structure]], cut: Cut, rpm: float) -> np.ndarray:
    """(TURNS_DEG,) depth in m that all poses allow at a speed if the feed is turned.

    About the tool's axis, from the feed towards axis × feed; inf where nothing is lost.
    """
    machines = [structure.machine(cut) for _, structure in poses]
    turns = np.deg2rad(TURNS_DEG)
    both = zip(np.cos(turns), np.sin(turns), strict=True)
    planes = [np.array([[c, s], [-s, c]]) for c, s in both]
    return np.array([
        min(limit_at(replace(m, modes=m.modes.in_plane(plane)), rpm) for m in machines)
        for plane in planes
    ])  # fmt: skip


def limit_at(machine: Machine, rpm: float) -> float:
    """Depth in m that is stable at a speed in rpm, inf where nothing is lost."""
    (loss,) = stability_limits(replace(machine, cut=machine.cut.at_speed(rpm)))
    return float(loss.depth_m)


SAMPLES = 40
STEP = 1e-3  # relative, of a frequency, for slopes


@dataclass(frozen=True, eq=False)
class PoseDecision:
    """Margin −log |µ| at the wanted point, above 0 where stable, and its sd.

    `frequency_hz` (m,) of the modes, `slope` (m,) how the margin changes per relative change of
    each frequency.
    """

    margin: float
    sd: float
    frequency_hz: np.ndarray
    slope: np.ndarray

    @property
    def probability(self) -> float:
        """Of being stable."""
        return float(norm.cdf(self.margin / self.sd))


def decide(structure: Structure, cut: Cut, rpm: float, depth_m: float) -> PoseDecision:
    """At a speed in rpm and a depth in m, by full discretisation and samples."""
    machine = structure.machine(cut)
    margin = _margin(machine, rpm, depth_m)
    found = [_margin(m, rpm, depth_m) for m in structure.samples(cut, SAMPLES)]
    # About the margin of what is expected: samples are not centred where it bends.
    sd = float(np.sqrt(np.mean((np.array(found) - margin) ** 2))) if found else 0.0
    poles = np.unique(machine.modes.poles)
    ways = STEP * np.eye(len(poles), 3 * len(poles) + 1)
    shifted = (Machine(moved(machine.modes, by), cut) for by in ways)
    slope = np.array([(_margin(one, rpm, depth_m) - margin) / STEP for one in shifted])
    # Least sd of log |µ|: where nothing is uncertain
    return PoseDecision(margin, max(sd, 1e-6), np.abs(poles) / (2 * np.pi), slope)


def _margin(machine: Machine, rpm: float, depth_m: float) -> float:
    found = multipliers(machine.monodromies(rpm)(np.array([depth_m])))[0]
    return -float(np.log(np.abs(found)))
