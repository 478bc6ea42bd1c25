"""campaign.toml: what the engineer decided (contract section 3)."""

from pathlib import Path
from typing import Any, Literal

import msgspec

from planner.errors import InputError
from planner.tomlfile import load_toml


class WorkspaceTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where the model has to be good: a joint box, or positions with a tool axis."""

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
    """How the next pose is chosen, and from how many candidates in the workspace."""

    name: str = "integrated_variance"
    candidates: int = 500


class FidelityTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the simulation is used for.

    "updated": it is identified again from the recordings as they come; "frozen": it stays as
    robot.toml states it; "none": it is not used.
    """

    simulation: Literal["updated", "frozen", "none"] = "updated"


class StopTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """When the campaign may end: predicted frequency sd (mean over the workspace, %)."""

    frequency_sd_percent: float = 1.0
    measurements_min: int = 3
    measurements_max: int = 30


class CampaignConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole of campaign.toml."""

    workspace: WorkspaceTable
    robot: str = "robot/robot.toml"
    modes: ModesTable = ModesTable()
    acquisition: AcquisitionTable = AcquisitionTable()
    fidelity: FidelityTable = FidelityTable()
    stop: StopTable = StopTable()


def load_campaign_config(path: Path) -> CampaignConfig:
    """Read and check campaign.toml; InputError with one sentence where it is wrong."""
    config = load_toml(path, CampaignConfig, "campaign.toml")
    _check(config, path)
    return config


def config_from_builtins(data: Any) -> CampaignConfig:
    """The configuration as it stands in the log."""
    return msgspec.convert(data, type=CampaignConfig)


def _check(config: CampaignConfig, path: Path) -> None:
    w, low_high = config.workspace, [config.modes.band_hz]
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
    low_high += w.joints_deg or w.position_m or []
    low_high += [w.rotation_deg] if w.rotation_deg else []
    for low, high in low_high:
        if not (abs(low) < 1e6 and abs(high) < 1e6 and low <= high):
            raise InputError(f"{path}: range [{low}, {high}] must be finite, lower bound first.")
    band = config.modes.band_hz
    if not 0 < band[0] < band[1]:
        raise InputError(f"{path}: [modes] band_hz {list(band)} must rise from above 0 Hz.")
    limits = [
        ("[modes] count", config.modes.count, 1, 20),
        ("[modes] window_rate_1_s", config.modes.window_rate_1_s, 0.0, 1000.0),
        ("[acquisition] candidates", config.acquisition.candidates, 10, 20_000),
        ("[stop] measurements_max", config.stop.measurements_max, 1, 1000),
    ]
    for name, value, low, high in limits:
        if not low <= value <= high:
            raise InputError(f"{path}: {name} is {value}; it must lie between {low} and {high}.")
