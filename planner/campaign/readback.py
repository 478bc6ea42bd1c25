"""Whether the robot stood where it was sent, and not where the readback says: one was mistyped."""

import numpy as np

from planner.campaign.events import MeasuredMode, Question
from planner.campaign.model import Model
from planner.campaign.question import compared
from planner.campaign.state import CampaignState

LOG_ODDS = np.log(1000.0)  # against a mistyped readback, before anything is measured


def readback_question(
    model: Model,
    state: CampaignState,
    pose: str,
    joints_deg: tuple[float, ...],
    modes: tuple[MeasuredMode, ...],
) -> Question | None:
    """What to ask where modes are far from those expected at the readback, and fit the setpoint.

    `modes` are those of the new hits alone; `model` and `state` are those before the import.
    """
    proposed, joints = state.proposals.get(pose), model.cell.robot.joints
    if proposed is None or not model.labelled or not any(m.likely for m in modes):
        return None
    sent = proposed.joints_deg
    typed = np.flatnonzero(np.abs(np.subtract(sent, joints_deg)) > joints.same()).tolist()
    if not typed:
        return None
    here, there = compared(model, joints_deg, modes), compared(model, sent, modes)
    if not there.fits or there.log_density - here.log_density < LOG_ODDS:
        return None
    far = np.nan_to_num(here.in_sd)
    k = int(np.argmax(far))
    percent = float(100 * np.expm1(here.off[k]))
    which = ", ".join(
        f"{joints.names[i]} {joints.text(i, sent[i], 2)} or {joints.text(i, joints_deg[i], 2)}"
        for i in typed
    )
    text = (
        f"These hits fit the setpoint of {pose} better than its readback, where mode {k + 1} is "
        f"{percent:+.1f} % off: is {which}? If it was typed wrong, correct recordings.csv and "
        f"import again. Is the readback right as it is?"
    )
    return Question(text, k + 1, float(far[k]), percent, about="readback")
