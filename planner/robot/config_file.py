"""robot.toml read and checked: what is wrong is said in one sentence."""

from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from planner.errors import InputError
from planner.recording.joints import JointUnits
from planner.robot.config import (
    LISTS,
    LOSS_FACTOR_BELOW,
    Compliance,
    DiagnoseTable,
    HitsTable,
    ReadbackTable,
    RobotConfig,
    SensorTable,
)
from planner.toml_file import load_toml

LARGEST_SD_PERCENT = 1000.0  # a factor of 11 either way: beyond, nothing is stated
# Of springs (N·m/rad, N/m) and dampers: 10⁷ times a heavy robot's.
LARGEST_STIFFNESS = 1e14


def load_config(path: Path) -> RobotConfig:
    """Read and check robot.toml; InputError with one sentence where it is wrong."""
    config = load_toml(path, RobotConfig, "robot.toml")
    _check(config, path)
    return with_effects(config, path)


def with_effects(config: RobotConfig, path: Path) -> RobotConfig:
    """The config as its file has it, with what its effects add; InputError where that is wrong."""
    added = {
        name: (*getattr(config, name), *(x for e in config.effects for x in getattr(e, name)))
        for name in LISTS
    }
    whole = msgspec.structs.replace(config, **added)
    _check_compliances(whole, path)
    for block in whole.resonator:
        if not min(block.mass, block.frequency_hz, block.damping_ratio) > 0:
            raise InputError(
                f"{path}: the resonator at {block.joint} needs a mass, frequency_hz and "
                f"damping_ratio above 0; correct them."
            )
    return whole


def check_sds(table: HitsTable | SensorTable | ReadbackTable | DiagnoseTable, where: str) -> None:
    """Raise InputError where an sd of a table is no number from 0 to 100."""
    for name in table.__struct_fields__:
        value = getattr(table, name)
        if value is not msgspec.UNSET and not 0 <= value <= 100:
            raise InputError(f"{where} {name} is {value}; it must lie between 0 and 100.")


def _check_percent(value: float | None, where: str) -> None:
    if value is not None and not 0 < value <= LARGEST_SD_PERCENT:
        raise InputError(
            f"{where} is {value}; it must lie above 0 and at most at {LARGEST_SD_PERCENT:g}."
        )


def _check(config: RobotConfig, path: Path) -> None:
    _check_compliances(config, path)
    _check_percent(config.stiffness_sd_percent, f"{path}: stiffness_sd_percent")
    _check_percent(config.stiffness_bias_sd_percent, f"{path}: stiffness_bias_sd_percent")
    _check_payloads(config, path)
    _check_links(config, path)
    _check_obstacles(config, path)
    check_sds(config.hits, f"{path}: [hits]")
    check_sds(config.sensor, f"{path}: [sensor]")
    check_sds(config.readback, f"{path}: [readback]")
    check_sds(config.diagnose, f"{path}: [diagnose]")
    if not 0 < config.controller.speed_percent <= 100:
        raise InputError(
            f"{path}: [controller] speed_percent is {config.controller.speed_percent}; it must lie "
            f"above 0 and at most at 100."
        )
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


def _check_compliances(config: RobotConfig, path: Path) -> None:
    first: dict[str, Compliance] = {}
    for number, block in enumerate(config.compliance, 1):
        entry = f"{path}: [[compliance]] number {number} ({block.joint})"
        k, c = ("N/m", "N·s/m") if block.slide else ("N·m/rad", "N·m·s/rad")
        if not 0 < block.stiffness <= LARGEST_STIFFNESS:
            raise InputError(
                f"{entry} has stiffness {block.stiffness}; it must be above 0 {k} and at most "
                f"{LARGEST_STIFFNESS:g} (leave out what does not give)."
            )
        if not 0 <= block.damping <= LARGEST_STIFFNESS:
            raise InputError(
                f"{entry} has damping {block.damping}; it must be 0 {c} or more, and at most "
                f"{LARGEST_STIFFNESS:g}."
            )
        length = sum(a * a for a in block.axis) ** 0.5
        if not abs(length - 1) < 1e-3:
            raise InputError(f"{entry} has an axis of length {length:.4g}; give a unit vector.")
        if not 0 <= block.loss_factor < LOSS_FACTOR_BELOW:
            raise InputError(
                f"{entry} has loss_factor {block.loss_factor}; it must be at least 0 and "
                f"below {LOSS_FACTOR_BELOW:g}."
            )
        _check_percent(block.stiffness_sd_percent, f"{entry}: stiffness_sd_percent")
        same = first.setdefault(block.tie or f"\0{number}", block)
        for key in ("stiffness", "damping", "loss_factor", "stiffness_sd_percent"):
            if getattr(same, key) != getattr(block, key):
                raise InputError(
                    f'{entry} is tied to "{block.tie}" but has another {key} '
                    f"({getattr(block, key)}, not {getattr(same, key)}); give tied blocks the same."
                )


