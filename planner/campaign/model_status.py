"""How sure a campaign's model is: of poses left out, and of the cut that campaign.toml names."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from planner.campaign.model import Model
    from planner.surrogate.leave_one_out import LeaveOneOut

NAMED = 6  # poses in a sentence


def found_without(model: "Model") -> "tuple[LeaveOneOut, tuple[str, ...]]":
    """Errors of ln f (n, count), by the likelier of the two models of each mode; pose names."""
    from planner.surrogate.leave_one_out import leave_one_out

    found = leave_one_out(model.surrogate.primary.most_probable.outputs, len(model.labelled))
    return found, tuple(pose.pose for pose in model.labelled)


def left_out(model: "Model") -> dict[str, Any]:
    """Of a campaign's model: all "values" left out one by one, in words and in numbers.

    "coverage" is their share in the intervals by level, "worst" are the poses off by most, for what
    was expected of them. Of the "frequencies" "sd_hz" holds the noise too, and "below" is the share
    of the prediction below what was measured.
    """
    from planner.surrogate.leave_one_out import LEVELS, report

    found, poses = found_without(model)
    modes = tuple(f"the frequency of mode {k + 1}" for k in range(model.surrogate.count))
    values = int(np.isfinite(found.rank).sum()) if len(model.labelled) > 1 else 0
    told: dict[str, Any] = {"values": values, "coverage": None, "worst": [], "frequencies": []}
    told["text"] = tuple(report(found, poses, modes))
    if not values:
        return told
    measured_hz = model.seen.frequency_hz  # by modal analysis, or by the simulation's own shapes
    predicted = measured_hz * np.exp(-found.error)
    numbers = {
        "measured_hz": measured_hz, "predicted_hz": predicted, "sd_hz": predicted * found.sd,
        "below": found.rank,
    }  # fmt: skip
    return told | {
        "coverage": dict(zip(map(str, LEVELS), found.coverage().tolist(), strict=True)),
        "worst": [poses[i] for i in found.worst().tolist()],
        "frequencies": [
            {"pose": poses[i], "mode": k + 1, **{n: float(v[i, k]) for n, v in numbers.items()}}
            for i, k in np.argwhere(np.isfinite(found.rank)).tolist()
        ],
    }


def decision_status(model: "Model") -> dict[str, Any] | None:
    """How sure it is whether the cut of campaign.toml is stable, at each of the poses (u, dof).

    None where campaign.toml names no cut. "measurements_left" until each answer is right with the
    probability of [stop]; None where so many cannot be foreseen: the cut is too near its limit.
    """
    table = model.cell.config.cut
    if not table or not model.labelled:
        return None
    from planner.campaign.decision import measurements_left

    decision, probability = model.decision, model.cell.config.stop.probability
    assert decision is not None
    p, sure, left = decision.probability, decision.sure(probability), measurements_left(model)
    least = int(np.argmin(np.abs(p - 0.5)))
    stable, not_stable = np.sum(p >= probability), np.sum(1 - p >= probability)
    more = f"About {left} more measured poses make it sure."
    if left is None:
        more = "It is too near its limit there for a few measurements to make it sure."
    text = (
        f"The cut at {table.speed_rpm:g} rpm and {1e3 * table.depth_m:g} mm is stable at {stable} "
        f"of {len(p)} poses, not stable at {not_stable}, undecided at "
        f"{len(p) - stable - not_stable} (with {100 * probability:g} % probability each); least "
        f"sure is pose {least + 1}, stable with {100 * p[least]:.0f} %. "
        f"{'The decision is sure.' if sure else more}"
    )
    return {
        "speed_rpm": table.speed_rpm, "depth_m": table.depth_m,
        "joints_deg": model.cell.robot.joints.shown(decision.q), "stable_probability": p,
        "sure": sure, "measurements_left": left, "probability": probability, "text": text,
    }  # fmt: skip


def outside_remark(names: Sequence[str]) -> str:
    """Sentence about the poses that lie outside; "" without any."""
    if not names:
        return ""
    lie = "lies" if len(names) == 1 else "lie"
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return (
        f"{', '.join(names[:NAMED])}{more} {lie} outside the workspace of campaign.toml: sds and "
        f"bands are not to be trusted there."
    )
