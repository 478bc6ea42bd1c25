"""What the model would have said of each measured pose without it: a part of `status`."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from planner.campaign.model import Model
    from planner.surrogate.leave_one_out import LeaveOneOut


@dataclass(frozen=True)
class LeftOutFrequency:
    """A measured frequency beside its prediction without that pose.

    `sd_hz` holds the noise too; `below` is the share of the prediction below what was measured.
    """

    pose: str
    mode: int
    measured_hz: float
    predicted_hz: float
    sd_hz: float
    below: float


@dataclass(frozen=True)
class LeftOutValues:
    """All `values` left out one by one; `coverage` is their share in the intervals by level.

    `worst` are the poses off by most, for what was expected of them; `text` says all this.
    """

    values: int
    coverage: dict[str, float] | None
    worst: tuple[str, ...]
    frequencies: tuple[LeftOutFrequency, ...]
    text: tuple[str, ...]


def found_without(model: "Model") -> "tuple[LeaveOneOut, tuple[str, ...]]":
    """Errors of ln f (n, count), by the likelier of the two models of each mode; pose names."""
    from planner.surrogate.leave_one_out import leave_one_out

    found = leave_one_out(model.surrogate.primary.likeliest.outputs, len(model.labelled))
    return found, tuple(pose.pose for pose in model.labelled)


def left_out(model: "Model") -> LeftOutValues:
    """Of a campaign's model."""
    from planner.campaign.labels import frequencies
    from planner.surrogate.leave_one_out import LEVELS, report

    found, poses = found_without(model)
    modes = tuple(f"the frequency of mode {k + 1}" for k in range(model.surrogate.count))
    values = int(np.isfinite(found.rank).sum()) if len(model.labelled) > 1 else 0
    said = tuple(report(found, poses, modes))
    if not values:
        return LeftOutValues(0, None, (), (), said)
    coverage = dict(zip(map(str, LEVELS), found.coverage().tolist(), strict=True))
    worst = tuple(poses[i] for i in found.worst().tolist())
    measured_hz = frequencies(model.labelled)
    predicted = measured_hz * np.exp(-found.error)
    numbers = measured_hz, predicted, predicted * found.sd, found.rank
    rows = tuple(
        LeftOutFrequency(poses[i], k + 1, *(float(values[i, k]) for values in numbers))
        for i, k in np.argwhere(np.isfinite(found.rank)).tolist()
    )
    return LeftOutValues(values, coverage, worst, rows, said)
