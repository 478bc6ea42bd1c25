"""What all runs of a comparison share: robot, workspace, recorded poses, measured frequencies."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import msgspec
import numpy as np

from planner import content_hash
from planner.campaign.cell import Cell
from planner.campaign.config import (
    CampaignConfig,
    FidelityTable,
    ModesTable,
    WorkspaceTable,
    load_campaign_config,
)
from planner.campaign.labels import label, observations
from planner.campaign.state import Measurement
from planner.compare.pool import PoolPose
from planner.dataset.visits import Recording
from planner.errors import InputError
from planner.frf.frf import Frf
from planner.robot.robot import Robot
from planner.robot.workspace import Candidates, Workspace

OUTSIDE_TOLERANCE = 0.02  # of the workspace's size by which readback may lie beside it


@dataclass(frozen=True, eq=False)
class PoolCell(Cell):
    """A cell in which only poses that were recorded can be chosen: q (n, dof) in rad."""

    pool_q: np.ndarray

    @cached_property
    def candidates(self) -> Candidates:
        """The recorded poses, used ones too."""
        _, position = self.robot.forward_batch(self.pool_q)
        return Candidates(self.pool_q, self.features(self.pool_q), position, {})

    @property
    def spread(self) -> int:
        """All of them stand for the workspace."""
        return len(self.pool_q)


@dataclass(frozen=True, eq=False)
class Bench:
    """A pool of n poses with k labels; is pickled for other processes and machines.

    `frequency_hz` (n, k) are the measured frequencies, by which predictions are judged.
    """

    robot: Robot
    config: CampaignConfig
    measurements: tuple[Measurement, ...]
    frfs: tuple[Frf, ...]
    frequency_hz: np.ndarray
    frequency_sd_hz: np.ndarray
    program: str
    key: str

    @property
    def q(self) -> np.ndarray:
        """Readback angles (n, dof) in rad."""
        return self.robot.joints.internal([m.joints_deg for m in self.measurements])


@lru_cache(maxsize=2)
def cell_of(bench: Bench) -> PoolCell:
    """The bench's cell, made once in each process; it is not safe to share among threads."""
    loaded = Cell.load(bench.robot, bench.config)
    return PoolCell(loaded.config, loaded.robot, loaded.simulation, loaded.workspace, bench.q)


def comparison_config(
    robot: Robot,
    recordings: Sequence[Recording],
    campaign: Path | None,
    fidelity: str | None,
) -> CampaignConfig:
    """campaign.toml's decisions, or the box that the recorded poses span; `fidelity` wins."""
    if campaign is not None:
        config = load_campaign_config(campaign)
    else:
        joints_deg = robot.joints.shown([one.q for one in recordings])
        workspace = WorkspaceTable(joints_deg=_box(robot, joints_deg))
        config = CampaignConfig(workspace, modes=ModesTable(band_hz=robot.config.band_hz))
    if fidelity is None:
        return config
    table = msgspec.convert({"simulation": fidelity}, FidelityTable)
    return msgspec.structs.replace(config, fidelity=table)


def _box(robot: Robot, joints_deg: np.ndarray) -> list[tuple[float, float]]:
    low, high = joints_deg.min(axis=0), joints_deg.max(axis=0)
    still = high - low < robot.joints.same()
    middle = (low + high) / 2
    limits = robot.joints.shown([robot.lower_rad, robot.upper_rad])
    low = np.clip(np.where(still, middle, low), *limits)
    high = np.clip(np.where(still, middle, high), *limits)
    return [(float(a), float(b)) for a, b in zip(low, high, strict=True)]


def assemble(
    robot: Robot, config: CampaignConfig, poses: Sequence[PoolPose]
) -> tuple[Bench, tuple[str, ...]]:
    """The bench, and remarks on poses that were left out.

    Modes are labelled over the whole pool, guided by the simulation as robot.toml states it, so
    that all strategies and all ways to use the simulation are judged by the same frequencies.
    """
    nominal = msgspec.structs.replace(config, fidelity=FidelityTable("frozen"))
    cell = Cell.load(robot, nominal)
    usable, remarks = _usable(robot, cell.workspace, poses)
    measured = tuple(pose.measurement for pose in usable)
    seen = observations(cell, label(cell, measured))
    names = content_hash.of([(m.pose, m.joints_deg, m.modes) for m in measured])
    numbers = [np.ascontiguousarray(pose.frf.accelerance) for pose in usable if pose.frf]
    key = content_hash.digest(
        content_hash.of(config), content_hash.of(robot.config), robot.urdf_text, names,
        *(a.tobytes() for a in numbers),
    )  # fmt: skip
    bench = Bench(
        replace(robot), config, measured, tuple(pose.frf for pose in usable if pose.frf),
        seen.frequency_hz, seen.frequency_sd_hz, content_hash.program(), key,
    )  # fmt: skip
    return bench, remarks


def _usable(
    robot: Robot, workspace: Workspace, poses: Sequence[PoolPose]
) -> tuple[list[PoolPose], tuple[str, ...]]:
    """Poses with modes inside the workspace, and why the others are left out."""
    remarks = [f"Pose {p.measurement.pose} is left out: {p.reason}" for p in poses if p.reason]
    found = [p for p in poses if not p.reason]
    if not found:
        raise InputError(f"No recorded pose gives a mode: {remarks[0]}")
    x = workspace.features(robot, robot.joints.internal([p.measurement.joints_deg for p in found]))
    if not x.shape[1]:
        raise InputError(
            "All poses of the workspace are the same, so there is nothing to choose; record more."
        )
    inside = np.all((x > -OUTSIDE_TOLERANCE) & (x < 1 + OUTSIDE_TOLERANCE), axis=1)
    if not inside.all():
        away = [p.measurement.pose for p, near in zip(found, inside, strict=True) if not near]
        remarks.append(
            f"{len(away)} of {len(found)} poses lie outside the workspace and are left out: "
            f"{', '.join(away[:6])}{', …' if len(away) > 6 else ''}."
        )
    return [p for p, near in zip(found, inside, strict=True) if near], tuple(remarks)
