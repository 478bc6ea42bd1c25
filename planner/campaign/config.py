"""campaign.toml: what the engineer decided, as typed tables."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from planner.errors import InputError
from planner.robot.config import (
    DiagnoseTable,
    HitsTable,
    ReadbackTable,
    SensorTable,
    WorkspaceTable,
)
from planner.toml_file import limited, load_toml

Minutes = Annotated[float, limited(ge=1e-3, le=1e3)]


class ModesTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Which modes: how many from the lowest, within which band (Hz).

    `window_rate_1_s` is that of the analyser's exponential window on all channels, 0 for none.
    """

    count: Annotated[int, limited(ge=1, le=20)] = 4
    band_hz: tuple[float, float] = (4.0, 60.0)
    window_rate_1_s: Annotated[float, limited(ge=0, le=1000)] = 0.0


class AcquisitionTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the next pose is chosen, and from how many candidates in the workspace.

    `mode_weights`: how much each mode counts (none: all alike). `own_poses_deg`: poses of the
    engineer's, offered besides the candidates, or `own_only`. `singularity_margin`: least singular
    value of the tcp's Jacobian, its linear part over the reach, of a pose that is offered.
    `hammer_height_m`: heights of the tcp that the hammer reaches. `hit_axes`: "all", as FRFs
    need, or the "best" ones per minute, as frequencies need.
    """

    name: str = "integrated_variance"
    candidates: Annotated[int, limited(ge=10, le=20_000)] = 500
    mode_weights: list[float] | None = None
    own_poses_deg: list[list[float]] | None = None
    own_only: bool = False
    singularity_margin: Annotated[float, limited(ge=0, le=1)] = 0.0
    hammer_height_m: tuple[float, float] | None = None
    hit_axes: Literal["all", "best"] = "all"


class ForbiddenTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where no pose is offered: a box of tcp positions, or of joint angles."""

    position_m: list[tuple[float, float]] | None = None
    joints_deg: list[tuple[float, float]] | None = None


class GoalTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What acquisition "goal" is to know best: poses (as of a milling path), modes in a band."""

    joints_deg: list[list[float]] | None = None
    band_hz: tuple[float, float] | None = None


class CostTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What measuring takes: the share of the URDF's joint speeds at which the robot travels.

    `minutes_per_sensor` is what putting up one more sensor takes, cable and check included.
    """

    speed_share: Annotated[float, limited(ge=1e-3, le=1)] = 0.1
    minutes_per_pose: Annotated[float, limited(ge=0, le=1e3)] = 1.0
    minutes_per_hit: Minutes = 0.25
    hits_per_axis: Annotated[int, limited(ge=1, le=100)] = 4
    minutes_per_sensor: Minutes = 3.0


class FidelityTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the simulation is used for.

    "updated": it is identified again from the recordings as they come; "frozen": it stays as
    robot.toml states it; "none": it is not used.
    """

    simulation: Literal["updated", "frozen", "none"] = "updated"


class SurrogateTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Which `model` predicts natural frequencies between measured poses, and its GPs' `kernel`.

    A kernel (bias, linear, quadratic, cubic, rbf or matern52) is that of the damping ratios too;
    without one it is matern52, and for damping what the measurements choose.
    """

    model: str = "default"
    kernel: str | None = None


class StopTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """When the campaign may end: frequency RMSE over the workspace (%), with a `probability`."""

    frequency_sd_percent: Annotated[float, limited(ge=1e-6, le=100)] = 1.0
    probability: Annotated[float, limited(ge=0.5, le=0.999)] = 0.95
    measurements_min: Annotated[int, limited(ge=0, le=1000)] = 3
    measurements_max: Annotated[int, limited(ge=1, le=1000)] = 30


class CutTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What acquisition "stability" decides: whether a cut is stable at a speed and a depth.

    `file` is a cut.toml beside robot.toml, `joints_deg` the poses of the milling path (none: the
    workspace).
    """

    speed_rpm: Annotated[float, limited(ge=1, le=1e6)]
    depth_m: Annotated[float, limited(ge=1e-9, le=1)]
    file: str = "cut.toml"
    joints_deg: list[list[float]] | None = None


class CampaignConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole of campaign.toml; tables that robot.toml has too go before its own."""

    workspace: WorkspaceTable
    robot: str = "robot/robot.toml"
    modes: ModesTable = ModesTable()
    acquisition: AcquisitionTable = AcquisitionTable()
    fidelity: FidelityTable = FidelityTable()
    surrogate: SurrogateTable = SurrogateTable()
    stop: StopTable = StopTable()
    goal: GoalTable = GoalTable()
    cost: CostTable = CostTable()
    forbidden: list[ForbiddenTable] = []
    hits: HitsTable | msgspec.UnsetType = msgspec.UNSET
    sensor: SensorTable | msgspec.UnsetType = msgspec.UNSET
    readback: ReadbackTable | msgspec.UnsetType = msgspec.UNSET
    diagnose: DiagnoseTable | msgspec.UnsetType = msgspec.UNSET
    cut: CutTable | msgspec.UnsetType = msgspec.UNSET

    def of_the_cell(self) -> dict[str, HitsTable | SensorTable | ReadbackTable | DiagnoseTable]:
        """Tables that are given here and go before those of robot.toml, by name."""
        found = {name: getattr(self, name) for name in ("hits", "sensor", "readback", "diagnose")}
        return {name: table for name, table in found.items() if table is not msgspec.UNSET}


