"""Whether hits are of the pose, and by the chain, that they are said to be of.

What was found of the hits before tells which FRFs are to be expected anywhere, and how unsure that
is. Where "something else" is likelier than the pose as stated, what that may be competes by
evidence: another known pose, the setpoint, an angle with the other sign, axes of the sensor
exchanged, a channel with a wrong scale, a sensor that turned, hits the other way or listed along
wrong axes, a delay, a high-pass or a window, one joint elsewhere, and a wrong angle of an earlier
pose, which bent what is expected.
Without a simulation, or before the first measurement, nothing is expected.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from planner.campaign.alternatives import (
    FAR_OFF_HITS,
    Alternative,
    StatedHits,
    chain_faults,
    far_off_hits,
    flipped_signs,
    instead,
    joint_offsets,
)
from planner.campaign.chain_mismatch import chain_mismatch
from planner.campaign.events import Question
from planner.campaign.model import Model
from planner.campaign.poses_together import SURE, PosesTogether
from planner.campaign.state import CampaignState
from planner.dataset.measure import MeasuredPose
from planner.fit.expected import ExpectedFrfs
from planner.fit.identified_robot import PLACED
from planner.frf.frf import Frf
from planner.recording.points import TOOL

NEAR_DEG = 2.0  # to the setpoint, in which angles that are none of degrees are recognised


def pose_mismatch(
    model: Model,
    state: CampaignState,
    pose: str,
    joints_deg: tuple[float, ...],
    measured: MeasuredPose,
) -> Question | None:
    """What to ask the engineer before new hits of a pose are believed; None: nothing.

    `measured` is of the new hits alone; `model` and `state` are those before the import.
    """
    fit, frf = model.low.identified_robot or model.low.rejected, measured.one_hit_frf
    if frf is None or fit is None:
        return None
    expected = ExpectedFrfs(fit.posterior, model.cell.config.modes.band_hz)
    joints = model.cell.robot.joints
    q, frf = joints.internal([joints_deg])[0], frf.within(expected.band_hz)
    sure, placed = fit.poses >= SURE, fit.poses >= PLACED
    stated = StatedHits(expected, q, frf, placed)
    answered = _called_right(state)
    said = "".join(answered)  # not asked again
    likely = _setpoint(model, state, pose, joints_deg)
    if sure and frf.layout == TOOL and FAR_OFF_HITS not in said:
        likely.append(far_off_hits(expected, q))
    if stated.agree(likely):
        return None
    mistakes = [*likely, *_poses(model, state, pose, joints_deg)]
    if sure:
        mistakes += flipped_signs(joints, joints_deg)
        mistakes += joint_offsets(joints, expected, frf, joints_deg)
    mistakes += (m for m in chain_faults(expected, q, frf, sure) if m.what not in said)
    fits = stated.best_alternative(mistakes)
    # Another known pose is none by chance; any angle may be, of the pose or of one before.
    if (
        fits is None
        or fits.about == "readback"
        or (fits.about != "chain" and StatedHits(expected, fits.q, frf).doubted)
    ):
        fits = _earlier(model, state, pose, joints_deg, frf) or fits
    if fits is None and not stated.impossible:
        return None
    if fits is None and not sure:
        return None if answered else chain_mismatch(model, pose, joints_deg, measured.frf)
    return _asked(pose, 100 * expected.off(q, frf), fits)


def _poses(
    model: Model, state: CampaignState, pose: str, joints_deg: tuple[float, ...]
) -> Iterator[Alternative]:
    """Where else the robot may be."""
    joints = model.cell.robot.joints
    known = {m.pose: m.joints_deg for m in state.used}
    known |= {name: state.proposals[name].joints_deg for name in state.open}
    known.pop(pose, None)
    for name, there in known.items():
        what = f"repeat those of {name}" if state.hit_at(name) else f"fit {name} far better"
        yield Alternative(joints.internal([there])[0], what, name)


def _setpoint(
    model: Model, state: CampaignState, pose: str, joints_deg: tuple[float, ...]
) -> list[Alternative]:
    """Where the robot was sent, where that is not what is stated."""
    joints = model.cell.robot.joints
    sent = state.proposals[pose].joints_deg if pose in state.proposals else joints_deg
    typed = np.flatnonzero(np.abs(np.subtract(sent, joints_deg)) > joints.same()).tolist()
    which = " ".join(instead(joints, i, sent[i], joints_deg[i]) for i in typed)
    what = f"fit the setpoint of {pose} ({which.rstrip(',')}) better than its readback."
    if np.all(np.abs(np.rad2deg(joints_deg) - sent) < NEAR_DEG):
        what = f"fit the setpoint of {pose} better than its readback: are its angles in radians?"
    there = joints.internal([sent])[0]
    return [Alternative(there, what, about="readback", rival=True)] if typed else []


def _earlier(
    model: Model, state: CampaignState, pose: str, joints_deg: tuple[float, ...], frf: Frf
) -> Alternative | None:
    """An angle mistyped at a pose measured before, where all are likelier so.

    `frf` are the new hits of a pose at `joints_deg`.
    """
    joints, fit = model.cell.robot.joints, model.low.identified_robot or model.low.rejected
    if fit is None or frf.layout.sensors != TOOL.sensors:
        return None
    known = [*((m.pose, m.joints_deg) for m in model.used), (pose, joints_deg)]
    q = joints.internal([angles for _, angles in known])
    poses = PosesTogether(
        fit.posterior, model.cell.config.modes.band_hz, joints, q, (*model.frfs, frf)
    )
    asked = [(m.pose, m.question) for m in model.used if m.question is not None]
    right = {a.fits or name for name, a in asked if a.about in ("readback", "earlier")}
    answered = [i for i, (name, _) in enumerate(known[:-1]) if name in right]
    found = poses.wrong([_setpoint(model, state, *one) for one in known], answered)
    return replace(found[1], pose=known[found[0]][0], about="earlier") if found else None


def _called_right(state: CampaignState) -> tuple[str, ...]:
    """What the engineer was asked of the chain before, where the hits were used then."""
    asked = (m.question for m in state.measurements.values() if m.question is not None)
    return tuple(question.text for question in asked if question.about == "chain")


def _asked(pose: str, off_percent: float, fits: Alternative | None) -> Question:
    if fits is not None and fits.about == "chain":
        text = f"At {pose}, {fits.what} Are these hits right as they are?"
    elif fits is not None and fits.about == "readback":
        text = f"These hits {fits.what} Are the angles right as stated?"
    elif fits is not None and fits.about == "earlier":
        again = fits.pose == pose
        those = f"those of {fits.pose}" + (" before" if again else "")
        whose = "the angles stated then" if again else "its angles"
        text = (
            f"These hits contradict {those}, and {those} {fits.what} Are {whose} right as they are?"
        )
    else:
        instead = fits.what if fits else "fit no other known pose either"
        text = (
            f"These hits are {off_percent:.0f} % off the FRFs expected at {pose}; they {instead}. "
            f"Is the robot at {pose}?"
        )
    told = fits or Alternative(np.zeros(0), "")
    return Question(text, off_percent=off_percent, fits=told.pose, about=told.about)
