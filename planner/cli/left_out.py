"""What the model would have said of each measured pose without it, as plain values and picture."""

from typing import Any

import numpy as np

from planner.campaign.campaign import Campaign
from planner.campaign.labels import frequencies
from planner.campaign.model import Model
from planner.report.plot_files import Pictures
from planner.surrogate.leave_one_out import LEVELS, LeaveOneOut, leave_one_out, report


def left_out(campaign: Campaign, pictures: Pictures) -> dict[str, Any]:
    """Part of the answer of `status`: coverage, every value left out, and where pictures are."""
    model = campaign.model
    found = _found(model)
    poses = tuple(pose.pose for pose in model.labelled)
    modes = tuple(f"the frequency of mode {k + 1}" for k in range(model.surrogate.count))
    values, shares = int(np.isfinite(found.rank).sum()), found.coverage().tolist()
    answer = {
        "leave_one_out": {
            "values": values,
            "coverage": dict(zip(map(str, LEVELS), shares, strict=True)) if values else None,
            "worst": [poses[i] for i in found.worst()] if values else [],
            "frequencies": _rows(found, poses, frequencies(model.labelled)) if values else [],
            "text": report(found, poses, modes),
        }
    }
    if not pictures.wanted or not values:
        return {**answer, "plots": [], "rrd": None}
    from planner.report.leave_one_out_plots import left_out_figure

    simulated = any(m.simulated for m in campaign.state.recorded)
    mark = "SIMULATED recordings · " if simulated else ""
    figure = left_out_figure(found, poses, f"{mark}Each measured pose, predicted without it")
    return {**answer, **pictures.write({"leave_one_out": figure}, campaign.directory.name)}


def _found(model: Model) -> LeaveOneOut:
    """Of ln f (n, k), by the likelier of the two models of each mode."""
    return leave_one_out(model.surrogate.primary.posterior, len(model.labelled))


def _rows(
    found: LeaveOneOut, poses: tuple[str, ...], measured_hz: np.ndarray
) -> list[dict[str, Any]]:
    predicted = measured_hz * np.exp(-found.error)
    return [
        {
            "pose": poses[i],
            "mode": k + 1,
            "measured_hz": measured_hz[i, k],
            "predicted_hz": predicted[i, k],
            "sd_hz": predicted[i, k] * found.sd[i, k],
            "below": found.rank[i, k],
        }
        for i, k in np.argwhere(np.isfinite(found.rank)).tolist()
    ]
