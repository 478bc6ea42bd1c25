"""What an import notices that is to be acted upon while the robot still stands there: drift too."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.campaign.events import Imported, MeasuredMode
from planner.campaign.model import FEW_POSES, Model
from planner.campaign.state import CampaignState, Measurement
from planner.dataset.measure import MeasuredPose
from planner.frf.frf import unreciprocal

LEAST_POSES = 3  # measured, before which hints at drift are not to be relied on
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
    what = f"the mode at {hz:.2f} Hz by {100 * off:+.2f} %"
    if abs(off) > max(DIFFERS_SD * sd, SMALLEST):
        return (
            f"{known.pose} was hit again and differs from the hits before, {what}, "
            f"{abs(off) / sd:.1f} sd of two visits: the robot has "
            f"changed since. Hit another early pose again; to keep the visits apart, undo this "
            f"import and give the hits a pose name of their own.",
        )
    return (f"{known.pose} was hit again and is as it was (at most {what}).",)


@dataclass(frozen=True)
class Suspicion:
    """A hint at drift: the measured pose that is to be hit again, and why, in a sentence."""

    again: str
    text: str


def suspected(
    model: Model, state: CampaignState, pose: str, joints_deg: tuple[float, ...],
    modes: Sequence[MeasuredMode],
) -> Suspicion | None:  # fmt: skip
    """Whether hits at a new pose hint at drift, and which early pose then tells.

    `model` and `state` are those before the import; it is a hint only where they expect enough.
    """
    if len(model.labelled) < LEAST_POSES or state.hit_at(pose) is not None:
        return None
    off, in_sd = _off(model, joints_deg, [mode for mode in modes if mode.likely])
    one_sided = abs(np.sum(np.sign(off))) == len(off) >= LEAST_MODES
    if not one_sided or np.any(in_sd < SUSPECT_SD) or np.mean(np.abs(off)) < SMALLEST:
        return None
    early = _telling(state)
    joints = model.cell.robot.joints
    which = "the first pose" if early is state.used[0] else "an early pose"
    return Suspicion(
        early.pose,
        f"All modes at {pose} lie to one side of what is expected, by {100 * np.mean(off):+.2f} % "
        f"on average: the robot may have drifted (warmth, load, clamping). Hit {early.pose}, "
        f"{which}, again ({joints.listed(early.joints_deg, 3)}) and import with --pose "
        f"{early.pose}: it says whether. It is proposed next.",
    )


def _off(
    model: Model, joints_deg: tuple[float, ...], modes: Sequence[MeasuredMode]
) -> tuple[np.ndarray, np.ndarray]:
    """Of each mode that is expected at a pose and found near by: ln f of it, and that in sds."""
    hz, sd = (row[0] for row in model.frequencies(model.cell.robot.joints.internal([joints_deg])))
    found = []
    for expected, unsure in zip(hz, sd / hz, strict=True):
        off = [float(np.log(mode.frequency_hz / expected)) for mode in modes]
        k = int(np.argmin(np.abs(off))) if off else -1
        if k >= 0 and abs(off[k]) < SAME_MODE:
            own = modes[k].frequency_sd_hz / modes[k].frequency_hz
            found.append((off[k], abs(off[k]) / np.hypot(unsure, own)))
    away = np.array(found).reshape(-1, 2)
    return away[:, 0], away[:, 1]


def _telling(state: CampaignState) -> Measurement:
    """Of the earlier half of what was measured, the pose with most modes; of these the first.

    Since then the robot has changed most.
    """
    half = state.used[: (len(state.used) + 1) // 2]
    return max(half, key=lambda m: sum(mode.likely for mode in m.modes))


def _scatter(model: Model) -> float:
    """Sd of ln f from visit to visit over all modes; 0 before enough poses have told it.

    Of few poses one that has drifted makes it as large as the drift.
    """
    if len(model.labelled) < FEW_POSES:
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


def alerts(
    model: Model,
    state: CampaignState,
    event: Imported,
    measured: MeasuredPose,
    modes: Sequence[MeasuredMode],
    suspicion: Suspicion | None,
) -> tuple[str, ...]:
    """Remarks on new hits, their channels, reciprocity and drift.

    Args:
        model: Before the import, as is `state`.
        state: See `model`.
        event: The import.
        measured: All hits of the pose, the new ones last.
        modes: By the new hits alone.
        suspicion: Of drift, where they hint at it.
    """
    verdicts = measured.verdicts[-len(event.hits) :]
    told = tuple(dict.fromkeys(text for one in verdicts for text in one.remarks))
    if event.question is not None:
        return told
    if measured.frf is not None:
        told += unreciprocal(measured.frf)
    known = state.hit_at(event.pose)
    if known is not None:
        return told + hit_again(model, known, modes)
    return told if suspicion is None else (*told, suspicion.text)