def check_own_springs(
    config: RobotConfig, joints: JointUnits, axes: Sequence[np.ndarray], path: Path
) -> None:
    """A joint that slides gives along its axis, in N/m; InputError where it is told to turn only.

    Beside its own spring its carriage may roll about that axis.
    """
    for name, slides, axis in zip(joints.names, joints.slides, axes, strict=True):
        blocks = [b for b in config.compliance if b.joint == name and slides]
        own = [b.slide for b in blocks if abs(np.array(b.axis) @ axis) > 0.9]
        if own and not any(own):
            raise InputError(
                f"{path}: joint {name} slides, but its [[compliance]] turns about its axis, in "
                f"N·m/rad; state its own spring along that axis with stiffness_n_m (N/m) and "
                f"damping_n_s_m (N·s/m)."
            )


def _check_payloads(config: RobotConfig, path: Path) -> None:
    for number, block in enumerate(config.payload, 1):
        entry = f"{path}: [[payload]] number {number} ({block.link})"
        if not 0 < block.mass < 1e5:
            raise InputError(f"{entry} has mass {block.mass}; it must be above 0 kg.")
        if not all(abs(value) < 1e2 for value in block.com_m):
            raise InputError(f"{entry} has com_m {list(block.com_m)}; give 3 lengths in m.")
        xx, yy, zz, xy, xz, yz = block.inertia
        moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        finite = bool(np.all(np.isfinite(moments)))
        if not finite or np.linalg.eigvalsh(moments)[0] < -1e-9 * np.abs(moments).max():
            raise InputError(
                f"{entry} has inertia {list(block.inertia)}, which no body can have; give "
                f"xx, yy, zz, xy, xz, yz in kg·m² about its centre of mass."
            )


def _check_links(config: RobotConfig, path: Path) -> None:
    named = [table.link for table in config.link]
    for number, table in enumerate(config.link, 1):
        entry = f"{path}: [[link]] number {number} ({table.link})"
        if named.index(table.link) != number - 1:
            raise InputError(f"{entry} states a link that an earlier one states; keep one of them.")
        _check_percent(table.sd_percent, f"{entry}: sd_percent")
        stated = (table.mass_kg, table.centre_m, table.inertia_kg_m2)
        if all(value is None for value in stated):
            if table.sd_percent is None:
                raise InputError(f"{entry} states nothing; give mass_kg, centre_m, inertia_kg_m2.")
            continue
        if table.mass_kg is None or table.centre_m is None or table.inertia_kg_m2 is None:
            raise InputError(f"{entry} needs mass_kg, centre_m and inertia_kg_m2; give all three.")
        if not 0 < table.mass_kg < 1e5:
            raise InputError(f"{entry} has mass_kg {table.mass_kg}; it must be above 0 kg.")
        if not all(abs(value) < 1e2 for value in table.centre_m):
            raise InputError(f"{entry} has centre_m {list(table.centre_m)}; give 3 lengths in m.")
        xx, xy, xz, yy, yz, zz = table.inertia_kg_m2
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if moments[0] < 0 or moments[0] + moments[1] < moments[2] * (1 - 1e-6):
            raise InputError(
                f"{entry} has inertia_kg_m2 {list(table.inertia_kg_m2)}, which no body can have; "
                f"give xx, xy, xz, yy, yz, zz in kg·m² about its centre of mass."
            )


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
