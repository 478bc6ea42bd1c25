"""Pictures in the report of a campaign: maps over the workspace, FRFs."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from planner.campaign.campaign import Campaign
from planner.recording.joints import SCALES
from planner.report.campaign_plots import frf_sheet, workspace_map

SHOWN_FRFS = 6  # poses whose FRFs are drawn: the ones furthest off, then the first
SHOWN_MAPS = 8  # modes whose maps are drawn


def map_pictures(campaign: Campaign) -> dict[str, Any]:
    """Frequencies and their sds over the workspace: pictures, and what is said of them."""
    cell, used, found = campaign.cell, campaign.state.used, campaign.model.workspace_prediction
    joints = cell.robot.joints
    q = joints.internal([m.joints_deg for m in used]).reshape(-1, len(joints.names))
    x, measured, names, flat = _coordinates(campaign, q)
    percents = 100 * found.frequency_sd_hz / found.frequency_hz
    poses, count = tuple(m.pose for m in used), found.frequency_hz.shape[1]
    drawn = [
        workspace_map(x, names, f, sd, measured, poses, k, flat)
        for k, (f, sd) in enumerate(zip(found.frequency_hz.T, percents.T, strict=True), 1)
        if k <= SHOWN_MAPS
    ]
    means = " Several poses lie at one place of the map: shown is their mean, cell by cell."
    said = f"{len(x)} reachable poses stand for the workspace.{'' if flat else means}"
    said += f" Modes above {SHOWN_MAPS} are not drawn." if count > SHOWN_MAPS else ""
    return {"maps": drawn, "maps_say": said}


def _coordinates(
    campaign: Campaign, q: np.ndarray
) -> tuple[np.ndarray, np.ndarray, tuple[str, str], bool]:
    """Two coordinates of candidates (n, 2) and of measured poses (m, 2), and their names.

    Those of the workspace where it has two; else the two directions in which the tcp moves most.
    """
    cell = campaign.cell
    candidates, space = cell.candidates, cell.workspace
    if int(space.varying.sum()) == 2:
        lower, span = space.lower[space.varying], (space.upper - space.lower)[space.varying]
        units = [name.rsplit("_", 1)[-1] for name in space.feature_names]
        scale = np.array([SCALES.get(unit, 1.0) for unit in units])
        features = cell.features(q) if len(q) else np.empty((0, 2))
        shown = [(lower + one * span) * scale for one in (candidates.features, features)]
        first, second = map(_axis_name, space.feature_names)
        return shown[0], shown[1], (first, second), True
    pair = sorted(np.argsort(-np.ptp(candidates.position_m, axis=0), kind="stable")[:2].tolist())
    measured = cell.robot.forward_batch(q)[1] if len(q) else np.empty((0, 3))
    first, second = (f"{'xyz'[k]} of the tcp (m)" for k in pair)
    return candidates.position_m[:, pair], measured[:, pair], (first, second), False


def _axis_name(name: str) -> str:
    base, _, unit = name.rpartition("_")
    return f"{base} ({'°' if unit == 'deg' else unit})" if unit != "m" else f"{base} of the tcp (m)"


def frf_pictures(campaign: Campaign, worst: Sequence[str]) -> dict[str, Any]:
    """FRFs of the model with bands over the measured ones, of the `worst` poses first."""
    used = campaign.state.used
    names = dict.fromkeys([*(p for p in worst if any(m.pose == p for m in used)),
                           *(m.pose for m in used)])  # fmt: skip
    shown = [m for m in used if m.pose in list(names)[:SHOWN_FRFS]]
    if not shown:
        return {"frfs": [], "frfs_left": 0}
    lines, modes = campaign.frequency_lines, campaign.cell.config.modes
    q = campaign.cell.robot.joints.internal([m.joints_deg for m in shown])
    mean, sd = campaign.frf_at(q, lines)
    expected = campaign.model.predict(q)
    drawn = []
    for i, m in enumerate(shown):
        frf = campaign.frf_of(m, modes)
        figure = frf_sheet(lines, mean[i], sd[i], frf, expected.frequency_hz[i])
        drawn.append((m.pose, figure, not np.any(np.isfinite(frf.coherence))))
    return {"frfs": drawn, "frfs_left": len(used) - len(shown)}
