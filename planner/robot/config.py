"""robot.toml: what URDF cannot say (contract section 1)."""

from pathlib import Path

import msgspec

from planner.errors import InputError
from planner.tomlfile import load_toml


class Compliance(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One elastic rotation: axis in the joint's child frame, N·m/rad, N·m·s/rad."""

    joint: str
    axis: tuple[float, float, float]
    stiffness: float
    damping: float


class Obstacle(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A box fixed to the world: floor, table, fence."""

    name: str
    center_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    rpy_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)


class CollisionTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Pairs of links (or link and obstacle) that may touch, and the distance to keep."""

    ignore: tuple[tuple[str, str], ...] = ()
    margin_m: float = 0.0


class RobotConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole of robot.toml."""

    name: str
    urdf: str
    tcp_frame: str
    sensor_frame: str
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    band_hz: tuple[float, float] = (4.0, 90.0)
    compliance: tuple[Compliance, ...] = ()
    obstacle: tuple[Obstacle, ...] = ()
    collision: CollisionTable = CollisionTable()


def load_config(path: Path) -> RobotConfig:
    """Read and check robot.toml; InputError with one sentence where it is wrong."""
    config = load_toml(path, RobotConfig, "robot.toml")
    _check(config, path)
    return config


def _check(config: RobotConfig, path: Path) -> None:
    for number, block in enumerate(config.compliance, 1):
        entry = f"{path}: [[compliance]] number {number} ({block.joint})"
        if not 0 < block.stiffness < float("inf"):
            raise InputError(
                f"{entry} has stiffness {block.stiffness}; it must be above 0 N·m/rad."
            )
        if not 0 <= block.damping < float("inf"):
            raise InputError(
                f"{entry} has damping {block.damping}; it must be 0 N·m·s/rad or more."
            )
        length = sum(a * a for a in block.axis) ** 0.5
        if not abs(length - 1) < 1e-3:
            raise InputError(f"{entry} has an axis of length {length:.4g}; give a unit vector.")
    _check_obstacles(config, path)
    margin = config.collision.margin_m
    if not 0 <= margin < 1:
        raise InputError(
            f"{path}: [collision] margin_m is {margin}; it must be at least 0 m and below 1 m."
        )
    low, high = config.band_hz
    if not 0 < low < high < float("inf"):
        raise InputError(f"{path}: band_hz {[low, high]} must rise from above 0 Hz; correct it.")
    if not all(abs(g) < 100 for g in config.gravity):
        raise InputError(f"{path}: gravity {list(config.gravity)} is not in m/s²; correct it.")


def _check_obstacles(config: RobotConfig, path: Path) -> None:
    names = [block.name for block in config.obstacle]
    for number, block in enumerate(config.obstacle, 1):
        if names.index(block.name) != number - 1:
            raise InputError(
                f'{path}: [[obstacle]] number {number} is named "{block.name}" like an earlier '
                f"one; give every obstacle a name of its own."
            )
        if not all(0 < size < 1e4 for size in block.size_m):
            raise InputError(
                f"{path}: [[obstacle]] {block.name} has sizes {list(block.size_m)}; "
                f"give three lengths above 0 m."
            )
        if not all(abs(value) < 1e4 for value in (*block.center_m, *block.rpy_deg)):
            raise InputError(
                f"{path}: [[obstacle]] {block.name} has center_m {list(block.center_m)} and "
                f"rpy_deg {list(block.rpy_deg)}; give finite numbers."
            )
