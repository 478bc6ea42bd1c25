"""campaign.toml: what the engineer decided, as typed tables."""

from pathlib import Path
from typing import Any, Literal

import msgspec

from planner.errors import InputError
from planner.robot.config import DiagnoseTable, HitsTable, ReadbackTable, SensorTable
from planner.robot.config_file import check_sds
from planner.toml_file import load_toml


class WorkspaceTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where the model has to be good: a joint box, or positions with a tool axis.

    In `joints_deg`, here and elsewhere, the numbers of joints that slide are millimetres.
    """

    joints_deg: list[tuple[float, float]] | None = None
    position_m: list[tuple[float, float]] | None = None
    tool_axis: tuple[float, float, float] | None = None
    rotation_deg: tuple[float, float] | None = None


class ModesTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Which modes: how many from the lowest, within which band (Hz).

    `window_rate_1_s` is that of the analyser's exponential window on all channels, 0 for none.
    """

    count: int = 4
    band_hz: tuple[float, float] = (4.0, 60.0)
    window_rate_1_s: float = 0.0


class AcquisitionTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the next pose is chosen, and from how many candidates in the workspace.

    `mode_weights`: how much each mode counts (none: all alike). `own_poses_deg`: poses of the
    engineer's, offered besides the candidates, or `own_only`. `singularity_margin`: least singular
    value of the tcp's Jacobian, its linear part over the reach, of a pose that is offered.
    `hammer_height_m`: heights of the tcp that the hammer reaches. `hit_axes`: "all", as FRFs
    need, or the "best" ones per minute, as frequencies need.
    """

    name: str = "integrated_variance"
    candidates: int = 500
    mode_weights: list[float] | None = None
    own_poses_deg: list[list[float]] | None = None
    own_only: bool = False
    singularity_margin: float = 0.0
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

    speed_share: float = 0.1
    minutes_per_pose: float = 1.0
    minutes_per_hit: float = 0.25
    hits_per_axis: int = 4
    minutes_per_sensor: float = 3.0


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

    frequency_sd_percent: float = 1.0
    probability: float = 0.95
    measurements_min: int = 3
    measurements_max: int = 30


class CutTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What acquisition "stability" decides: whether a cut is stable at a speed and a depth.

    `file` is a cut.toml beside robot.toml, `joints_deg` the poses of the milling path (none: the
    workspace).
    """

    speed_rpm: float
    depth_m: float
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


def config_from_builtins(data: Any) -> CampaignConfig:
    """The configuration as it stands in the log; InputError where it cannot be one."""
    try:
        return msgspec.convert(data, type=CampaignConfig)
    except msgspec.ValidationError as error:
        raise InputError(
            f"The log holds a configuration that no campaign.toml can state ({error}); start the "
            f"campaign again with planner new, and import its recordings."
        ) from None


def check_config(config: CampaignConfig, path: Path) -> None:
    """InputError where entries make no sense by themselves; `path` is named there."""
    w = config.workspace
    if (w.joints_deg is None) == (w.position_m is None):
        raise InputError(
            f"{path}: [workspace] needs either joints_deg or position_m; give exactly one of them."
        )
    if w.joints_deg is not None and (w.tool_axis or w.rotation_deg):
        raise InputError(
            f"{path}: [workspace] tool_axis and rotation_deg belong to position_m; remove them."
        )
    if w.position_m is not None and (len(w.position_m) != 3 or w.tool_axis is None):
        raise InputError(
            f"{path}: [workspace] position_m needs ranges of x, y, z and a tool_axis; add them."
        )
    for name, number, (low, high) in _ranges(config):
        if not (abs(low) < 1e6 and abs(high) < 1e6 and low <= high):
            which = f", range {number}" if number else ""
            raise InputError(
                f"{path}: {name}{which} is [{low:g}, {high:g}]; give finite numbers, the lower "
                f"one first."
            )
    band = config.modes.band_hz
    if not 0 < band[0] < band[1]:
        raise InputError(f"{path}: [modes] band_hz {list(band)} must rise from above 0 Hz.")
    _check_choices(config, path)
    for name, table in config.of_the_cell().items():
        check_sds(table, f"{path}: [{name}]")
    limits = [
        ("[cost] speed_share", config.cost.speed_share, 1e-3, 1.0),
        ("[cost] minutes_per_pose", config.cost.minutes_per_pose, 0.0, 1e3),
        ("[cost] minutes_per_hit", config.cost.minutes_per_hit, 1e-3, 1e3),
        ("[cost] hits_per_axis", config.cost.hits_per_axis, 1, 100),
        ("[cost] minutes_per_sensor", config.cost.minutes_per_sensor, 1e-3, 1e3),
        ("[stop] probability", config.stop.probability, 0.5, 0.999),
        ("[modes] count", config.modes.count, 1, 20),
        ("[modes] window_rate_1_s", config.modes.window_rate_1_s, 0.0, 1000.0),
        ("[acquisition] candidates", config.acquisition.candidates, 10, 20_000),
        ("[stop] frequency_sd_percent", config.stop.frequency_sd_percent, 1e-6, 100.0),
        ("[stop] measurements_min", config.stop.measurements_min, 0, 1000),
        ("[stop] measurements_max", config.stop.measurements_max, 1, 1000),
        ("[acquisition] singularity_margin", config.acquisition.singularity_margin, 0.0, 1.0),
    ]
    for name, value, low, high in limits:
        if not low <= value <= high:
            raise InputError(f"{path}: {name} is {value}; it must lie between {low} and {high}.")


