"""Drift: a pose that was hit again, and hits that all lie to one side of what is expected."""

from collections.abc import Sequence

import numpy as np

from planner.campaign.events import MeasuredMode
from planner.campaign.model import SCATTER_POSES, Model
from planner.campaign.question import LEAST, compared
from planner.campaign.state import CampaignState, Measurement

SAME_MODE = 0.05  # of ln f: so near, a mode of a second visit is that of the first
# A visit differs from the one before, or all modes from what is expected, beyond so many sds, and
# by so much at least: less matters to nobody.
DIFFERS_SD, SUSPECT_SD, SMALLEST = 3.0, 2.0, 2e-3
LEAST_MODES = 2  # that have to lie to one side


def hit_again(model: Model, known: Measurement, modes: Sequence[MeasuredMode]) -> tuple[str, ...]:
    """A remark on what further hits at a measured pose show beside those before."""
    old = [mode for mode in known.modes if mode.likely]
    found = _beside(old, [mode for mode in modes if mode.likely], _scatter(model))
    if not found:
        return ()
    hz, off, sd = max(found, key=lambda one: abs(one[1]) / one[2])
    what = f"the mode at {hz:.2f} Hz by {100 * off:+.2f} %, {abs(off) / sd:.1f} sd of two visits"
    if abs(off) > max(DIFFERS_SD * sd, SMALLEST):
        return (
            f"{known.pose} was hit again and differs from the hits before, {what}: the robot has "
            f"changed since. Hit another early pose again; to keep the visits apart, undo this "
            f"import and give the hits a pose name of their own.",
        )
    return (f"{known.pose} was hit again and is as it was (at most {what}).",)


def suspected(
    model: Model, state: CampaignState, pose: str, joints_deg: tuple[float, ...],
    modes: Sequence[MeasuredMode],
) -> tuple[str, ...]:  # fmt: skip
    """A remark that proposes to hit the first pose again, where a new one hints at drift.

    `model` and `state` are those before the import; it is a hint only where they expect enough.
    """
    if len(model.labelled) < LEAST or pose in state.measurements:
        return ()
    here = compared(model, joints_deg, tuple(modes))
    near = np.abs(here.off) < SAME_MODE
    off = here.off[near]
    one_sided = abs(np.sum(np.sign(off))) == len(off) >= LEAST_MODES
    if not one_sided or np.any(here.in_sd[near] < SUSPECT_SD) or np.mean(np.abs(off)) < SMALLEST:
        return ()
    first = state.used[0]
    stands = model.cell.robot.joints.listed(first.joints_deg, 3)
    return (
        f"All modes at {pose} lie to one side of what is expected, by {100 * np.mean(off):+.2f} % "
        f"on average: the robot may have drifted (warmth, load, clamping). Hit {first.pose}, the "
        f"first pose, again ({stands}) and import with --pose {first.pose}: it says whether.",
    )


def _scatter(model: Model) -> float:
    """Sd of ln f from visit to visit over all modes; 0 before enough poses have told it.

    Of few poses one that has drifted makes it as large as the drift.
    """
    if len(model.labelled) < SCATTER_POSES:
        return 0.0
    return float(np.sqrt(np.mean(model.surrogate.visit_scatter**2)))


def _beside(
    old: Sequence[MeasuredMode], new: Sequence[MeasuredMode], scatter: float
) -> list[tuple[float, float, float]]:
    """Of each mode of `old` that is found again: Hz, new less old in ln f, and the sd of that."""
    found = []
    for mode in old:
        ratio = [float(np.log(other.frequency_hz / mode.frequency_hz)) for other in new]
        if not ratio or min(map(abs, ratio)) > SAME_MODE:
            continue
        k = int(np.argmin(np.abs(ratio)))
        own = [m.frequency_sd_hz / m.frequency_hz for m in (mode, new[k])]
        sd = float(np.sqrt(own[0] ** 2 + own[1] ** 2 + 2 * scatter**2))
        found.append((mode.frequency_hz, ratio[k], sd))
    return found