def load_campaign_config(path: Path) -> CampaignConfig:
    """Read and check campaign.toml; InputError with one sentence where it is wrong."""
    config = load_toml(path, CampaignConfig, "campaign.toml")
    check_config(config, path)
    return config


def check_config(config: CampaignConfig, path: Path) -> None:
    """InputError where entries make no sense by themselves; `path` is named there."""
    for text in _wrong(config):
        raise InputError(f"{path}: {text}")


RISING = "[acquisition] hammer_height_m", "[goal] band_hz"  # ranges that are no single value


def _value(config: CampaignConfig, entry: str) -> Any:
    """Of an entry, "[modes] count"; None where its table is not there."""
    table, name = entry.removeprefix("[").split("] ")
    return getattr(getattr(config, table), name, None)


def _wrong(config: CampaignConfig) -> Iterator[str]:
    """What makes no sense, a sentence each; later ones rely on what earlier ones ask for."""
    yield from _of_workspace(config.workspace)
    for name, (low, high) in _ranges(config):
        if not (abs(low) < 1e6 and abs(high) < 1e6 and low <= high):
            yield f"{name} is [{low:g}, {high:g}]; give finite numbers, the lower one first."
    band = config.modes.band_hz
    if not 0 < band[0] < band[1]:
        yield f"[modes] band_hz {list(band)} must rise from above 0 Hz."
    yield from _of_choices(config)


def _of_workspace(w: WorkspaceTable) -> Iterator[str]:
    if (w.joints_deg is None) == (w.position_m is None):
        yield "[workspace] needs either joints_deg or position_m; give exactly one of them."
    if w.joints_deg is not None and (w.tool_axis or w.rotation_deg):
        yield "[workspace] tool_axis and rotation_deg belong to position_m; remove them."
    if w.position_m is not None and (len(w.position_m) != 3 or w.tool_axis is None):
        yield "[workspace] position_m needs ranges of x, y, z and a tool_axis; add them."


def _ranges(config: CampaignConfig) -> Iterator[tuple[str, tuple[float, float]]]:
    """Every range: its entry, with its number where there are several, lower and upper bound."""
    yield "[modes] band_hz", config.modes.band_hz
    for table, zone in (
        ("[workspace]", config.workspace),
        *(("[[forbidden]]", zone) for zone in config.forbidden),
    ):
        for name in ("joints_deg", "position_m"):
            for k, one in enumerate(getattr(zone, name) or (), 1):
                yield f"{table} {name}, range {k}", one
    for name in ("[workspace] rotation_deg", *RISING):
        if range_ := _value(config, name):
            yield name, range_


def _of_choices(config: CampaignConfig) -> Iterator[str]:
    chosen, count = config.acquisition, config.modes.count
    weights = chosen.mode_weights
    if weights is not None and (len(weights) != count or min(weights) < 0 or not sum(weights) > 0):
        yield (
            f"[acquisition] mode_weights needs {count} numbers from 0 up, not all of them 0; "
            f"correct it."
        )
    for name, poses in (
        ("[acquisition] own_poses_deg", chosen.own_poses_deg),
        ("[goal] joints_deg", config.goal.joints_deg),
    ):
        if poses is not None and (not poses or len({len(pose) for pose in poses}) != 1):
            yield f"{name} needs one list of joint angles a pose; correct it."
    for name in RISING:
        range_ = _value(config, name)
        if range_ is not None and not range_[0] < range_[1]:
            yield f"{name} {list(range_)} must rise; correct it."
    if chosen.own_only and not chosen.own_poses_deg:
        yield "[acquisition] own_only needs own_poses_deg; add them."
    if not config.cut and chosen.name == "stability":
        yield 'acquisition "stability" needs [cut] with speed_rpm and depth_m; add it.'
    if config.cut and config.cut.joints_deg is not None and not config.cut.joints_deg:
        yield "[cut] joints_deg names no pose; add some, or leave it out."
    for zone in config.forbidden:
        if (zone.position_m is None) == (zone.joints_deg is None):
            yield "[[forbidden]] needs either position_m or joints_deg; give one of them."
        if zone.position_m is not None and len(zone.position_m) != 3:
            yield "[[forbidden]] position_m needs ranges of x, y, z."