def _ranges(config: CampaignConfig) -> list[tuple[str, int, tuple[float, float]]]:
    """Every range: its entry, its number there (0: it is the only one), lower and upper bound."""
    w, found = config.workspace, [("[modes] band_hz", 0, config.modes.band_hz)]
    several = [
        ("[workspace] joints_deg", w.joints_deg), ("[workspace] position_m", w.position_m),
        *(("[[forbidden]] position_m", zone.position_m) for zone in config.forbidden),
        *(("[[forbidden]] joints_deg", zone.joints_deg) for zone in config.forbidden),
    ]  # fmt: skip
    for name, ranges in several:
        found += [(name, number, one) for number, one in enumerate(ranges or (), 1)]
    for name, one in (
        ("[workspace] rotation_deg", w.rotation_deg),
        ("[acquisition] hammer_height_m", config.acquisition.hammer_height_m),
        ("[goal] band_hz", config.goal.band_hz),
    ):
        found += [(name, 0, one)] if one else []
    return found


def _check_choices(config: CampaignConfig, path: Path) -> None:
    weights, count = config.acquisition.mode_weights, config.modes.count
    if weights is not None and (len(weights) != count or min(weights) < 0 or not sum(weights) > 0):
        raise InputError(
            f"{path}: [acquisition] mode_weights needs {count} numbers from 0 up, not all of them "
            f"0; correct it."
        )
    for name, poses in (
        ("[acquisition] own_poses_deg", config.acquisition.own_poses_deg),
        ("[goal] joints_deg", config.goal.joints_deg),
    ):
        if poses is not None and (not poses or len({len(pose) for pose in poses}) != 1):
            raise InputError(f"{path}: {name} needs one list of joint angles a pose; correct it.")
    height, band = config.acquisition.hammer_height_m, config.goal.band_hz
    for name, range_ in (("[acquisition] hammer_height_m", height), ("[goal] band_hz", band)):
        if range_ is not None and not range_[0] < range_[1]:
            raise InputError(f"{path}: {name} {list(range_)} must rise; correct it.")
    if config.acquisition.own_only and not config.acquisition.own_poses_deg:
        raise InputError(f"{path}: [acquisition] own_only needs own_poses_deg; add them.")
    _check_cut(config, path)
    for zone in config.forbidden:
        if (zone.position_m is None) == (zone.joints_deg is None):
            raise InputError(
                f"{path}: [[forbidden]] needs either position_m or joints_deg; give one of them."
            )
        if zone.position_m is not None and len(zone.position_m) != 3:
            raise InputError(f"{path}: [[forbidden]] position_m needs ranges of x, y, z.")


def _check_cut(config: CampaignConfig, path: Path) -> None:
    cut = config.cut
    if cut is msgspec.UNSET:
        if config.acquisition.name == "stability":
            raise InputError(
                f'{path}: acquisition "stability" needs [cut] with speed_rpm and depth_m; add it.'
            )
        return
    for name, value, low, high in (
        ("speed_rpm", cut.speed_rpm, 1.0, 1e6),
        ("depth_m", cut.depth_m, 1e-9, 1.0),
    ):
        if not low <= value <= high:
            raise InputError(f"{path}: [cut] {name} is {value}; give {low:g} to {high:g}.")
    if cut.joints_deg is not None and not cut.joints_deg:
        raise InputError(f"{path}: [cut] joints_deg names no pose; add some, or leave it out.")
